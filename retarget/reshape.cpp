#include "duet/retarget/reshape.h"

#include <algorithm>
#include <cmath>

#include "duet/archives/npy/npz.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {

namespace {

constexpr int kShapes = 10;

int pair_of(const PairTree& tree, int smpl) {
  const auto* const found = std::find(tree.smpl.begin(), tree.smpl.end(), smpl);
  return found == tree.smpl.end() ? -1 : static_cast<int>(found - tree.smpl.begin());
}

// From the pelvis to a joint of the shaped, unposed body.
Eigen::Vector3d shaped_bone(const ShapeBasis& basis, const Eigen::VectorXd& beta, int joint, int parent) {
  Eigen::Vector3d bone = basis.joints.col(joint) - basis.joints.col(parent);
  for (Eigen::Index b = 0; b < beta.size(); ++b)
    bone += beta[b] * (basis.dirs[b].col(joint) - basis.dirs[b].col(parent));
  return bone;
}

// Height of a straight-legged skeleton from the mid hip and the left leg's bones.
double leg_height(const Eigen::Vector3d& pelvis, const Eigen::Vector3d& left_hip, const Eigen::Vector3d& right_hip,
                  double thigh, double shin) {
  return (0.5 * (left_hip + right_hip) - pelvis).norm() + thigh + shin;
}

}  // namespace

PairTree make_pair_tree(const RobotModel& robot) {
  PairTree tree;
  for (int i = 0; i < kRetargetPairs; ++i) tree.smpl[i] = robot.pairs[i].smpl;
  for (int i = 0; i < kRetargetPairs; ++i) {
    int ancestor = kSmplParents[tree.smpl[i]];
    while (ancestor >= 0 && pair_of(tree, ancestor) < 0) ancestor = kSmplParents[ancestor];
    tree.parent[i] = ancestor < 0 ? -1 : pair_of(tree, ancestor);
    tree.order[i] = i;
  }
  // SMPL numbers its joints parents first.
  std::sort(tree.order.begin(), tree.order.end(), [&](int a, int b) { return tree.smpl[a] < tree.smpl[b]; });
  return tree;
}

PairBones robot_bones(const PairChain& chain, const PairTree& tree) {
  ChainPose pose;
  forward(chain, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), Eigen::VectorXd::Zero(chain.dof()), pose);
  PairBones bones;
  bones.direction.fill(Eigen::Vector3d::Zero());
  for (int i = 0; i < kRetargetPairs; ++i) {
    if (tree.parent[i] < 0) continue;
    const Eigen::Vector3d bone =
        pose.points.col(chain.pair_points[i]) - pose.points.col(chain.pair_points[tree.parent[i]]);
    bones.length[i] = bone.norm();
    require(bones.length[i] > 1e-6, "retarget pairs {} and {} of the robot coincide", i, tree.parent[i]);
    bones.direction[i] = bone / bones.length[i];
  }
  return bones;
}

ShapeBasis load_shape_basis(const std::string& path) {
  const Npz archive = Npz::load(path);
  const std::vector<double> rest = archive.numbers("J_template", {kSmplJoints, 3});
  const std::vector<double> dirs = archive.numbers("J_shapedirs", {kSmplJoints, 3, -1});
  const std::size_t shapes = dirs.size() / (3 * kSmplJoints);
  if (shapes < 1) throw InputError(path + ": key 'J_shapedirs': expected (24, 3, 10), found no shapes");
  ShapeBasis basis;
  basis.joints = Eigen::Map<const Eigen::Matrix3Xd>(rest.data(), 3, kSmplJoints);
  basis.dirs.assign(std::min<std::size_t>(shapes, kShapes), Eigen::Matrix3Xd::Zero(3, kSmplJoints));
  for (int j = 0; j < kSmplJoints; ++j) {
    for (int c = 0; c < 3; ++c) {
      for (std::size_t b = 0; b < basis.dirs.size(); ++b) basis.dirs[b](c, j) = dirs[(3 * j + c) * shapes + b];
    }
  }
  return basis;
}

double shape_loss(const ShapeBasis& basis, const PairTree& tree, const PairBones& robot, const Eigen::VectorXd& beta,
                  double scale, Eigen::VectorXd* gradient) {
  const Eigen::Index shapes = beta.size();
  // Position of each pair less the robot's, and its Jacobian by (beta, s), accumulated along the tree.
  std::array<Eigen::Vector3d, kRetargetPairs> error;
  std::array<Eigen::Matrix3Xd, kRetargetPairs> jacobian;
  double loss = 0.0;
  if (gradient != nullptr) gradient->setZero(shapes + 1);
  for (const int i : tree.order) {
    const int parent = tree.parent[i];
    error[i].setZero();
    jacobian[i] = Eigen::Matrix3Xd::Zero(3, shapes + 1);
    if (parent < 0) continue;
    const Eigen::Vector3d bone = shaped_bone(basis, beta, tree.smpl[i], tree.smpl[parent]);
    const double length = bone.norm();
    error[i] = error[parent] + (scale * length - robot.length[i]) * robot.direction[i];
    loss += error[i].squaredNorm();
    if (gradient == nullptr) continue;
    jacobian[i] = jacobian[parent];
    for (Eigen::Index b = 0; b < shapes; ++b) {
      const Eigen::Vector3d change = basis.dirs[b].col(tree.smpl[i]) - basis.dirs[b].col(tree.smpl[parent]);
      jacobian[i].col(b) += scale * bone.dot(change) / length * robot.direction[i];
    }
    jacobian[i].col(shapes) += length * robot.direction[i];
    *gradient += 2.0 * jacobian[i].transpose() * error[i];
  }
  return loss;
}

ShapeFit fit_shape(const ShapeBasis& basis, const PairTree& tree, const PairBones& robot, int iterations, double rate) {
  const auto shapes = static_cast<Eigen::Index>(basis.dirs.size());
  Eigen::VectorXd x = Eigen::VectorXd::Zero(shapes + 1);
  x[shapes] = 1.0;
  Eigen::VectorXd gradient;
  Eigen::ArrayXd mean = Eigen::ArrayXd::Zero(x.size());
  Eigen::ArrayXd square = Eigen::ArrayXd::Zero(x.size());
  ShapeFit fit;
  for (int k = 1; k <= iterations; ++k) {
    fit.loss.push_back(shape_loss(basis, tree, robot, x.head(shapes), x[shapes], &gradient));
    mean = 0.9 * mean + 0.1 * gradient.array();
    square = 0.999 * square + 0.001 * gradient.array().square();
    const Eigen::ArrayXd root = (square / (1.0 - std::pow(0.999, k))).sqrt();
    x.array() -= rate / (1.0 - std::pow(0.9, k)) * mean / (root + 1e-8);
  }
  fit.beta = x.head(shapes);
  fit.scale = x[shapes];
  for (int i = 0; i < kRetargetPairs; ++i) {
    if (tree.parent[i] < 0) continue;
    fit.length[i] = std::abs(fit.scale) * shaped_bone(basis, fit.beta, tree.smpl[i], tree.smpl[tree.parent[i]]).norm();
  }
  return fit;
}

PointTracks reshape(const HumanMotion& source, const PairTree& tree, const std::array<double, kRetargetPairs>& length,
                    double height_scale) {
  PointTracks out(source.frames(), kRetargetPairs);
  for (int t = 0; t < source.frames(); ++t) {
    for (const int i : tree.order) {
      const int parent = tree.parent[i];
      const Eigen::Vector3d joint = source.joints.at(t, tree.smpl[i]);
      if (parent < 0) {
        out.at(t, i) = Eigen::Vector3d(joint.x(), joint.y(), height_scale * joint.z());
        continue;
      }
      const Eigen::Vector3d bone = joint - source.joints.at(t, tree.smpl[parent]);
      const double norm = bone.norm();
      require(norm > 1e-6, "source person: joints '{}' and '{}' coincide in frame {}", kSmplNames[tree.smpl[i]],
              kSmplNames[tree.smpl[parent]], t);
      out.at(t, i) = out.at(t, parent) + length[i] / norm * bone;
    }
  }
  return out;
}

double height_scale(const RobotModel& robot, const PairChain& chain, const PairTree& tree, const HumanMotion& source) {
  const auto joint = [&](int t, int smpl) { return Eigen::Vector3d(source.joints.at(t, smpl)); };
  const double human_leg = leg_height(joint(0, kPelvis), joint(0, kLeftHip), joint(0, kRightHip),
                                      (joint(0, kLeftKnee) - joint(0, kLeftHip)).norm(),
                                      (joint(0, kLeftAnkle) - joint(0, kLeftKnee)).norm());
  double human_ankle = joint(0, kLeftAnkle).z();
  for (int t = 0; t < source.frames(); ++t) {
    human_ankle = std::min({human_ankle, joint(t, kLeftAnkle).z(), joint(t, kRightAnkle).z()});
  }
  const PairBones bones = robot_bones(chain, tree);
  const auto pair = [&](int smpl) { return pair_of(tree, smpl); };
  for (const int smpl : {kLeftHip, kRightHip, kLeftKnee, kLeftAnkle}) {
    require(pair(smpl) >= 0, "robot '{}': no retarget pair for '{}'", robot.name, kSmplNames[smpl]);
  }
  const auto hip = [&](int smpl) { return Eigen::Vector3d(bones.length[pair(smpl)] * bones.direction[pair(smpl)]); };
  const double robot_leg = leg_height(Eigen::Vector3d::Zero(), hip(kLeftHip), hip(kRightHip),
                                      bones.length[pair(kLeftKnee)], bones.length[pair(kLeftAnkle)]);
  require(robot.neutral.size() == chain.dof(), "robot '{}': expected a neutral pose of {} joints, found {}", robot.name,
          chain.dof(), robot.neutral.size());
  ChainPose pose;
  forward(chain, Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, robot.standing_height), robot.neutral, pose);
  const double robot_ankle = pose.points(2, chain.pair_points[pair(kLeftAnkle)]);
  // A person captured in mid air or below the floor must not change the scale by more than an ankle.
  return (robot_leg + std::clamp(robot_ankle, 0.0, 0.3)) / (human_leg + std::clamp(human_ankle, 0.0, 0.3));
}

}  // namespace duet
