// The robot as PAIR's solvers see it: a tree of hinges whose axes are coordinate axes, and the points of it that enter
// the objective. Built once per robot; immutable. It has forward kinematics of its own beside robots/kinematics.h: that
// one turns about any axis in double precision, here a hinge costs one sine and cosine and no product of full
// rotations, and the same tree is what the SIMD kernels lay out in lanes of floats. A test holds the two against each
// other.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/retarget/options.h"
#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr int kRetargetPairs = 16;  // supplement A.1.1

// Joint j moves link j + 1; link 0 is the base.
struct ChainJoint {
  int parent = 0;                                          // link
  int axis = 2;                                            // of the link's own frame: 0 x, 1 y, 2 z
  bool turned = false;                                     // `rotation` is not the identity
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();        // of the link in its parent [m]
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // of the link in its parent at q = 0
  double lower = 0.0, upper = 0.0;                         // [rad]
};

struct ChainPoint {
  int link = 0;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  // in the link [m]
};

struct PairChain {
  std::vector<ChainJoint> joints;
  std::vector<ChainPoint> points;
  std::vector<int> pair_points;    // index in points per retarget pair, 16
  std::vector<int> key_points;     // index in points per interaction keypoint, K
  std::vector<int> key_smpl;       // the SMPL-24 joint of each keypoint, K
  std::vector<double> key_weight;  // of its distances from other keypoints, K
  std::vector<double> key_object;  // of its distances from a carried object's, K

  [[nodiscard]] int dof() const { return static_cast<int>(joints.size()); }
  [[nodiscard]] int keys() const { return static_cast<int>(key_points.size()); }
  [[nodiscard]] bool weighted() const;  // a key_weight is not 1
};

struct ChainPose {
  std::vector<Eigen::Matrix3d> R_WL;
  std::vector<Eigen::Vector3d> p_WL;
  Eigen::Matrix3Xd points;  // (3, points) [m], W
};

// Throws std::invalid_argument: a robot without the 16 pairs (the pelvis first), without keypoints, without hands or
// hips where `keypoints` asks for them, or with indices out of range; what robot_frames refuses of `list`, which stands
// in the place of `keypoints` where it is not empty.
PairChain make_chain(const RobotModel& robot, ContactKeypoints keypoints,
                     const std::vector<ContactKeypoint>& list = {});

// Poses of all links and points. `pose` is resized where it must be.
void forward(const PairChain& chain, const Eigen::Matrix3d& R_WB, const Eigen::Vector3d& p_WB,
             const Eigen::Ref<const Eigen::VectorXd>& q, ChainPose& pose);

// The robot above its legs, for PAIR on the ground: the base has a place and a heading, a hinge tilts it forward, it
// never leans sideways, and the legs are solved afterwards from where the soles stand (retarget/ground_plan.h). It is
// an ordinary PairChain, so that every solver takes it.

// Joint 0 is the tilt about y, within the card's root bounds; the others are the robot's without its legs. Pairs whose
// frame moves with the legs have point -1. Spheres of arms, trunk and head follow as points after the keypoints'.
// Throws std::invalid_argument for a robot whose card names no legs or no soles, and as make_chain does.
struct UprightChain {
  PairChain chain;
  std::vector<int> robot_joint;  // of each joint of the chain: of the robot; -1 for the tilt
};
UprightChain make_upright_chain(const RobotModel& robot, const PairChain& whole);

}  // namespace duet
