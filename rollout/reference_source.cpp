#include "duet/rollout/reference_source.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/controllers/stance.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"

namespace duet {

const Reference* MotionReference::at(const TickView& present) {
  reference_ = motion_.reference(std::min(present.tick, motion_.frames() - 1));
  return &reference_;
}

StreamReference::StreamReference(std::shared_ptr<const RobotModel> robot, const StreamOptions& options,
                                 std::uint64_t seed)
    : random_(seed, stream_key({"stream", "reference"})), stream_(std::move(robot), options) {
  stream_.reset(random_);
}

void StreamReference::begin(const RobotState&) {}

const Reference* StreamReference::at(const TickView& present) {
  if (present.tick > 0) stream_.advance(random_);
  return &stream_.reference();
}

namespace {

void check_share(double share, const char* name) {
  require(share >= 0.0 && share <= 1.0, "reference stream: {} is {}, expected a share in [0, 1]", name, share);
}

// Moves `value` to `goal` no faster than `rate`.
double approach(double value, double goal, double rate) {
  return value + std::clamp(goal - value, -rate * kTick, rate * kTick);
}

}  // namespace

ReferenceStream::ReferenceStream(std::shared_ptr<const RobotModel> robot, const StreamOptions& options)
    : robot_(std::move(robot)), options_(options), upper_(Stance(*robot_).upper()) {
  check_share(options.moving, "moving");
  check_share(options.crouch, "crouch");
  check_share(options.bow, "bow");
  check_share(options.motions, "motions");
  require(options.motions == 0.0 || (options.data && !options.data->empty()),
          "reference stream: a share of motions is asked for, but there are none");
  if (options.crouch > 0.0) bounds_ = robot_->bounds_of_root();
  const bool draws_poses = options.moves_upper_body || options.holds_upper_body;
  require(!draws_poses || upper_.empty() || !robot_->roles.pose_ranges.empty(),
          "reference stream: robot '{}' has no 'pose_ranges' in its card, which random poses need", robot_->name);
  if (options.data)
    for (const RobotMotion& motion : *options.data)
      require(motion.q.rows() == robot_->dof(), "reference stream: a motion of {} joints for a robot of {}",
              motion.q.rows(), robot_->dof());
  reference_.q = from_ = to_ = neutral();
}

const Eigen::VectorXd& ReferenceStream::neutral() const {
  return options_.posture ? *options_.posture : robot_->neutral;
}

void ReferenceStream::reset(Random& random) {
  tick_ = 0;
  yaw_ = pitch_ = pitch_goal_ = 0.0;
  height_ = height_goal_ = robot_->standing_height;
  velocity_.setZero();
  motion_ = nullptr;
  reference_.X_WB = {Eigen::Quaterniond::Identity(), {0.0, 0.0, height_}};
  reference_.q = neutral();
  draw_pose(random, from_);
  if (options_.from_neutral) from_ = neutral();
  draw_pose(random, to_);
  segment_ = 0.0;
  segment_length_ = random.uniform(0.6, 2.0);
  command_ticks_ = random.chance(0.3) ? random.below(100) : 0;
  if (options_.motions > 0.0 && random.chance(options_.motions)) {
    motion_ = &(*options_.data)[random.below(static_cast<int>(options_.data->size()))];
    frame_ = random.below(std::max(1, motion_->frames() - 250));
    const Pose& first = motion_->root[frame_];
    const Pose ground{yaw_rotation(yaw_of(first.R)), {first.p.x(), first.p.y(), 0.0}};
    X_OM_ = ground.inverse();
    follow_motion();
    return;
  }
  move_upper_body(random);
}

void ReferenceStream::advance(Random& random) {
  ++tick_;
  if (motion_ != nullptr) {
    frame_ = std::min(frame_ + 1, motion_->frames() - 1);
    follow_motion();
    return;
  }
  move_upper_body(random);
  if (options_.script)
    follow_script();
  else if (--command_ticks_ < 0)
    draw_command(random);
  move_root();
}

void ReferenceStream::follow_motion() {
  reference_.X_WB = X_OM_ * motion_->root[frame_];
  reference_.q = motion_->q.col(frame_);
}

void ReferenceStream::draw_pose(Random& random, Eigen::VectorXd& q) const {
  q = neutral();
  if (!options_.moves_upper_body && !options_.holds_upper_body) return;
  // Some goals are the neutral pose; one that is held is not.
  const double share = !options_.holds_upper_body && random.chance(0.25) ? 0.0 : 1.0;
  for (const int joint : upper_) {
    const auto range = robot_->roles.pose_ranges.find(joint);
    const double still = neutral()[joint];
    const auto [low, high] = range == robot_->roles.pose_ranges.end() ? std::pair(still, still) : range->second;
    const double drawn = random.uniform(low, high);
    q[joint] += share * (drawn - q[joint]);
  }
}

void ReferenceStream::move_upper_body(Random& random) {
  segment_ += kTick;
  if (segment_ >= segment_length_) {
    from_ = to_;
    if (!options_.holds_upper_body) draw_pose(random, to_);
    segment_ = 0.0;
    segment_length_ = random.uniform(0.6, 2.0);
  }
  const double share = smooth_step(segment_ / segment_length_);
  for (const int joint : upper_) reference_.q[joint] = from_[joint] + share * (to_[joint] - from_[joint]);
}

// Pure sideways steps are as frequent as all others together: what is rare in training is leant into, not walked.
void ReferenceStream::draw_command(Random& random) {
  command_ticks_ = random.below(200) + 100;
  height_goal_ =
      random.chance(options_.crouch) ? random.uniform(bounds_.least_crouch, bounds_.highest) : robot_->standing_height;
  pitch_goal_ = random.chance(options_.bow) ? random.uniform(-0.05, 0.35) : 0.0;
  velocity_.setZero();
  if (!random.chance(options_.moving)) return;
  const double top = options_.max_speed, side = random.chance(0.5) ? 1.0 : -1.0, kind = random.uniform();
  if (kind < 0.22) {
    velocity_.x() = random.chance(0.65) ? random.uniform(0.1, top) : -random.uniform(0.05, 0.55 * top);
  } else if (kind < 0.55) {
    velocity_.y() = side * random.uniform(0.05, 0.6 * top);
  } else if (kind < 0.75) {
    const double direction = random.uniform(-std::numbers::pi, std::numbers::pi),
                 speed = random.uniform(0.08, 0.6 * top);
    velocity_ = {speed * std::cos(direction), speed * std::sin(direction), 0.0};
  } else if (kind < 0.88) {
    velocity_.z() = side * random.uniform(0.1, 0.45);
  } else {
    velocity_ = {random.uniform(-0.4, 0.8) * top, random.uniform(-0.4, 0.4) * top, random.uniform(-0.35, 0.35)};
  }
}

void ReferenceStream::follow_script() {
  const double t = tick_ * kTick;
  const ScriptedCommand& script = *options_.script;
  bool on = t >= script.begin && t < script.end;
  if (on && script.pause > 0.0) on = std::fmod(t - script.begin, 2.0 * script.pause) < script.pause;
  velocity_ = on ? script.velocity : Eigen::Vector3d::Zero();
}

void ReferenceStream::move_root() {
  height_ = approach(height_, height_goal_, 0.15);
  pitch_ = approach(pitch_, pitch_goal_, 0.4);
  const double c = std::cos(yaw_), s = std::sin(yaw_);
  reference_.X_WB.p.x() += kTick * (c * velocity_.x() - s * velocity_.y());
  reference_.X_WB.p.y() += kTick * (s * velocity_.x() + c * velocity_.y());
  reference_.X_WB.p.z() = height_;
  yaw_ += kTick * velocity_.z();
  reference_.X_WB.R = yaw_rotation(yaw_) * Eigen::AngleAxisd(pitch_, Eigen::Vector3d::UnitY());
}

}  // namespace duet
