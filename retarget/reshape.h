// Reshaped(H_s): the source person's skeleton with the robot's proportions (supplement A.1.1 and Table S7), at the 16
// pairs. Pure functions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/motion/human_motion.h"
#include "duet/retarget/pair_chain.h"

namespace duet {

// The 16 pairs as a tree: the parent of a pair is the nearest SMPL ancestor that is a pair too. Entry 0 (pelvis) is -1.
// Parents come first in the order of A.1.1 except for the toes, so walk by `order`.
struct PairTree {
  std::array<int, kRetargetPairs> parent{};
  std::array<int, kRetargetPairs> smpl{};
  std::array<int, kRetargetPairs> order{};  // parents before children
};
PairTree make_pair_tree(const RobotModel& robot);

// Directions (unit) and lengths [m] of the bones from each pair to its parent; entry 0 is zero.
struct PairBones {
  std::array<Eigen::Vector3d, kRetargetPairs> direction;
  std::array<double, kRetargetPairs> length{};
};

// The bones of the robot at q = 0.
PairBones robot_bones(const PairChain& chain, const PairTree& tree);

// SMPL joints as functions of shape: J(beta) = J_template + J_shapedirs beta. NPZ keys "J_template" (24, 3) and
// "J_shapedirs" (24, 3, B), B of 1 to 300 of which the first 10 are used.
struct ShapeBasis {
  Eigen::Matrix3Xd joints;             // (3, 24) [m]
  std::vector<Eigen::Matrix3Xd> dirs;  // 10 at most, each (3, 24)
};
ShapeBasis load_shape_basis(const std::string& path);  // throws InputError

struct ShapeFit {
  Eigen::VectorXd beta;
  double scale = 1.0;
  std::array<double, kRetargetPairs> length{};  // s |bone(beta)| [m]
  std::vector<double> loss;                     // [m^2], one per iteration, before its update
};

// Fits beta and s of A.1.1 with Adam. The bones of the basis are first turned along the robot's (its arms hang, SMPL's
// stand out), so that shapes are compared and not poses.
ShapeFit fit_shape(const ShapeBasis& basis, const PairTree& tree, const PairBones& robot, int iterations = 500,
                   double rate = 0.1);

// The sum of squares of A.1.1 at (beta, s) and its gradient (beta first, s last).
double shape_loss(const ShapeBasis& basis, const PairTree& tree, const PairBones& robot, const Eigen::VectorXd& beta,
                  double scale, Eigen::VectorXd* gradient);

// (T, 16, 3): bones of the given lengths along the source's bones, hung on the pelvis path whose height alone is
// scaled by `height_scale`. Throws std::invalid_argument where two paired joints of the source coincide.
PointTracks reshape(const HumanMotion& source, const PairTree& tree, const std::array<double, kRetargetPairs>& length,
                    double height_scale);

// Height of the robot's pelvis over its soles with straight legs, divided by that of the person. The ankle's height
// is the least of the motion for the person, that of the neutral pose for the robot.
double height_scale(const RobotModel& robot, const PairChain& chain, const PairTree& tree, const HumanMotion& source);

}  // namespace duet
