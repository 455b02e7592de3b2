#include "duet/rollout/partner_variation.h"

#include <algorithm>
#include <cmath>

#include "duet/core/clock.h"

namespace duet {
namespace {

// Where in the clip the partner is, in frames since the episode's first, tick by tick.
class PlayHead {
 public:
  PlayHead(const PartnerVariation& variation, const Phases& phases)
      : speed_(variation.speed),
        waits_(std::max(0, ticks_of(variation.shift_s))),
        hesitates_(ticks_of(variation.hesitate_s)),
        hesitation_(0.5 * phases.act_begin),
        turn_(variation.abort ? 0.5 * (phases.act_begin + phases.act_end) : HUGE_VAL),
        begin_(std::min(std::max(0, -ticks_of(variation.shift_s)), phases.act_begin)),
        at_(begin_) {}

  [[nodiscard]] double at() const { return at_; }

  void advance() {
    if (waits_ > 0) {
      --waits_;
    } else if (at_ >= hesitation_ && hesitates_ > 0) {
      --hesitates_;
    } else {
      at_ = std::max(begin_, at_ + direction_ * speed_);
      if (at_ >= turn_) direction_ = -1.0;
    }
  }

 private:
  double speed_;
  int waits_, hesitates_;
  double hesitation_, turn_, begin_, at_, direction_ = 1.0;
};

// Two frames of the clip mixed; s = 0 gives the first to the bit.
void add_frame(const HumanMotion& clip, int first, double s, int to, HumanMotion& motion) {
  const int second = std::min(first + 1, clip.frames() - 1);
  motion.joints.frame(to) = clip.joints.frame(first);
  if (s > 0.0) motion.joints.frame(to) += s * (clip.joints.frame(second) - clip.joints.frame(first));
  if (clip.rotations.empty()) return;
  for (int j = 0; j < kSmplJoints; ++j) {
    const auto index = [j](int frame) {
      return static_cast<std::size_t>(frame) * kSmplJoints + static_cast<std::size_t>(j);
    };
    const Eigen::Quaterniond& R = clip.rotations[index(first)];
    motion.rotations.push_back(s > 0.0 ? R.slerp(s, clip.rotations[index(second)]) : R);
  }
}

void scale_bodies(double scale, PointTracks& joints) {
  for (int t = 0; t < joints.frames(); ++t) {
    const Eigen::Vector3d foot_point(joints.at(t, kPelvis).x(), joints.at(t, kPelvis).y(), 0.0);
    joints.frame(t) = ((joints.frame(t).colwise() - foot_point) * scale).colwise() + foot_point;
  }
}

}  // namespace

int episode_ticks(const PartnerVariation& variation, int reference_ticks) {
  const double slower = std::max(0.0, 1.0 / variation.speed - 1.0);
  return reference_ticks + std::max(0, ticks_of(variation.shift_s)) + ticks_of(variation.hesitate_s) +
         static_cast<int>(std::lround(slower * reference_ticks));
}

HumanMotion partner_motion(const HumanMotion& clip, const std::optional<PartnerVariation>& variation,
                           const Phases& phases, int clip_frame, int frames) {
  HumanMotion motion;
  motion.rate_hz = clip.rate_hz;
  motion.joints = PointTracks(frames, clip.joints.points());
  motion.rotations.reserve(clip.rotations.empty() ? 0 : static_cast<std::size_t>(frames) * kSmplJoints);
  const double last = clip.frames() - 1;
  PlayHead head(variation.value_or(PartnerVariation()), phases);
  for (int t = 0; t < frames; ++t, head.advance()) {
    const double at = std::min(clip_frame + head.at(), last);
    const double whole = std::floor(at);
    add_frame(clip, static_cast<int>(whole), at - whole, t, motion);
  }
  if (variation && variation->scale != 1.0) scale_bodies(variation->scale, motion.joints);
  return motion;
}

}  // namespace duet
