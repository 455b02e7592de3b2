#include "duet/retarget/pair_kernel.h"

#include <algorithm>
#include <cmath>

#include "duet/retarget/lane_lbfgs.h"

namespace duet {

namespace {

// Adam, and the state of its optimisation.
class LaneSolver {
 public:
  LaneSolver(const PairProblem& problem, const PairOptions& options, KernelKind kernel)
      : options_(options),
        lanes_(problem, options, kernel),
        x_(lanes_.rows_at_rest(problem)),
        next_(x_),
        mean_(lanes_.make_rows()),
        square_(mean_) {}

  PairTerms iterate(const PairIteration& iteration);
  [[nodiscard]] PairVariables variables() const { return lanes_.variables(x_, offset_); }

 private:
  void move_offset(const PairIteration& iteration, const Eigen::Vector3d& gradient);

  const PairOptions& options_;
  LaneProblem lanes_;
  LaneProblem::Rows x_, next_, mean_, square_;
  Eigen::Array3d offset_ = Eigen::Array3d::Zero();
  Eigen::Array3d offset_mean_ = Eigen::Array3d::Zero();
  Eigen::Array3d offset_square_ = Eigen::Array3d::Zero();
};

void LaneSolver::move_offset(const PairIteration& iteration, const Eigen::Vector3d& gradient) {
  if (options_.root_translation != RootTranslation::kConstantOffset) return;
  offset_mean_ = 0.9 * offset_mean_ + 0.1 * gradient.array();
  offset_square_ = 0.999 * offset_square_ + 0.001 * gradient.array().square();
  const double k = iteration.adam_step;
  const Eigen::Array3d root = (offset_square_ / (1.0 - std::pow(0.999, k))).sqrt();
  offset_ -= iteration.rate / (1.0 - std::pow(0.9, k)) * offset_mean_ / (root + iteration.epsilon);
}

PairTerms LaneSolver::iterate(const PairIteration& iteration) {
  if (iteration.reset) {
    std::fill(mean_.begin(), mean_.end(), pair_kernel::Row{});
    std::fill(square_.begin(), square_.end(), pair_kernel::Row{});
    offset_mean_.setZero();
    offset_square_.setZero();
  }
  pair_kernel::Step step = lanes_.make_step(iteration.weights, offset_);
  step.rate = static_cast<float>(iteration.rate / (1.0 - std::pow(0.9, iteration.adam_step)));
  step.square = static_cast<float>(1.0 / std::sqrt(1.0 - std::pow(0.999, iteration.adam_step)));
  step.epsilon = static_cast<float>(iteration.epsilon * lanes_.frames());
  const LaneProblem::Sums sums = lanes_.sweep({.x = x_.data() + lanes_.halo(),
                                               .next = next_.data() + lanes_.halo(),
                                               .mean = mean_.data(),
                                               .square = square_.data(),
                                               .gradient = nullptr},
                                              step);
  std::swap(x_, next_);
  lanes_.fill_halo(x_);
  Eigen::Vector3d force(sums[pair_kernel::kForce], sums[pair_kernel::kForce + 1], sums[pair_kernel::kForce + 2]);
  if (lanes_.setup().upright) force.z() = 0.0;
  move_offset(iteration, force / lanes_.frames());
  return lanes_.terms(sums, iteration.weights);
}

}  // namespace

PairSolution solve_in_lanes(const PairProblem& problem, const PairOptions& options, KernelKind kernel) {
  if (options.optimizer == Optimizer::kLbfgs) return solve_by_lane_lbfgs(problem, options, kernel);
  LaneSolver solver(problem, options, kernel);
  PairSolution solution;
  solution.kernel = kernel;
  for (int i = 0; i < pair_iterations(options); ++i) {
    const PairIteration iteration = pair_iteration(options, i);
    solution.terms.push_back(solver.iterate(iteration));
    solution.total.push_back(solution.terms.back().total(iteration.weights));
  }
  solution.x = solver.variables();
  return solution;
}

}  // namespace duet
