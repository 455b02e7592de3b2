#include "duet/retarget/object_term.h"

#include <cmath>

namespace duet {
namespace {

constexpr double kObjectGuard = 1e-12;  // kDistanceGuard of retarget/pair_problem.h

}  // namespace

ObjectKeypoints make_object_keypoints(const CarriedObject& object, const PointTracks& source,
                                      const PointTracks& partner) {
  ObjectKeypoints out;
  if (object.empty()) return out;
  out.points = keypoint_tracks(object);
  const int keys = source.points(), count = out.count();
  out.distances.resize(2L * keys * count, source.frames());
  for (int t = 0; t < source.frames(); ++t) {
    Eigen::Index row = 0;
    for (const PointTracks* person : {&source, &partner})
      for (int i = 0; i < keys; ++i)
        for (int o = 0; o < count; ++o) out.distances(row++, t) = (person->at(t, i) - out.points.at(t, o)).norm();
  }
  return out;
}

double object_term(const ObjectKeypoints& object, const PairChain& chain, const ObjectFactors& factors,
                   double per_change, int t, const Eigen::Matrix3Xd& keys, Eigen::Matrix3Xd& key_force) {
  const int count = object.count();
  double sum = 0.0;
  for (int i = 0; i < 2 * chain.keys(); ++i) {
    const bool robot = i < chain.keys();
    const double factor = (robot ? factors.robot : factors.human) * chain.key_object[robot ? i : i - chain.keys()];
    if (factor == 0.0) continue;
    for (int o = 0; o < count; ++o) {
      const Eigen::Vector3d d = keys.col(i) - object.points.at(t, o);
      const double distance = std::sqrt(d.squaredNorm() + kObjectGuard);
      const double error = distance - object.distances(static_cast<Eigen::Index>(i) * count + o, t);
      sum += 2.0 * factor * error * error;
      key_force.col(i) += 4.0 * per_change * factor * error / distance * d;
    }
  }
  return sum;
}

}  // namespace duet
