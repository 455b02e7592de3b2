#include "duet/retarget/double_lbfgs.h"

#include <array>

#include "duet/retarget/lbfgs_memory.h"
#include "duet/retarget/temporal_filter.h"

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

}  // namespace duet
