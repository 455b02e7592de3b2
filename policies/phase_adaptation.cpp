#include "policies/phase_adaptation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/clock.h"
#include "core/random.h"
#include "core/require.h"
#include "policies/torso_orientation.h"

namespace duet {
namespace {

constexpr int kRamp = 16;  // frames of Algorithm 7

void check_joints(const RobotMotion& motion, const RobotModel& robot) {
  require(static_cast<int>(motion.joint_names.size()) == robot.dof(),
          fmt::format("phase adaptation: expected the {} joints of robot '{}', found {}", robot.dof(), robot.name,
                      motion.joint_names.size()));
  for (int j = 0; j < robot.dof(); ++j) {
    const auto k = static_cast<std::size_t>(j);
    require(motion.joint_names[k] == robot.joints[k].name,
            fmt::format("phase adaptation: expected joint {} to be '{}', found '{}'", j, robot.joints[k].name,
                        motion.joint_names[k]));
  }
}

void check(const RobotMotion& motion, const Phases& phases, const RobotModel& robot, const AdaptationOptions& options) {
  validate(motion, "phase adaptation");
  require(motion.rate_hz == kTickRate,
          fmt::format("phase adaptation: expected a motion at {} Hz, found {} Hz", kTickRate, motion.rate_hz));
  check_joints(motion, robot);
  require(0 <= phases.act_begin && phases.act_begin < phases.act_end && phases.act_end <= motion.frames(),
          fmt::format("phase adaptation: expected an act inside [0, {}), found [{}, {})", motion.frames(),
                      phases.act_begin, phases.act_end));
  const auto check_option = [](const char* name, double value) {
    require(std::isfinite(value) && value >= 0.0,
            fmt::format("phase adaptation: expected {} >= 0, found {}", name, value));
  };
  check_option("start_radius", options.start_radius);
  check_option("lead", options.lead);
  check_option("return_time", options.return_time);
  check_option("mild_yaw", options.mild_yaw);
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

// The primitives of A.4.4 on one motion. Frames and phases are those of that motion.
class Adaptation {
 public:
  Adaptation(RobotMotion motion, const Phases& phases, const RobotModel& robot)
      : motion_(std::move(motion)), phases_(phases), robot_(robot) {
    for (int j = 0; j < robot.dof(); ++j)
      (is_leg_joint(robot.joints[static_cast<std::size_t>(j)].name) ? legs_ : upper_).push_back(j);
  }

  [[nodiscard]] AdaptedMotion result(int clip_frame) && { return {std::move(motion_), phases_, clip_frame}; }

  // Preparation: from `start` straight to the first act frame.
  void approach(const Pose& start) {
    const Pose goal = root(phases_.act_begin);
    for (int t = 0; t < phases_.act_begin; ++t)
      root(t) = interpolate(start, goal, static_cast<double>(t) / phases_.act_begin);
  }

  // Preparation: the upper body from neutral to the first act frame over the last `ticks`, at most all of it.
  void raise_upper_body(int ticks) {
    const Eigen::VectorXd goal = motion_.q.col(phases_.act_begin);
    const int begin = std::max(0, phases_.act_begin - ticks);
    for (int t = 0; t < phases_.act_begin; ++t) {
      const double s = t < begin ? 0.0 : static_cast<double>(t - begin) / (phases_.act_begin - begin);
      for (const int j : upper_) motion_.q(j, t) = (1.0 - s) * robot_.neutral[j] + s * goal[j];
    }
  }

  // Follow-up: the upper body back to neutral over `ticks`.
  void lower_upper_body(double ticks) {
    const Eigen::VectorXd last = motion_.q.col(phases_.act_end - 1);
    for (int t = phases_.act_end; t < motion_.frames(); ++t) {
      const double s = ticks > 0.0 ? std::min(1.0, (t - phases_.act_end + 1) / ticks) : 1.0;
      for (const int j : upper_) motion_.q(j, t) = (1.0 - s) * last[j] + s * robot_.neutral[j];
    }
  }

  // Frames [begin, end): root and legs as in frame `source`.
  void freeze(int begin, int end, int source) {
    for (int t = begin; t < end; ++t) {
      root(t) = Pose(root(source));
      for (const int j : legs_) motion_.q(j, t) = motion_.q(j, source);
    }
  }

  // All frames: upright on standing legs at the act position.
  void stand() {
    const Pose stance = stance_at_act();
    for (int t = 0; t < motion_.frames(); ++t) {
      root(t) = stance;
      for (const int j : legs_) motion_.q(j, t) = robot_.neutral[j];
    }
  }

  // Act: turns the waist so that the torso above the pelvis of stand() is oriented as it is now. Comes before stand().
  void keep_torso() {
    const TorsoOrientation torso(robot_);
    const Pose stance = stance_at_act();
    for (int t = phases_.act_begin; t < phases_.act_end; ++t) {
      Eigen::VectorXd q = motion_.q.col(t);
      torso.solve(stance.R.conjugate() * root(t).R * torso.at(q), q);
      motion_.q.col(t) = q;
    }
  }

 private:
  Pose& root(int t) { return motion_.root[static_cast<std::size_t>(t)]; }
  // Where the robot is in the middle of the act: a person may still be walking in its first frames.
  Pose stance_at_act() { return robot_.standing_state(root((phases_.act_begin + phases_.act_end) / 2)).X_WB; }

  RobotMotion motion_;
  Phases phases_;
  const RobotModel& robot_;
  std::vector<int> legs_, upper_;
};

AdaptedMotion adapt_approach(const RobotMotion& motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options, std::uint64_t seed) {
  Adaptation adaptation(motion, phases, robot);
  adaptation.approach(displaced(motion.root.front(), options.start_radius, seed));
  adaptation.raise_upper_body(phases.act_begin);
  adaptation.lower_upper_body(options.return_time * kTickRate);
  adaptation.freeze(phases.act_end, motion.frames(), phases.act_end - 1);
  return std::move(adaptation).result(0);
}

// `start` turned about the vertical until its heading is at most `mild_yaw` from that of `goal`.
Pose mildly_turned(const Pose& start, const Pose& goal, double mild_yaw) {
  const double turn = std::remainder(yaw_of(start.R) - yaw_of(goal.R), 2.0 * std::numbers::pi);
  const double back = std::clamp(turn, -mild_yaw, mild_yaw) - turn;
  return {(yaw_rotation(back) * start.R).normalized(), start.p};
}

AdaptedMotion adapt_for_real(const RobotMotion& motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options) {
  Adaptation adaptation(motion, phases, robot);
  adaptation.approach(mildly_turned(motion.root.front(), motion.root[phases.act_begin], options.mild_yaw));
  adaptation.raise_upper_body(kRamp);
  adaptation.lower_upper_body(kRamp);
  adaptation.freeze(phases.act_end, motion.frames(), phases.act_end - 1);
  return std::move(adaptation).result(0);
}

AdaptedMotion adapt_in_place(const RobotMotion& motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options) {
  // A lead longer than the clip is all of it; the bound also keeps the product inside int.
  const double lead = std::min(std::round(options.lead * kTickRate), static_cast<double>(phases.act_begin));
  const int begin = phases.act_begin - static_cast<int>(lead);
  const Phases shifted{phases.act_begin - begin, phases.act_end - begin};
  Adaptation adaptation(cut(motion, begin, motion.frames()), shifted, robot);
  if (options.hold_stance && options.keep_torso) adaptation.keep_torso();
  adaptation.raise_upper_body(shifted.act_begin);
  adaptation.lower_upper_body(options.return_time * kTickRate);
  if (options.hold_stance) {
    adaptation.stand();
  } else {
    adaptation.freeze(0, shifted.act_begin, shifted.act_begin);
    adaptation.freeze(shifted.act_end, motion.frames() - begin, shifted.act_end - 1);
  }
  return std::move(adaptation).result(begin);
}

}  // namespace

bool is_leg_joint(std::string_view name) {
  return name.find("hip") != std::string_view::npos || name.find("knee") != std::string_view::npos ||
         name.find("ankle") != std::string_view::npos;
}

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

}  // namespace duet
