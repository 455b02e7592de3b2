#include "duet/retarget/solver/pair.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <limits>

#include "duet/core/machine.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/retarget/pair_problem.h"
#include "duet/retarget/solver/pair_solver.h"

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

namespace {

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <typename Action>
double least_seconds(int rounds, const Action& action) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < rounds; ++i) {
    const double begin = thread_seconds();
    action();
    least = std::min(least, thread_seconds() - begin);
  }
  return least;
}

}  // namespace

PairTiming time_pair(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options, int rounds) {
  require(rounds > 0, "time_pair: expected at least one round");
  InteractionClip resampled = clip;
  resampled.a = resample(clip.a, 50.0);
  resampled.b = resample(clip.b, 50.0);
  const PairProblem problem = make_pair_problem(resampled, robot, options);
  PairTiming timing;
  timing.frames = problem.frames();
  timing.kernel = choose_kernel(problem, options);
  timing.solver = timing.frames / least_seconds(rounds, [&] { static_cast<void>(solve_pair(problem, options)); });
  timing.whole = timing.frames / least_seconds(rounds, [&] { static_cast<void>(retarget(clip, robot, options)); });
  return timing;
}

Eigen::MatrixXd gaussian_filter(const Eigen::MatrixXd& x) {
  constexpr int kRadius = 2;
  constexpr double kSigma = 0.75;
  std::array<double, 2 * kRadius + 1> weight{};
  double sum = 0.0;
  for (int k = -kRadius; k <= kRadius; ++k) sum += weight[k + kRadius] = std::exp(-0.5 * k * k / (kSigma * kSigma));
  for (double& w : weight) w /= sum;

  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(x.rows(), x.cols());
  for (Eigen::Index t = 0; t < x.cols(); ++t) {
    for (int k = -kRadius; k <= kRadius; ++k) {
      out.col(t) += weight[k + kRadius] * x.col(std::clamp<Eigen::Index>(t + k, 0, x.cols() - 1));
    }
  }
  return out;
}

namespace {

constexpr double kShareOfLimit = 0.99;  // so that a file's rounding does not lift a speed over its limit

// The highest sequence that is nowhere above `q` and rises or falls by at most `step` a frame.
Eigen::RowVectorXd below(Eigen::RowVectorXd q, double step) {
  for (Eigen::Index t = 1; t < q.size(); ++t) q[t] = std::min(q[t], q[t - 1] + step);
  for (Eigen::Index t = q.size() - 1; t > 0; --t) q[t - 1] = std::min(q[t - 1], q[t] + step);
  return q;
}

}  // namespace

void keep_joint_speeds(const RobotModel& robot, RobotMotion& motion) {
  require(motion.q.rows() == robot.dof(), "joint speeds: expected a motion of this robot");
  for (int j = 0; j < robot.dof(); ++j) {
    const double step = kShareOfLimit * robot.joints[static_cast<std::size_t>(j)].velocity / motion.rate_hz;
    const Eigen::RowVectorXd q = motion.q.row(j);
    if (step <= 0.0 || q.size() < 2) continue;
    if ((q.tail(q.size() - 1) - q.head(q.size() - 1)).cwiseAbs().maxCoeff() <= step) continue;
    motion.q.row(j) = 0.5 * (below(q, step) - below(-q, step));
  }
}

PairedMotion prepare_for_real(PairedMotion motion, const RobotModel& robot, double mild_yaw) {
  constexpr const char* kSetting = "prepared";
  validate(motion);
  require(!motion.settings.contains(kSetting), "paired motion of clip '{}': is prepared already ({})", motion.clip_id,
          motion.settings.contains(kSetting) ? motion.settings.at(kSetting) : "");
  sim_to_real(motion.robot, motion.phases, robot, mild_yaw);
  motion.settings[kSetting] = "sim_to_real";
  motion.settings["mild_yaw"] = fmt::format("{:g}", mild_yaw);
  return motion;
}

}  // namespace duet
