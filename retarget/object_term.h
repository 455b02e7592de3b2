// A carried object in PAIR's contact term (supplement A.1.1 and Fig. S3): a rigid set of keypoints that is no variable.
// The robot's keypoints keep the distances that the replaced person's had from the object's, and the partner's theirs.
#pragma once

#include "duet/core/point_tracks.h"
#include "duet/motion/carried_object.h"
#include "duet/retarget/pair_chain.h"

namespace duet {

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
