// Where the 24 SMPL joints are in a BVH skeleton: CMU's joint names, Xsens's,
// SOMA's, or the common ones (Mixamo, LAFAN1, OptiTrack, Nokov); of other names
// by the parts of the body that they name (motion/layouts/joint_recipes.h:
// Biped, Rokoko, Bandai-Namco, SMPL, Unity, ...), or as the user's own file
// says. The choice of points is written down in docs/conventions.md.
// Thread-safe.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/robot_state.h"
#include "duet/people/bvh/bvh.h"

namespace duet {

// A point on the way from one joint of the file to another, and the joint whose rotation it has.
struct BvhPoint {
  int from = 0;
  int toward = 0;
  double part = 0.0;  // 0 = at `from`, 1 = at `toward`; beyond it above 1
  int rotation = 0;
};

struct BvhSkeleton {
  std::string naming;  // "common", "CMU", "Xsens", "SOMA", "by parts of the
                       // body", "as told"
  std::array<BvhPoint, kSmplJoints> points;
  // Left, right: the file has no toe, its point lies at the ankle and put_toe()
  // makes one of it in the world.
  std::array<bool, 2> lacks_toe = {false, false};
  std::vector<std::string> notes = {};  // what was made, one sentence each
};

// `names`: the user's file of names (motion/layouts/joint_recipes.h), "" for known
// namings. Throws InputError naming the file, the joint that is missing, the
// SMPL joint that it is for, and the nearest name.
BvhSkeleton find_smpl_joints(const Bvh& bvh, const std::string& names = "");

using SmplPositions = Eigen::Matrix<double, 3, kSmplJoints>;

// Positions of the SMPL joints from the poses of the file's joints (bvh.h), in the file's axes and units.
SmplPositions smpl_positions(const BvhSkeleton& skeleton, const std::vector<Pose>& global);

// Length of the bones from head through pelvis, hip and knee to the ankle, mean of both sides, in file units.
double stature(const SmplPositions& positions);

// Two people in one BVH file: two ROOTs, or two branches of one hierarchy
// ("character_A_left_hip"). Thread-safe.

// Person A and person B in the order of the file, each a Bvh of its own with
// the joints above it. `names` as find_smpl_joints() takes it. Throws
// InputError naming the file where it does not hold two people.
std::array<Bvh, 2> two_people_in(const Bvh& bvh, const std::string& names = "");

}  // namespace duet
