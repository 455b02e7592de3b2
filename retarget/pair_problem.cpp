#include "retarget/pair_problem.h"

#include <fmt/format.h>

#include "core/require.h"
#include "core/skeleton.h"
#include "retarget/reshape.h"

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

}  // namespace

int human_offset_of(int smpl) {
  if (smpl >= kLeftShoulder && smpl <= kRightWrist) return smpl - kLeftShoulder;
  if (smpl == kLeftHand || smpl == kRightHand) return smpl - kLeftHand + 4;
  return -1;
}

PairProblem make_pair_problem(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options) {
  const HumanMotion& source = clip.reactor_motion();
  const HumanMotion& partner = clip.actor_motion();
  require(source.frames() >= kMinFrames,
          fmt::format("clip '{}': retargeting needs at least {} frames at 50 Hz, found {}", clip.id, kMinFrames,
                      source.frames()));
  PairProblem problem;
  problem.chain = make_chain(robot, options.keypoints);
  const PairTree tree = make_pair_tree(robot);
  problem.targets = reshape(source, tree, target_lengths(problem.chain, tree, options),
                            height_scale(robot, problem.chain, tree, source));
  problem.yaw.resize(source.frames());
  problem.root.resize(3, source.frames());
  for (int t = 0; t < source.frames(); ++t) {
    problem.yaw[t] = heading(source.joints, t);
    problem.root.col(t) = problem.targets.at(t, 0);
  }
  problem.human = partner.joints.select(problem.chain.key_smpl);
  for (const int smpl : problem.chain.key_smpl) problem.human_offset.push_back(human_offset_of(smpl));
  problem.distances = original_distances(source.joints.select(problem.chain.key_smpl), problem.human);
  return problem;
}

}  // namespace duet
