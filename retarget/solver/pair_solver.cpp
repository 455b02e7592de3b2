#include "duet/retarget/solver/pair_solver.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/retarget/kernels/kernels.h"
#include "duet/retarget/solver/lane_problem.h"
#include "duet/retarget/solver/lbfgs.h"

namespace duet {
namespace {

// Adam in double over all variables, on the objective itself.
class ReferenceSolver {
 public:
  ReferenceSolver(const PairProblem& problem, const PairOptions& options)
      : problem_(problem),
        options_(options),
        x_(PairVariables::at_rest(problem)),
        mean_(PairVariables::zero(problem.chain.dof(), problem.frames())),
        square_(mean_) {}

  PairTerms iterate(const PairIteration& iteration) {
    if (iteration.reset) mean_ = square_ = PairVariables::zero(problem_.chain.dof(), problem_.frames());
    const PairTerms terms = evaluate(problem_, options_, iteration.weights, x_, &gradient_);
    adam(iteration, gradient_.frames.array(), mean_.frames.array(), square_.frames.array(), x_.frames.array());
    adam(iteration, gradient_.offset.array(), mean_.offset.array(), square_.offset.array(), x_.offset.array());
    for (int j = 0; j < problem_.chain.dof(); ++j) {
      const ChainJoint& joint = problem_.chain.joints[j];
      x_.frames.row(j) = x_.frames.row(j).cwiseMax(joint.lower).cwiseMin(joint.upper);
    }
    return terms;
  }

  [[nodiscard]] const PairVariables& variables() const { return x_; }

 private:
  template <typename Gradient, typename Array>
  static void adam(const PairIteration& iteration, const Gradient& g, Array mean, Array square, Array x) {
    mean = 0.9 * mean + 0.1 * g;
    square = 0.999 * square + 0.001 * g.square();
    const double rate = iteration.rate / (1.0 - std::pow(0.9, iteration.adam_step));
    const double bias = 1.0 / std::sqrt(1.0 - std::pow(0.999, iteration.adam_step));
    x -= rate * mean / (bias * square.sqrt() + iteration.epsilon);
  }

  const PairProblem& problem_;
  const PairOptions& options_;
  PairVariables x_, mean_, square_, gradient_;
};

PairSolution solve_in_double(const PairProblem& problem, const PairOptions& options) {
  ReferenceSolver solver(problem, options);
  PairSolution solution;
  for (int i = 0; i < pair_iterations(options); ++i) {
    const PairIteration iteration = pair_iteration(options, i);
    solution.terms.push_back(solver.iterate(iteration));
    solution.total.push_back(solution.terms.back().total(iteration.weights));
  }
  solution.x = solver.variables();
  return solution;
}

}  // namespace

KernelKind choose_kernel(const PairProblem& problem, const PairOptions& options) {
  if (options.kernel == KernelKind::kAuto) {
    return kernel_fits(problem) ? available_kernels().front() : KernelKind::kScalar;
  }
  if (options.kernel == KernelKind::kScalar) return KernelKind::kScalar;
  require(kernel_fits(problem),
          "pair kernel '{}' has no room for {} joints, {} points and {} keypoints; use 'auto' or 'scalar'",
          to_string(options.kernel), problem.chain.dof(), problem.chain.points.size(), problem.chain.keys());
  if (!kernel_runs_here(options.kernel)) {
    throw MissingError(fmt::format("pair kernel '{}' cannot run on this processor; the best that can is '{}'",
                                   to_string(options.kernel), to_string(available_kernels().front())));
  }
  return options.kernel;
}

PairSolution solve_pair(const PairProblem& problem, const PairOptions& options) {
  validate(options);
  const KernelKind kernel = choose_kernel(problem, options);
  if (kernel == KernelKind::kScalar && options.optimizer == Optimizer::kLbfgs)
    return solve_by_double_lbfgs(problem, options);
  if (kernel == KernelKind::kScalar) return solve_in_double(problem, options);
  return solve_in_lanes(problem, options, kernel);
}

}  // namespace duet
