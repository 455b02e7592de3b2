#include "duet/rollout/perturbations/partner_perturbation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/numbers.h"
#include "duet/core/recording.h"
#include "duet/core/robot_state.h"

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

// Where it is on the ground beside where the clip has it.
class Way {
 public:
  Way(const PartnerVariation& variation, double yaw, int act_begin)
      : back_(-std::cos(yaw), -std::sin(yaw), 0.0),
        left_(-std::sin(yaw), std::cos(yaw), 0.0),
        comes_(variation.comes_m.value_or(0.0)),
        on_(variation.moves_on_m.value_or(0.0)),
        aside_(variation.aside_m.value_or(0.0)),
        half_(std::max(1.0, 0.5 * act_begin)) {}

  // `at`: frames since the episode's first.
  [[nodiscard]] Eigen::Vector3d offset(double at) const {
    const double come = comes_ * (1.0 - smooth(at / half_)), go = smooth((at - half_) / half_);
    return (come + go * on_) * back_ + go * aside_ * left_;
  }

 private:
  static double smooth(double s) { return smooth_step(std::clamp(s, 0.0, 1.0)); }

  Eigen::Vector3d back_, left_;
  double comes_, on_, aside_, half_;
};

bool has_way(const PartnerVariation& variation) {
  return variation.comes_m || variation.moves_on_m || variation.aside_m;
}

// The mirror image of a pose in the vertical plane through the pelvis along the heading, left and right exchanged.
void mirror_frame(const PointTracks& joints, int t, HumanMotion& motion) {
  const Eigen::Quaterniond R_WH = yaw_rotation(heading(joints, t));
  const Eigen::Vector3d pelvis = joints.at(t, kPelvis), mirror(1.0, -1.0, 1.0);
  for (int j = 0; j < kSmplJoints; ++j) {
    const Eigen::Vector3d p_H = R_WH.conjugate() * (joints.at(t, kSmplMirror[j]) - pelvis);
    motion.joints.at(t, j) = pelvis + R_WH * p_H.cwiseProduct(mirror);
  }
  if (motion.rotations.empty()) return;
  const auto first = motion.rotations.begin() + static_cast<std::ptrdiff_t>(t) * kSmplJoints;
  const std::vector<Eigen::Quaterniond> before(first, first + kSmplJoints);
  for (int j = 0; j < kSmplJoints; ++j) {
    const Eigen::Quaterniond R_HJ = R_WH.conjugate() * before[static_cast<std::size_t>(kSmplMirror[j])];
    first[j] = R_WH * Eigen::Quaterniond(R_HJ.w(), -R_HJ.x(), R_HJ.y(), -R_HJ.z());  // S R S, S = diag(1, -1, 1)
  }
}

void mirror_poses(HumanMotion& motion) {
  const PointTracks joints = motion.joints;
  for (int t = 0; t < motion.frames(); ++t) mirror_frame(joints, t, motion);
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
  const PartnerVariation varied = variation.value_or(PartnerVariation());
  const int act = std::min(clip_frame + phases.act_begin, clip.frames() - 1);
  const Way way(varied, has_way(varied) ? heading(clip.joints, act) : 0.0, phases.act_begin);
  std::vector<double> places(static_cast<std::size_t>(frames));
  PlayHead head(varied, phases);
  for (int t = 0; t < frames; ++t, head.advance()) {
    const double at = std::min(clip_frame + head.at(), last);
    const double whole = std::floor(at);
    add_frame(clip, static_cast<int>(whole), at - whole, t, motion);
    places[static_cast<std::size_t>(t)] = head.at();
  }
  if (varied.scale != 1.0) scale_bodies(varied.scale, motion.joints);
  if (varied.other_hand.value_or(false)) mirror_poses(motion);
  if (has_way(varied))
    for (int t = 0; t < frames; ++t)
      motion.joints.frame(t).colwise() += way.offset(places[static_cast<std::size_t>(t)]);
  return motion;
}

Perception::Perception(const PerceptionPlan& plan, std::uint64_t seed)
    : plan_(plan),
      jitter_(seed, stream_key({"perception", "jitter"})),
      dropout_(seed, stream_key({"perception", "dropout"})),
      past_(static_cast<std::size_t>(ticks_of(plan.latency_ms / 1000.0)) + 1) {
  if (!plan_.jump) return;
  const double angle = 2.0 * std::numbers::pi * Random(seed, stream_key({"perception", "jump"})).uniform();
  jump_ = plan_.jump->metres * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
}

// The draws of a tick do not depend on whether the partner is seen: two plans with one seed have the same noise.
const Perception::Joints& Perception::seen(int tick, const Joints& partner) {
  if (tick == 0) std::fill(past_.begin(), past_.end(), partner);
  measure(tick, delayed(partner));
  return seen_;
}

bool Perception::held(int tick) const {
  if (tick == 0) return false;  // a first look there is
  if (plan_.vanish && tick >= ticks_of(*plan_.vanish)) return true;
  return plan_.freeze && tick >= ticks_of(plan_.freeze->at) &&
         tick < ticks_of(plan_.freeze->at) + ticks_of(plan_.freeze->duration);
}

const Perception::Joints& Perception::delayed(const Joints& partner) {
  newest_ = (newest_ + 1) % past_.size();
  past_[newest_] = partner;
  return past_[(newest_ + 1) % past_.size()];  // the oldest
}

void Perception::measure(int tick, const Joints& partner) {
  const bool jumped = plan_.jump && tick >= ticks_of(plan_.jump->at);
  const bool holds = held(tick);
  for (int j = 0; j < static_cast<int>(partner.cols()); ++j) {
    Eigen::Vector3d p_W = partner.col(j);
    if (jumped) p_W += jump_;
    if (plan_.jitter > 0.0)
      for (double& x : p_W) x += plan_.jitter * jitter_.normal();
    const bool dropped = plan_.dropout > 0.0 && dropout_.chance(plan_.dropout);
    if (!holds && (tick == 0 || !dropped)) seen_.col(j) = p_W;
  }
}

}  // namespace duet
