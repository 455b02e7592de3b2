#include "duet/retarget/pair_problem.h"

#include <algorithm>

#include "duet/core/require.h"
#include "duet/core/skeleton.h"
#include "duet/retarget/reshape.h"
#include "duet/retarget/upright_chain.h"
#include "duet/robots/roles.h"

namespace duet {

namespace {

constexpr int kMinFrames = 5;  // the shortest sequence with an acceleration term that does not touch both ends

std::array<double, kRetargetPairs> target_lengths(const PairChain& chain, const PairTree& tree,
                                                  const PairOptions& options) {
  const PairBones bones = robot_bones(chain, tree);
  if (options.smpl_path.empty()) return bones.length;
  return fit_shape(load_shape_basis(options.smpl_path), tree, bones).length;
}

// Distances between the keypoints of the two original persons.
Eigen::MatrixXd original_distances(const PointTracks& source, const PointTracks& partner) {
  const int keys = source.points();
  const int points = 2 * keys;
  Eigen::MatrixXd distances(points * (points - 1) / 2, source.frames());
  Eigen::Matrix3Xd x(3, points);
  for (int t = 0; t < source.frames(); ++t) {
    x << source.frame(t), partner.frame(t);
    Eigen::Index row = 0;
    for (int i = 0; i < points; ++i) {
      for (int j = i + 1; j < points; ++j) distances(row++, t) = (x.col(i) - x.col(j)).norm();
    }
  }
  return distances;
}

// Smooth from 1 at half of `range` to 0 at it.
double nearness_of(double distance, double range) {
  const double s = std::clamp(2.0 * (1.0 - distance / range), 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

constexpr double kTrunkRange = 0.5;  // of the range: two who stand before one another to bow are farther apart

bool is_of_an_arm(int smpl) { return smpl >= kLeftElbow && smpl <= kRightHand; }

// Distances between arms count up to `range`, those of heads, shoulders and hips to half of it.
Eigen::MatrixXd find_nearness(const Eigen::MatrixXd& distances, const std::vector<int>& smpl, double range) {
  const int keys = static_cast<int>(smpl.size());
  Eigen::MatrixXd nearness(Eigen::Index{keys} * keys, distances.cols());
  Eigen::Index row = 0;
  for (int i = 0; i < keys; ++i) {
    row += keys - 1 - i;  // the robot's own
    for (int j = 0; j < keys; ++j, ++row) {
      const double own = (is_of_an_arm(smpl[i]) && is_of_an_arm(smpl[j]) ? 1.0 : kTrunkRange) * range;
      for (Eigen::Index t = 0; t < distances.cols(); ++t)
        nearness(Eigen::Index{i} * keys + j, t) = nearness_of(distances(row, t), own);
    }
  }
  return nearness;
}

Eigen::VectorXd rest_of(const RobotModel& robot, const PairProblem& problem, RestPose pose) {
  Eigen::VectorXd rest = Eigen::VectorXd::Zero(problem.chain.dof());
  if (pose == RestPose::kZero) return rest;
  for (int j = 0; j < problem.chain.dof(); ++j) {
    const int joint = problem.upright ? problem.robot_joint[j] : j;
    if (joint >= 0) rest[j] = robot.neutral[joint];
  }
  return rest;
}

// The robot stands: its base and soles are planned, the rest is a chain above the base, and the reshaped person hangs
// on the planned base.
void weigh_hands(double weight, PairChain& chain) {
  for (int k = 0; k < chain.keys(); ++k)
    if (chain.key_smpl[k] == kLeftHand || chain.key_smpl[k] == kRightHand) chain.key_weight[k] = weight;
}

void stand_on_ground(const RobotModel& robot, const HumanMotion& source, const HumanMotion& partner,
                     const PairTree& tree, const PairOptions& options, PairProblem& problem) {
  UprightChain upright = make_upright_chain(robot, problem.chain);
  if (options.weights.collision > 0.0) problem.spheres = make_body_spheres(robot, upright, partner);
  problem.chain = upright.chain;
  problem.robot_joint = upright.robot_joint;
  problem.upright = true;
  problem.reshaped = problem.targets;
  problem.plan = plan_ground(robot, LegPose(robot), source, tree, problem.targets,
                             {.smoothing = options.root_smoothing, .step_speed = options.step_speed});
  problem.yaw = problem.plan.yaw;
  problem.root = problem.plan.base;
  const Eigen::Vector3d p_BPelvis = pelvis_in_base(robot, robot.neutral).p;
  for (int t = 0; t < problem.frames(); ++t) {
    const Eigen::Vector3d pelvis = problem.root.col(t) + yaw_rotation(problem.yaw[t]) * p_BPelvis;
    problem.targets.frame(t).colwise() += Eigen::Vector3d(pelvis - problem.targets.at(t, 0));
  }
}

}  // namespace

PairProblem make_pair_problem(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options) {
  const HumanMotion& source = clip.reactor_motion();
  const HumanMotion& partner = clip.actor_motion();
  require(source.frames() >= kMinFrames, "clip '{}': retargeting needs at least {} frames at 50 Hz, found {}", clip.id,
          kMinFrames, source.frames());
  PairProblem problem;
  problem.chain = make_chain(robot, options.keypoints, options.keypoint_list);
  if (options.keypoint_list.empty()) weigh_hands(options.weights.hand, problem.chain);
  const PairTree tree = make_pair_tree(robot);
  problem.targets = reshape(source, tree, target_lengths(problem.chain, tree, options),
                            height_scale(robot, problem.chain, tree, source));
  problem.yaw.resize(source.frames());
  problem.root.resize(3, source.frames());
  const Eigen::Vector3d p_BPelvis = pelvis_in_base(robot, robot.neutral).p;
  for (int t = 0; t < source.frames(); ++t) {
    problem.yaw[t] = heading(source.joints, t);
    problem.root.col(t) = problem.targets.at(t, 0);
    if (!base_is_pelvis(robot)) problem.root.col(t) -= yaw_rotation(problem.yaw[t]) * p_BPelvis;
  }
  if (options.ground) stand_on_ground(robot, source, partner, tree, options, problem);
  problem.human = partner.joints.select(problem.chain.key_smpl);
  for (const int smpl : problem.chain.key_smpl) problem.human_offset.push_back(human_offset_of(smpl));
  problem.distances = original_distances(source.joints.select(problem.chain.key_smpl), problem.human);
  problem.rest = rest_of(robot, problem, options.rest_pose);
  if (options.contact_range > 0.0)
    problem.nearness = find_nearness(problem.distances, problem.chain.key_smpl, options.contact_range);
  if (options.weights.object > 0.0)
    problem.object = make_object_keypoints(clip.object, source.joints.select(problem.chain.key_smpl), problem.human);
  if (options.weights.bone > 0.0) problem.bones = arm_bones(partner);
  return problem;
}

}  // namespace duet
