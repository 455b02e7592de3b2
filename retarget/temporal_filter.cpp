#include "duet/retarget/temporal_filter.h"

#include <algorithm>
#include <cmath>

#include "duet/retarget/pair_objective.h"

namespace duet {
namespace {

constexpr double kLeastStiffness = 1e-2;  // of a joint that moves no point
// The share of the stiffness of distances that all count, for where only near ones do: with .3, .5 and 1 the search
// ended after equally many steps on development clips, with 3 it did not end.
constexpr double kNearShare = 0.5;

// Squared lever arms of one hinge at q = 0: of the pairs' points and of the keypoints' that it moves.
struct Levers {
  double pairs = 0.0, keys = 0.0;
};

class LeverArms {
 public:
  explicit LeverArms(const PairChain& chain) : chain_(chain) {
    forward(chain, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), Eigen::VectorXd::Zero(chain.dof()), pose_);
  }

  [[nodiscard]] Levers of_joint(int joint) const {
    const ChainJoint& hinge = chain_.joints[joint];
    return sum(joint + 1, pose_.R_WL[joint + 1].col(hinge.axis), pose_.p_WL[joint + 1]);
  }
  [[nodiscard]] Levers of_base(const Eigen::Vector3d& axis) const { return sum(0, axis, pose_.p_WL[0]); }

 private:
  [[nodiscard]] bool moves(int link, int point_link) const {
    while (point_link > link) point_link = chain_.joints[point_link - 1].parent;
    return point_link == link;
  }

  [[nodiscard]] Levers sum(int link, const Eigen::Vector3d& axis, const Eigen::Vector3d& at) const {
    const auto lever = [&](int point) {
      if (point < 0 || !moves(link, chain_.points[point].link)) return 0.0;
      return axis.cross(Eigen::Vector3d(pose_.points.col(point)) - at).squaredNorm();
    };
    Levers out;
    for (const int point : chain_.pair_points) out.pairs += lever(point);
    for (const int point : chain_.key_points) out.keys += lever(point);
    return out;
  }

  const PairChain& chain_;
  ChainPose pose_;
};

// Stiffness that one metre of a keypoint meets: a distance has a slope of one in three directions' third.
struct KeyStiffness {
  double robot = 0.0, human = 0.0;
};

// Mean over the keypoints of what a carried object adds.
KeyStiffness object_stiffness(const PairProblem& problem, const PairOptions& options, const PairWeights& weights) {
  const ObjectFactors f = object_factors(options, problem.chain.keys());
  double share = 0.0;
  for (const double own : problem.chain.key_object) share += own / problem.chain.keys();
  const double all = 4.0 * weights.con * weights.object / 3.0 * share * problem.object.count();
  return {all * f.robot, all * f.human};
}

KeyStiffness key_stiffness(const PairOptions& options, const PairWeights& weights, int keys) {
  const ContactFactors f = contact_factors(options, keys);
  const double per_distance = 4.0 * weights.con * f.all / 3.0;
  return {per_distance * (f.cross * keys + f.robot * (keys - 1)),
          per_distance * (f.cross * keys + f.human * (keys - 1))};
}

}  // namespace

TemporalFactor temporal_factor(double stiffness, double velocity, double acceleration) {
  const double a0 = stiffness + 2.0 * velocity + 6.0 * acceleration;
  const double a1 = -velocity - 4.0 * acceleration;
  const double a2 = acceleration;
  // The factorisation of a longer and longer matrix settles, as it is diagonally stiff.
  double d1 = a0, d2 = a0, l1 = 0.0, first = 0.0, second = 0.0;
  for (int k = 0; k < 2000; ++k) {
    second = k > 1 ? a2 / d2 : 0.0;
    first = k > 0 ? (a1 - second * d2 * l1) / d1 : 0.0;
    const double d = a0 - first * first * d1 - second * second * d2;
    const bool settled = k > 3 && std::abs(d - d1) < 1e-13 * d;
    d2 = d1;
    d1 = d;
    l1 = first;
    if (settled) break;
  }
  return {first, second, std::sqrt(d1)};
}

Preconditioner make_preconditioner(const PairProblem& problem, const PairOptions& options, const PairWeights& weights) {
  const int dof = problem.chain.dof();
  const double frames = problem.frames();
  KeyStiffness key = key_stiffness(options, weights, problem.chain.keys());
  if (problem.nearness.size() > 0) key.robot *= kNearShare;
  const KeyStiffness object = object_stiffness(problem, options, weights);
  key = {key.robot + object.robot, key.human + object.human};
  const double pair = 2.0 * weights.kin / (options.kin_loss == KinLoss::kMeanNorm ? kRetargetPairs : 1.0);
  const double velocity = 2.0 * weights.temp * frames / (frames - 1.0);
  const double acceleration = 2.0 * weights.temp * weights.acceleration * frames / (frames - 2.0);
  const LeverArms arms(problem.chain);
  const auto stiffness = [&](const Levers& l) {
    return std::max(kLeastStiffness, pair * l.pairs + key.robot * l.keys);
  };
  Preconditioner out;
  for (int j = 0; j < dof; ++j)
    out.rows.push_back(temporal_factor(stiffness(arms.of_joint(j)) + 2.0 * weights.pose / dof, velocity, acceleration));
  for (int r = 0; r < 3; ++r)
    out.rows.push_back(temporal_factor(stiffness(arms.of_base(Eigen::Vector3d::Unit(r))), 0.0, 0.0));
  for (int k = 0; k < 3 * kHumanOffsets; ++k) {
    const double keys = k / 3 >= 4 ? 2.0 : 1.0;  // a wrist takes its hand along
    const double bones = k / 3 >= 4 ? 1.0 : 2.0;
    const double own = 2.0 * weights.hum + keys * key.human + 2.0 * weights.bone * bones / 3.0;
    out.rows.push_back(
        temporal_factor(std::max(kLeastStiffness, own), weights.partner * velocity, weights.partner * acceleration));
  }
  const double keys = problem.chain.keys();
  const double root = pair * kRetargetPairs +
                      keys * 4.0 * weights.con * contact_factors(options, problem.chain.keys()).all / 3.0 * keys +
                      keys * object.robot;
  for (int r = 0; r < 3; ++r) out.rows.push_back(temporal_factor(std::max(kLeastStiffness, root), 0.0, 0.0));
  out.offset = frames * std::max(kLeastStiffness, root);
  return out;
}

}  // namespace duet
