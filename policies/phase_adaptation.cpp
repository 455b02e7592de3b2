#include "duet/policies/phase_adaptation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

void check_joints(const RobotMotion& motion, const RobotModel& robot) {
  require(static_cast<int>(motion.joint_names.size()) == robot.dof(),
          "phase adaptation: expected the {} joints of robot '{}', found {}", robot.dof(), robot.name,
          motion.joint_names.size());
  for (int j = 0; j < robot.dof(); ++j) {
    const auto k = static_cast<std::size_t>(j);
    require(motion.joint_names[k] == robot.joints[k].name, "phase adaptation: expected joint {} to be '{}', found '{}'",
            j, robot.joints[k].name, motion.joint_names[k]);
  }
}

void check(const RobotMotion& motion, const Phases& phases, const RobotModel& robot, const AdaptationOptions& options) {
  validate(motion, "phase adaptation");
  require(motion.rate_hz == kTickRate, "phase adaptation: expected a motion at {} Hz, found {} Hz", kTickRate,
          motion.rate_hz);
  check_joints(motion, robot);
  require(0 <= phases.act_begin && phases.act_begin < phases.act_end && phases.act_end <= motion.frames(),
          "phase adaptation: expected an act inside [0, {}), found [{}, {})", motion.frames(), phases.act_begin,
          phases.act_end);
  const auto check_option = [](const char* name, double value) {
    require(std::isfinite(value) && value >= 0.0, "phase adaptation: expected {} >= 0, found {}", name, value);
  };
  check_option("start_radius", options.start_radius);
  check_option("lead", options.lead);
  check_option("return_time", options.return_time);
  check_option("mild_yaw", options.mild_yaw);
  check_option("walks", options.walks);
}

// `offset` from `pose`, uniform over the disc of `radius` in the ground plane.
Pose displaced(const Pose& pose, double radius, std::uint64_t seed) {
  Random random(seed, stream_key({"phase_adaptation", "start"}));
  const double distance = radius * std::sqrt(random.uniform());
  const double angle = 2.0 * std::numbers::pi * random.uniform();
  return {pose.R, pose.p + distance * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0)};
}

// Frames [begin, end) of a motion.
RobotMotion cut(const RobotMotion& motion, int begin, int end) {
  return {motion.rate_hz,
          motion.joint_names,
          {motion.root.begin() + begin, motion.root.begin() + end},
          motion.q.middleCols(begin, end - begin)};
}

// Applies kAct to one motion whose base may be the trunk. Frames and phases are those of that motion.
class Adaptation {
 public:
  Adaptation(RobotMotion& motion, const Phases& phases, const RobotModel& robot)
      : motion_(motion), phases_(phases), robot_(robot) {}

  // All frames: upright on standing legs at the act position.
  void stand() {
    const Pose stance = pelvis_at_act();
    const std::vector<int> legs = leg_joints(robot_);
    for (int t = 0; t < motion_.frames(); ++t) {
      for (const int j : legs) motion_.q(j, t) = robot_.neutral[j];
      root(t) = base_is_pelvis(robot_) ? stance : stance * pelvis_in_base(robot_, motion_.q.col(t)).inverse();
    }
  }

  // Act: turns the waist so that the trunk over the pelvis of stand() is oriented as it is now. Comes before stand().
  void keep_torso() {
    const TorsoOrientation torso(robot_);
    const Pose stance = pelvis_at_act();
    for (int t = phases_.act_begin; t < phases_.act_end; ++t) {
      Eigen::VectorXd q = motion_.q.col(t);
      torso.solve(stance.R.conjugate() * pelvis(t).R * torso.at(q), q);
      motion_.q.col(t) = q;
    }
  }

 private:
  Pose& root(int t) { return motion_.root[static_cast<std::size_t>(t)]; }
  Pose pelvis(int t) { return base_is_pelvis(robot_) ? root(t) : root(t) * pelvis_in_base(robot_, motion_.q.col(t)); }
  // The pelvis upright over where it is in the middle of the act: a person may still be walking in its first frames.
  Pose pelvis_at_act() {
    Pose stance = robot_.standing_state(pelvis((phases_.act_begin + phases_.act_end) / 2)).X_WB;
    if (base_is_pelvis(robot_)) return stance;
    const double lower = pelvis_in_base(robot_, robot_.neutral).p.z();
    return {stance.R, stance.p + Eigen::Vector3d(0.0, 0.0, lower)};
  }

  RobotMotion& motion_;
  Phases phases_;
  const RobotModel& robot_;
};

AdaptedMotion adapt_approach(RobotMotion motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options, std::uint64_t seed) {
  const Pose start = displaced(motion.root.front(), options.start_radius, seed);
  if (options.walks > 0.0) {
    walk_and_wait(motion, phases, robot, start, options.walks);
  } else {
    walk_straight(motion, phases, start);
    raise_upper_body(motion, phases, robot, phases.act_begin);
  }
  lower_upper_body(motion, phases, robot, options.return_time * kTickRate);
  hold_frame(motion, robot, phases.act_end, motion.frames(), phases.act_end - 1);
  return {std::move(motion), phases, 0};
}

AdaptedMotion adapt_for_real(RobotMotion motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options) {
  sim_to_real(motion, phases, robot, options.mild_yaw);
  return {std::move(motion), phases, 0};
}

AdaptedMotion adapt_in_place(const RobotMotion& motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options) {
  // A lead longer than the clip is all of it; the bound also keeps the product inside int.
  const double lead = std::min(std::round(options.lead * kTickRate), static_cast<double>(phases.act_begin));
  const int begin = phases.act_begin - static_cast<int>(lead);
  const Phases shifted{phases.act_begin - begin, phases.act_end - begin};
  RobotMotion adapted = cut(motion, begin, motion.frames());
  Adaptation adaptation(adapted, shifted, robot);
  if (options.hold_stance && options.keep_torso) adaptation.keep_torso();
  raise_upper_body(adapted, shifted, robot, shifted.act_begin);
  lower_upper_body(adapted, shifted, robot, options.return_time * kTickRate);
  if (options.hold_stance) {
    adaptation.stand();
  } else {
    hold_frame(adapted, robot, 0, shifted.act_begin, shifted.act_begin);
    hold_frame(adapted, robot, shifted.act_end, adapted.frames(), shifted.act_end - 1);
  }
  return {std::move(adapted), shifted, begin};
}

}  // namespace

AdaptedMotion adapt_by_phase(const RobotMotion& motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options, std::uint64_t seed) {
  check(motion, phases, robot, options);
  switch (options.start) {
    case StartMode::kClip:
      return {motion, phases, 0};
    case StartMode::kApproach:
      return adapt_approach(motion, phases, robot, options, seed);
    case StartMode::kAct:
      return adapt_in_place(motion, phases, robot, options);
    case StartMode::kSimToReal:
      return adapt_for_real(motion, phases, robot, options);
  }
  throw std::invalid_argument("phase adaptation: unknown start mode");
}

namespace {

// Whether a leg hangs on the link: its waist is below the trunk.
bool carries_legs(const RobotModel& robot, int link) {
  if (link == 0) return false;
  for (const std::vector<int>& leg : robot.roles.legs)
    for (int above = leg.empty() ? 0 : leg.front() + 1; above > 0; above = robot.links[above].parent)
      if (above == link) return true;
  return false;
}

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& R) {
  const Eigen::AngleAxisd turn(R.w() < 0.0 ? Eigen::Quaterniond(-R.coeffs()) : R);
  return turn.angle() * turn.axis();
}

}  // namespace

TorsoOrientation::TorsoOrientation(const RobotModel& robot) {
  const std::vector<int>& waist = robot.roles.waist;
  const int last = waist.empty() ? 0 : *std::ranges::max_element(waist) + 1;
  for (int link = last; link > 0; link = robot.links[static_cast<std::size_t>(link)].parent) {
    const RobotLink& moved = robot.links[static_cast<std::size_t>(link)];
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(link) - 1];
    const bool free = std::ranges::find(waist, link - 1) != waist.end();
    chain_.push_back({moved.X_PL.R, moved.axis, link - 1, free, joint.lower, joint.upper});
  }
  if (carries_legs(robot, last))
    turn_round();
  else
    std::ranges::reverse(chain_);
}

// From the link up to the base: each hinge turns the other way, and its place in the parent comes after it.
void TorsoOrientation::turn_round() {
  Eigen::Quaterniond R_before = Eigen::Quaterniond::Identity();
  for (Hinge& hinge : chain_) {
    const Eigen::Quaterniond R_after = hinge.R_before.conjugate();
    hinge.R_before = R_before;
    hinge.axis = -hinge.axis;
    R_before = R_after;
  }
  R_end_ = R_before;
}

Eigen::Quaterniond TorsoOrientation::at(const Eigen::VectorXd& q) const {
  Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
  for (const Hinge& hinge : chain_) R = R * hinge.R_before * Eigen::AngleAxisd(q[hinge.joint], hinge.axis);
  return R * R_end_;
}

// Gauss-Newton on the rotation that is missing; a joint that a limit stops is left out of the step.
void TorsoOrientation::solve(const Eigen::Quaterniond& R_PT, Eigen::VectorXd& q) const {
  if (chain_.empty()) return;
  constexpr int kIterations = 30;
  constexpr double kDone = 1e-12, kDamping = 1e-9;  // [rad]; damping keeps a singular waist's step finite
  const auto size = static_cast<Eigen::Index>(chain_.size());
  Eigen::Matrix3Xd axes(3, size);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
    for (Eigen::Index i = 0; i < size; ++i) {
      const Hinge& hinge = chain_[static_cast<std::size_t>(i)];
      R = R * hinge.R_before;
      axes.col(i) = R * hinge.axis;
      R = R * Eigen::AngleAxisd(q[hinge.joint], hinge.axis);
    }
    const Eigen::Vector3d missing = rotation_vector(R_PT * (R * R_end_).conjugate());
    for (Eigen::Index i = 0; i < size; ++i) {
      const Hinge& hinge = chain_[static_cast<std::size_t>(i)];
      const double wish = axes.col(i).dot(missing), angle = q[hinge.joint];
      const bool stopped = (angle <= hinge.lower && wish < 0.0) || (angle >= hinge.upper && wish > 0.0);
      if (!hinge.waist || stopped) axes.col(i).setZero();
    }
    Eigen::MatrixXd normal = axes.transpose() * axes;
    normal.diagonal().array() += kDamping;
    const Eigen::VectorXd step = normal.ldlt().solve(axes.transpose() * missing);
    double moved = 0.0;
    for (Eigen::Index i = 0; i < size; ++i) {
      const Hinge& hinge = chain_[static_cast<std::size_t>(i)];
      if (!hinge.waist) continue;
      const double before =
          std::exchange(q[hinge.joint], std::clamp(q[hinge.joint] + step[i], hinge.lower, hinge.upper));
      moved = std::max(moved, std::abs(q[hinge.joint] - before));
    }
    if (moved < kDone) return;
  }
}

}  // namespace duet
