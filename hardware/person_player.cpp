#include "duet/hardware/person_player.h"

#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

const PersonPlay& checked_play(const PersonPlay& play) {
  require(play.rate > 0.0 && std::isfinite(play.rate), "player of a person: expected a rate above 0, found {}",
          play.rate);
  require(play.noise >= 0.0 && std::isfinite(play.noise),
          "player of a person: expected a noise of at least 0 m, found {}", play.noise);
  require(play.unseen >= 0.0 && play.unseen <= 1.0, "player of a person: expected a share from 0 to 1, found {}",
          play.unseen);
  return play;
}

}  // namespace

PersonPlayer::PersonPlayer(const HumanMotion& person, const Pose& X_WB, const Pose& X_BC, const PersonPlay& play)
    : person_(resample(person, checked_play(play).rate)),
      X_CW_((X_WB * X_BC).inverse()),
      play_(play),
      random_(play.seed, stream_key({"person-player"})) {}

bool PersonPlayer::next(PersonEstimate& estimate) {
  if (frame_ >= person_.frames()) return false;
  estimate.sequence = static_cast<std::uint64_t>(frame_) + 1;
  estimate.stamp = frame_ / play_.rate;
  estimate.seen = !random_.chance(play_.unseen);
  for (int j = 0; j < kSmplJoints; ++j) {
    const Eigen::Vector3d noise(random_.normal(), random_.normal(), random_.normal());
    estimate.joints.col(j) = X_CW_ * Eigen::Vector3d(person_.joints.at(frame_, j)) + play_.noise * noise;
  }
  ++frame_;
  return true;
}

Pose base_of_reactor(const HumanMotion& reactor, double height) {
  const Eigen::Vector3d pelvis = reactor.joints.at(0, kPelvis);
  return {yaw_rotation(heading(reactor.joints, 0)), {pelvis.x(), pelvis.y(), height}};
}

}  // namespace duet
