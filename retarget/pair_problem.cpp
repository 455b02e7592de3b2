#include "duet/retarget/pair_problem.h"

#include <fmt/format.h>

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
  require(source.frames() >= kMinFrames,
          fmt::format("clip '{}': retargeting needs at least {} frames at 50 Hz, found {}", clip.id, kMinFrames,
                      source.frames()));
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
  if (options.weights.object > 0.0)
    problem.object = make_object_keypoints(clip.object, source.joints.select(problem.chain.key_smpl), problem.human);
  if (options.weights.bone > 0.0) problem.bones = arm_bones(partner);
  return problem;
}

}  // namespace duet
