#include "duet/retarget/solver/lbfgs.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "duet/retarget/pair_problem.h"

namespace duet {
namespace {

constexpr int kMostHalvings = 6;

constexpr double kLongestJointStep = 1.0, kLongestJointTurn = 0.4;  // as in lanes [rad]

class DoubleLbfgs {
 public:
  DoubleLbfgs(const PairProblem& problem, const PairOptions& options)
      : problem_(problem),
        options_(options),
        weights_(pair_iteration(options, pair_iterations(options) - 1).weights),
        preconditioner_(make_preconditioner(problem, options, weights_)),
        x_(PairVariables::at_rest(problem)) {
    vectors_.fill(PairVariables::zero(problem.chain.dof(), problem.frames()));
  }

  PairSolution solve();

 private:
  PairTerms filtered_gradient(const PairVariables& x, PairVariables& out) const;
  [[nodiscard]] PairVariables to_filtered(PairVariables step) const;
  [[nodiscard]] PairVariables from_filtered(PairVariables direction) const;
  [[nodiscard]] PairVariables moved(const PairVariables& direction, double rate) const;
  void multiply(int slot);
  [[nodiscard]] PairVariables choose_direction() const;
  bool go(const PairVariables& direction);
  void descend(const PairWeights& weights, int iterations, PairSolution& solution);

  const PairProblem& problem_;
  const PairOptions& options_;
  PairWeights weights_;
  Preconditioner preconditioner_;
  PairVariables x_;
  std::array<PairVariables, LbfgsMemory::kGradient + 1> vectors_;  // in the preconditioner's space
  LbfgsMemory memory_;
  PairTerms terms_;  // at x_
};

// D^(-1/2) L^-1 of T times the gradient, without what would leave the joints' limits.
PairTerms DoubleLbfgs::filtered_gradient(const PairVariables& x, PairVariables& out) const {
  const PairTerms terms = evaluate(problem_, options_, weights_, x, &out);
  const double frames = problem_.frames();
  for (int j = 0; j < problem_.chain.dof(); ++j) {
    const ChainJoint& joint = problem_.chain.joints[j];
    for (Eigen::Index t = 0; t < x.frames.cols(); ++t) {
      double& g = out.frames(j, t);
      if ((x.frames(j, t) <= joint.lower && g > 0.0) || (x.frames(j, t) >= joint.upper && g < 0.0)) g = 0.0;
    }
  }
  for (Eigen::Index i = 0; i < x.frames.rows(); ++i) {
    const TemporalFactor& f = preconditioner_.rows[static_cast<std::size_t>(i)];
    for (Eigen::Index t = 0; t < x.frames.cols(); ++t) {
      out.frames(i, t) *= frames / f.scale;
      if (t > 0) out.frames(i, t) -= f.first * out.frames(i, t - 1);
      if (t > 1) out.frames(i, t) -= f.second * out.frames(i, t - 2);
    }
  }
  out.offset *= frames / std::sqrt(preconditioner_.offset);
  return terms;
}

PairVariables DoubleLbfgs::to_filtered(PairVariables step) const {
  const Eigen::Index frames = step.frames.cols();
  for (Eigen::Index i = 0; i < step.frames.rows(); ++i) {
    const TemporalFactor& f = preconditioner_.rows[static_cast<std::size_t>(i)];
    for (Eigen::Index t = 0; t < frames; ++t) {
      if (t + 1 < frames) step.frames(i, t) += f.first * step.frames(i, t + 1);
      if (t + 2 < frames) step.frames(i, t) += f.second * step.frames(i, t + 2);
      step.frames(i, t) *= f.scale;
    }
  }
  step.offset *= std::sqrt(preconditioner_.offset);
  return step;
}

PairVariables DoubleLbfgs::from_filtered(PairVariables direction) const {
  const Eigen::Index frames = direction.frames.cols();
  for (Eigen::Index i = 0; i < direction.frames.rows(); ++i) {
    const TemporalFactor& f = preconditioner_.rows[static_cast<std::size_t>(i)];
    for (Eigen::Index t = frames - 1; t >= 0; --t) {
      direction.frames(i, t) /= f.scale;
      if (t + 1 < frames) direction.frames(i, t) -= f.first * direction.frames(i, t + 1);
      if (t + 2 < frames) direction.frames(i, t) -= f.second * direction.frames(i, t + 2);
    }
  }
  direction.offset /= std::sqrt(preconditioner_.offset);
  return direction;
}

PairVariables DoubleLbfgs::moved(const PairVariables& direction, double rate) const {
  PairVariables x{rate * direction.frames, x_.offset + rate * direction.offset};
  const int dof = problem_.chain.dof();
  x.frames.topRows(dof) = x.frames.topRows(dof).cwiseMax(-kLongestJointTurn).cwiseMin(kLongestJointTurn);
  x.frames += x_.frames;
  for (int j = 0; j < dof; ++j) {
    const ChainJoint& joint = problem_.chain.joints[j];
    x.frames.row(j) = x.frames.row(j).cwiseMax(joint.lower).cwiseMin(joint.upper);
  }
  return x;
}

void DoubleLbfgs::multiply(int slot) {
  for (const int i : {slot, slot + 1, LbfgsMemory::kGradient}) {
    for (int k = 0; k <= LbfgsMemory::kGradient; ++k)
      memory_.set(
          i, k, vectors_[i].frames.cwiseProduct(vectors_[k].frames).sum() + vectors_[i].offset.dot(vectors_[k].offset));
  }
}

PairVariables DoubleLbfgs::choose_direction() const {
  const Eigen::VectorXd factor = memory_.direction();
  PairVariables direction = PairVariables::zero(problem_.chain.dof(), problem_.frames());
  for (int k = 0; k <= LbfgsMemory::kGradient; ++k) {
    direction.frames += factor[k] * vectors_[k].frames;
    direction.offset += factor[k] * vectors_[k].offset;
  }
  return from_filtered(direction);
}

// Moves to where the objective is lower along `direction`, remembering the step; false where there is no such place.
bool DoubleLbfgs::go(const PairVariables& direction) {
  PairVariables& gradient = vectors_[LbfgsMemory::kGradient];
  const double longest = direction.frames.topRows(problem_.chain.dof()).cwiseAbs().maxCoeff();
  double rate = std::min(1.0, kLongestJointStep / std::max(longest, 1e-6));
  for (int halving = 0; halving <= kMostHalvings; ++halving, rate *= 0.5) {
    const PairVariables next = moved(direction, rate);
    PairVariables there;
    const PairTerms terms = filtered_gradient(next, there);
    if (!(terms.total(weights_) < terms_.total(weights_))) continue;
    const int slot = memory_.next_slot();
    vectors_[slot] = to_filtered({next.frames - x_.frames, next.offset - x_.offset});
    vectors_[slot + 1] = {there.frames - gradient.frames, there.offset - gradient.offset};
    gradient = there;
    x_ = next;
    terms_ = terms;
    multiply(slot);
    if (!memory_.keep()) memory_.forget();
    return true;
  }
  return false;
}

void DoubleLbfgs::descend(const PairWeights& weights, int iterations, PairSolution& solution) {
  weights_ = weights;
  memory_.forget();
  terms_ = filtered_gradient(x_, vectors_[LbfgsMemory::kGradient]);
  multiply(0);
  int small = 0;
  for (int i = 0; i < iterations && small < 3; ++i) {
    const double before = terms_.total(weights_);
    solution.terms.push_back(terms_);
    solution.total.push_back(before);
    if (!go(choose_direction())) {
      if (memory_.pairs() == 0) break;
      memory_.forget();
      continue;
    }
    small = before - terms_.total(weights_) < options_.lbfgs_tolerance * before ? small + 1 : 0;
  }
}

PairSolution DoubleLbfgs::solve() {
  PairSolution solution;
  const PairWeights last = weights_;
  const int imitation = imitation_iterations(options_);
  if (imitation > 0) descend(pair_iteration(options_, 0).weights, imitation, solution);
  descend(last, options_.lbfgs_iterations - imitation, solution);
  solution.terms.push_back(terms_);
  solution.total.push_back(terms_.total(weights_));
  solution.x = x_;
  return solution;
}

}  // namespace

PairSolution solve_by_double_lbfgs(const PairProblem& problem, const PairOptions& options) {
  return DoubleLbfgs(problem, options).solve();
}

PairIteration pair_iteration(const PairOptions& options, int iteration) {
  const PairSchedule& schedule = options.schedule;
  const bool second = iteration >= schedule.stage1_iterations;
  const bool restarted = second && !schedule.keep_moments;
  PairIteration out;
  out.weights = options.weights;
  if (second) out.weights.con *= schedule.stage2_contact_scale;
  out.rate = second ? schedule.stage2_rate : schedule.stage1_rate;
  out.epsilon = schedule.epsilon;
  out.adam_step = iteration + 1 - (restarted ? schedule.stage1_iterations : 0);
  out.reset = restarted && iteration == schedule.stage1_iterations;
  return out;
}

int imitation_iterations(const PairOptions& options) { return std::min(8, options.lbfgs_iterations / 6); }

namespace {
constexpr double kLeastCurvature = 1e-8;  // s.y over |s| |y|
}  // namespace

bool LbfgsMemory::keep() {
  const int s = next_slot(), y = s + 1;
  const double curvature = product(s, y);
  if (!(curvature > kLeastCurvature * std::sqrt(product(s, s) * product(y, y)))) return false;
  ++stored_;
  return true;
}

Eigen::VectorXd LbfgsMemory::direction() const {
  Eigen::VectorXd factor = Eigen::VectorXd::Zero(kGradient + 1);
  factor[kGradient] = 1.0;
  const auto times = [&](int slot) { return gram_.row(slot).dot(factor); };
  std::array<double, kPairs> alpha{};
  for (int k = 0; k < pairs(); ++k) {  // from the newest back
    const int s = 2 * ((stored_ - 1 - k) % kPairs);
    alpha[k] = times(s) / product(s, s + 1);
    factor[s + 1] -= alpha[k];
  }
  if (stored_ > 0) {
    const int s = 2 * ((stored_ - 1) % kPairs);
    factor *= product(s, s + 1) / product(s + 1, s + 1);
  }
  for (int k = pairs() - 1; k >= 0; --k) {
    const int s = 2 * ((stored_ - 1 - k) % kPairs);
    factor[s] += alpha[k] - times(s + 1) / product(s, s + 1);
  }
  return -factor;
}

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
