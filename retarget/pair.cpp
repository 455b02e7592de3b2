#include "duet/retarget/pair.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "duet/core/clock.h"
#include "duet/core/memory_left.h"
#include "duet/core/skeleton.h"
#include "duet/retarget/gaussian_filter.h"
#include "duet/retarget/joint_speeds.h"
#include "duet/retarget/pair_problem.h"
#include "duet/retarget/pair_solver.h"

namespace duet {

namespace {

int scaled_frame(int frame, double ratio, int frames) {
  return std::clamp(static_cast<int>(std::lround(frame * ratio)), 0, frames);
}

// All frames are solved for at once, and what the solver keeps of them grows with them.
constexpr double kBytesOfFrame = 24.0e3;  // measured with clips of 1 and 4 minutes

void require_memory_for(const InteractionClip& clip) {
  const double frames = clip.frames() * kTickRate / clip.rate_hz();
  require_memory(fmt::format("clip '{}': {:.0f} frames at {} Hz ({:.0f} minutes, which are retargeted at once)",
                             clip.id, frames, kTickRate, frames / kTickRate / 60.0),
                 frames * kBytesOfFrame);
}

// Phases and contact windows keep their instants.
InteractionClip at_50_hz(const InteractionClip& clip) {
  if (clip.rate_hz() == kTickRate) return clip;
  InteractionClip out = clip;
  out.a = resample(clip.a, kTickRate);
  out.b = resample(clip.b, kTickRate);
  out.object = resample(clip.object, clip.rate_hz(), kTickRate);
  const double ratio = kTickRate / clip.rate_hz();
  out.phases.act_begin = scaled_frame(clip.phases.act_begin, ratio, out.frames());
  out.phases.act_end = scaled_frame(clip.phases.act_end, ratio, out.frames());
  for (ContactWindow& window : out.contacts) {
    window.begin = scaled_frame(window.begin, ratio, out.frames());
    window.end = scaled_frame(window.end, ratio, out.frames());
  }
  return out;
}

// The planned base, tilted as the chain above it is, and legs that put the soles where they stand.
RobotMotion standing_motion(const RobotModel& robot, const PairProblem& problem, const PairOptions& options,
                            const PairVariables& x) {
  const int dof = problem.chain.dof();
  Eigen::MatrixXd q = x.frames.topRows(dof);
  if (options.filter) q = gaussian_filter(q);
  q.row(0) = smoothed(q.row(0), 0.5 * options.root_smoothing * kTickRate);
  RobotMotion motion;
  motion.rate_hz = kTickRate;
  motion.joint_names = robot.joint_names();
  motion.q.resize(robot.dof(), problem.frames());
  const LegPose legs(robot);
  Eigen::VectorXd pose = robot.neutral;
  for (int t = 0; t < problem.frames(); ++t) {
    for (int j = 1; j < dof; ++j) {
      const RobotJoint& joint = robot.joints[problem.robot_joint[j]];
      pose[problem.robot_joint[j]] = std::clamp(q(j, t), joint.lower, joint.upper);
    }
    const GroundPlan& plan = problem.plan;
    const Pose X_WB{yaw_rotation(problem.yaw[t]) * Eigen::AngleAxisd(q(0, t), Eigen::Vector3d::UnitY()),
                    problem.root.col(t) + x.offset};
    for (int side = 0; side < 2; ++side) {
      const Pose X_WS{yaw_rotation(plan.turn[side][t]), plan.sole[side].col(t) + x.offset};
      legs.solve(side, X_WB, legs.within_reach(side, X_WB, X_WS), pose);
    }
    motion.q.col(t) = pose;
    motion.root.push_back(X_WB);
    Eigen::Quaterniond& R = motion.root.back().R;
    if (t > 0 && R.dot(motion.root[t - 1].R) < 0.0) R.coeffs() = -R.coeffs();
  }
  return motion;
}

RobotMotion robot_motion(const RobotModel& robot, const PairProblem& problem, const PairOptions& options,
                         const PairVariables& x) {
  if (problem.upright) return standing_motion(robot, problem, options, x);
  const int dof = problem.chain.dof();
  RobotMotion motion;
  motion.rate_hz = kTickRate;
  for (const RobotJoint& joint : robot.joints) motion.joint_names.push_back(joint.name);
  motion.q = x.frames.topRows(dof);
  if (options.filter) motion.q = gaussian_filter(motion.q);
  for (int j = 0; j < dof; ++j) {  // a float's limit may lie an ulp outside
    motion.q.row(j) = motion.q.row(j).cwiseMax(problem.chain.joints[j].lower).cwiseMin(problem.chain.joints[j].upper);
  }
  for (int t = 0; t < problem.frames(); ++t) {
    Eigen::Quaterniond R(root_rotation(problem.yaw[t], x.frames.col(t).segment<3>(dof)));
    R.normalize();
    if (t > 0 && R.dot(motion.root.back().R) < 0.0) R.coeffs() = -R.coeffs();
    motion.root.push_back({R, problem.root.col(t) + x.offset + x.frames.col(t).tail<3>()});
  }
  return motion;
}

// Turns the rotation of each joint whose bone moved by the smallest rotation that carries the old bone to the new.
void turn_bones(const HumanMotion& source, HumanMotion& adapted) {
  constexpr std::array<std::array<int, 2>, 6> kBones = {{{kLeftCollar, kLeftShoulder},
                                                         {kRightCollar, kRightShoulder},
                                                         {kLeftShoulder, kLeftElbow},
                                                         {kRightShoulder, kRightElbow},
                                                         {kLeftElbow, kLeftWrist},
                                                         {kRightElbow, kRightWrist}}};
  for (int t = 0; t < source.frames(); ++t) {
    for (const auto& [joint, child] : kBones) {
      const Eigen::Vector3d before = source.joints.at(t, child) - source.joints.at(t, joint);
      const Eigen::Vector3d after = adapted.joints.at(t, child) - adapted.joints.at(t, joint);
      Eigen::Quaterniond& R = adapted.rotations[static_cast<std::size_t>(t) * kSmplJoints + joint];
      R = (Eigen::Quaterniond::FromTwoVectors(before, after) * R).normalized();
    }
  }
}

HumanMotion adapted_partner(const HumanMotion& source, int dof, const PairOptions& options, const PairVariables& x) {
  HumanMotion adapted = source;
  if (!options.adapt_human) return adapted;
  for (int t = 0; t < source.frames(); ++t) {
    for (int joint = 0; joint < kSmplJoints; ++joint) {
      const int offset = human_offset_of(joint);
      if (offset >= 0) adapted.joints.at(t, joint) += x.frames.col(t).segment<3>(dof + 3 + 3L * offset);
    }
  }
  if (options.ground) keep_arm_lengths(source, adapted);
  if (!adapted.rotations.empty()) turn_bones(source, adapted);
  return adapted;
}

std::map<std::string, std::vector<double>> loss_curves(const PairSolution& solution, bool extended, bool object) {
  std::map<std::string, std::vector<double>> curves;
  curves["total"] = solution.total;
  for (const PairTerms& terms : solution.terms) {
    curves["kin"].push_back(terms.kin);
    curves["con"].push_back(terms.con);
    curves["hum"].push_back(terms.hum);
    curves["temp"].push_back(terms.temp);
    curves["pose"].push_back(terms.pose);
    if (object) curves["object"].push_back(terms.object);
    if (!extended) continue;
    curves["bone"].push_back(terms.bone);
    curves["partner"].push_back(terms.partner);
    curves["collision"].push_back(terms.collision);
  }
  return curves;
}

std::map<std::string, std::string> describe(const InteractionClip& clip, const RobotModel& robot,
                                            const PairOptions& options, KernelKind used) {
  std::map<std::string, std::string> settings;
  for (const std::string& name : pair_option_names()) settings[name] = pair_option(options, name);
  settings["kernel-used"] = to_string(used);
  settings["robot"] = robot.name;
  settings["robot-digest"] = robot.digest;
  settings["source-rate-hz"] = fmt::format("{}", clip.rate_hz());
  return settings;
}

}  // namespace

PairedMotion retarget(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options) {
  validate(clip);
  validate(options);
  require_memory_for(clip);
  const InteractionClip resampled = at_50_hz(clip);
  const PairProblem problem = make_pair_problem(resampled, robot, options);
  const PairSolution solution = solve_pair(problem, options);

  PairedMotion out;
  out.clip_id = clip.id;
  out.task = clip.task;
  out.phases = resampled.phases;
  out.reactor = clip.reactor;
  out.robot = robot_motion(robot, problem, options, solution.x);
  if (options.joint_speeds) keep_joint_speeds(robot, out.robot);
  out.source_partner = resampled.actor_motion();
  out.source_reactor = resampled.reactor_motion();
  out.partner = adapted_partner(out.source_partner, problem.chain.dof(), options, solution.x);
  out.reshaped = problem.upright ? problem.reshaped : problem.targets;
  out.loss = loss_curves(solution, options.mode != PairMode::kPaper, problem.object.count() > 0);
  out.object = resampled.object;
  out.settings = describe(clip, robot, options, solution.kernel);
  return out;
}

}  // namespace duet
