// Terms of PAIR's problem beside the robot's chain: spheres that keep apart, the partner's arms, a carried object.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/core/recording.h"
#include "duet/motion/carried_object.h"
#include "duet/motion/human_motion.h"
#include "duet/retarget/pair_chain.h"

namespace duet {

// Spheres along the robot's arms, trunk, head and thighs and along the partner's body, and which of them must not lie
// in each other: what PAIR's penetration term sees of the two bodies.

// Two spheres by index: the robot's first, then the partner's.
struct SpherePair {
  int a = 0, b = 0;
  double reach = 0.0;  // sum of the radii [m]
};

struct BodySpheres {
  std::vector<int> robot_point;   // per sphere of the robot: its point of the chain
  PointTracks human;              // (T, H, 3): the partner's before optimisation
  std::vector<int> human_offset;  // per sphere of the partner: which of the 6 offsets moves it, -1 for none
  std::vector<SpherePair> pairs;
};

// Adds the robot's spheres to the points of `chain`. Pairs within the robot are those of regions that its card lets
// touch; pairs of the two bodies leave out hands against hands and arms, which are meant to meet, and thighs against
// what is above the hips.
BodySpheres make_body_spheres(const RobotModel& robot, UprightChain& chain, const HumanMotion& partner);

// The parts of the partner that PAIR moves: shoulders, elbows and wrists, 6 offsets a frame; and his arm bones, whose
// lengths are those of the source. Pure.

inline constexpr int kHumanOffsets = 6;          // shoulders, elbows, wrists; left before right
inline constexpr int kArmBones = kHumanOffsets;  // bone k ends at offset k: collar - shoulder - elbow - wrist

// Offset of a joint of the partner: 0..5, or -1 for a joint that stays. Hands follow wrists.
int human_offset_of(int smpl);

// The offset that bone k begins at, -1 for a collar, which stays.
inline int bone_begin(int bone) { return bone < 2 ? -1 : bone - 2; }

// The six bones of every frame, begin to end, (18, T) [m].
Eigen::MatrixXd arm_bones(const HumanMotion& person);

// Moves shoulders, elbows and wrists of `adapted` to the nearest places where each bone has its length in `source` in
// that frame, exactly: the shoulder on a sphere about the collar, the elbow on the circle that the two bones of the arm
// allow, on the side where it was. The wrist stays where it is within reach; the hand follows it.
void keep_arm_lengths(const HumanMotion& source, HumanMotion& adapted);

// A carried object in PAIR's contact term (supplement A.1.1 and Fig. S3): a rigid set of keypoints that is no variable.
// The robot's keypoints keep the distances that the replaced person's had from the object's, and the partner's theirs.

struct ObjectKeypoints {
  PointTracks points;         // (T, O, 3) in W; empty: no object, or a weight of 0
  Eigen::MatrixXd distances;  // (2 K O, T): of the K keypoints of the replaced person, then of the partner, each from
                              // the O points, row by row [m]

  [[nodiscard]] int count() const { return points.points(); }
};

// `source` and `partner` (T, K, 3) are the keypoints of the original people.
ObjectKeypoints make_object_keypoints(const CarriedObject& object, const PointTracks& source,
                                      const PointTracks& partner);

// Factors of the squared changes of distance, for the robot's and the partner's keypoints, without the keypoints' own.
struct ObjectFactors {
  double robot = 0.0, human = 0.0;
};

// The squared changes of frame t times their factors and the keypoints' weights, both triangles of the matrix. `keys`
// (3, 2 K), the robot's first; `per_change` times the slope by each keypoint is added to `key_force`.
double object_term(const ObjectKeypoints& object, const PairChain& chain, const ObjectFactors& factors,
                   double per_change, int t, const Eigen::Matrix3Xd& keys, Eigen::Matrix3Xd& key_force);

}  // namespace duet
