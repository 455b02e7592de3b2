#include "duet/metrics/onset.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/core/skeleton.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

Eigen::Vector3d median_place(const Eigen::Matrix3Xd& track, Eigen::Index frames) {
  Eigen::Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    Eigen::VectorXd values = track.row(axis).head(frames);
    std::nth_element(values.begin(), values.begin() + frames / 2, values.end());
    median[axis] = values[frames / 2];
  }
  return median;
}

// First of `stay` frames in a row, from `begin` on, whose mean over `window` frames exceeds the threshold; -1 where
// there are none.
Eigen::Index first_above(const Eigen::VectorXd& distance, Eigen::Index begin, Eigen::Index window, Eigen::Index stay) {
  Eigen::Index run = 0;
  for (Eigen::Index t = begin; t + window <= distance.size(); ++t) {
    run = distance.segment(t, window).mean() > kOnsetDistance ? run + 1 : 0;
    if (run == stay) return t + 1 - stay;
  }
  return -1;
}

std::vector<Eigen::Matrix3Xd> hands_of_robot(const Recording& recording, const RobotModel& robot) {
  const int frames[] = {robot.track_frame("lhand"), robot.track_frame("rhand")};
  std::vector<Eigen::Matrix3Xd> hands(2, Eigen::Matrix3Xd(3, recording.frames()));
  Kinematics kinematics(robot);
  for (int t = 0; t < recording.frames(); ++t) {
    const RobotState& state = recording.robot[static_cast<std::size_t>(t)];
    kinematics.update(state.X_WB, state.q);
    for (std::size_t hand = 0; hand < hands.size(); ++hand)
      hands[hand].col(t) = state.X_WB.inverse() * kinematics.frame_position(frames[hand]);
  }
  return hands;
}

std::vector<Eigen::Matrix3Xd> wrists_of(const PointTracks& partner) {
  const int wrists[] = {kLeftWrist, kRightWrist};
  std::vector<Eigen::Matrix3Xd> hands(2, Eigen::Matrix3Xd(3, partner.frames()));
  for (int t = 0; t < partner.frames(); ++t) {
    const Eigen::Vector3d left = partner.at(t, kLeftHip) - partner.at(t, kRightHip);
    const Eigen::Quaterniond R_RW = yaw_rotation(std::atan2(-left.x(), left.y())).conjugate();
    for (std::size_t hand = 0; hand < hands.size(); ++hand)
      hands[hand].col(t) = R_RW * (partner.at(t, wrists[hand]) - partner.at(t, kPelvis));
  }
  return hands;
}

}  // namespace

double onset(const std::vector<Eigen::Matrix3Xd>& hands, double rate_hz) {
  const auto rest = static_cast<Eigen::Index>(std::lround(kOnsetRest * rate_hz));
  const auto window = static_cast<Eigen::Index>(std::lround(kOnsetWindow * rate_hz));
  const auto stay = static_cast<Eigen::Index>(std::lround(kOnsetStay * rate_hz));
  Eigen::Index first = -1;
  for (const Eigen::Matrix3Xd& hand : hands) {
    if (hand.cols() < rest + window) continue;
    const Eigen::Vector3d place = median_place(hand, rest);
    const Eigen::VectorXd distance = (hand.colwise() - place).colwise().norm().transpose();
    const Eigen::Index found = first_above(distance, rest, window, stay);
    if (found >= 0) first = first < 0 ? found : std::min(first, found);
  }
  return first < 0 ? std::numeric_limits<double>::quiet_NaN() : static_cast<double>(first) / rate_hz;
}

std::map<std::string, double> onsets(const Recording& recording, const RobotModel& robot) {
  std::map<std::string, double> values = {{"onset_s", onset(hands_of_robot(recording, robot), recording.rate_hz)}};
  if (!recording.partner.empty()) values["partner_onset_s"] = onset(wrists_of(recording.partner), recording.rate_hz);
  return values;
}

}  // namespace duet
