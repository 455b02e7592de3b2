#include <algorithm>
#include <cmath>
#include <optional>

#include "duet/retarget/solver/lane_problem.h"
#include "duet/retarget/solver/lbfgs.h"

namespace duet {
namespace {

using pair_kernel::kLanes;
using pair_kernel::Row;
using Rows = LaneProblem::Rows;

constexpr int kHalvings = 6;     // of a step that does not descend
constexpr double kFaded = 1e-9;  // of a state that a lane hands on to the next

constexpr double kFarthestTurn = 1.0;  // of a joint along the direction in one step [rad]
constexpr double kLongestTurn = 0.4;   // of it what is taken: longer turns jump into poor minima, and a few joints that
                                       // would turn far do not hold up the others

// The sum that a state of two values at a lane's beginning adds to the frames after it: the answers of the filter to 1.
struct Answer {
  std::vector<float> first, second;                // until they have faded
  Eigen::Matrix2d over = Eigen::Matrix2d::Zero();  // from the state before a segment to that at its end
};

Answer make_answer(const TemporalFactor& f, int blocks) {
  Answer out;
  Eigen::Matrix2d state = Eigen::Matrix2d::Identity();  // rows: value now, value before; columns: of first, second
  for (int k = 0; k < blocks; ++k) {
    const Eigen::RowVector2d next = -f.first * state.row(0) - f.second * state.row(1);
    state.row(1) = state.row(0);
    state.row(0) = next;
    if (state.cwiseAbs().maxCoeff() < kFaded) return out;
    out.first.push_back(static_cast<float>(next[0]));
    out.second.push_back(static_cast<float>(next[1]));
  }
  out.over = state;
  return out;
}

class LaneLbfgs {
 public:
  LaneLbfgs(const PairProblem& problem, const PairOptions& options, KernelKind kernel)
      : options_(options),
        weights_(pair_iteration(options, pair_iterations(options) - 1).weights),
        lanes_(problem, options, kernel),
        x_(lanes_.rows_at_rest(problem)),
        next_(x_),
        gradient_(lanes_.make_rows()),
        here_(gradient_),
        there_(gradient_) {
    for (int i = 0; i < 2 * LbfgsMemory::kPairs; ++i) vectors_.push_back(lanes_.make_rows());
    const Preconditioner preconditioner = make_preconditioner(problem, options, weights_);
    for (int i = 0; i < lanes_.setup().rows; ++i) {
      const TemporalFactor& f = preconditioner.rows[lanes_.variable_of(i)];
      filter_.first[i] = static_cast<float>(f.first);
      filter_.second[i] = static_cast<float>(f.second);
      filter_.scale[i] = static_cast<float>(f.scale);
      filter_.inverse[i] = static_cast<float>(1.0 / f.scale);
      answers_.push_back(make_answer(f, lanes_.blocks()));
    }
    offset_scale_ = std::sqrt(preconditioner.offset);
    for (Eigen::Vector3d& v : offsets_) v.setZero();
  }

  PairSolution solve();

 private:
  struct Value {
    double objective = 0.0;
    PairTerms terms;
  };

  [[nodiscard]] pair_kernel::VectorSweep whole() const {
    return {&lanes_.setup(), &filter_, lanes_.rows(), lanes_.blocks(), 0, lanes_.blocks()};
  }
  [[nodiscard]] double longest_turn(const Rows& direction) const;
  Value evaluate_at(const Rows& x, const Eigen::Array3d& offset, Rows& out, Eigen::Vector3d& offset_out);
  void carry_on(Rows& y, bool backwards) const;
  void multiply(int slot);
  // The direction, in `direction` and as the offset's; its slope.
  double choose_direction(Rows& direction, Eigen::Vector3d& offset);
  struct Step {
    Eigen::Array3d offset;
    Eigen::Vector3d offset_gradient = Eigen::Vector3d::Zero();
    Value value = {};
  };
  std::optional<Step> search(const Rows& direction, const Eigen::Vector3d& offset_direction);
  bool take(const Step& step);
  void descend(const PairWeights& weights, int iterations, PairSolution& solution);

  const PairOptions& options_;
  PairWeights weights_;
  LaneProblem lanes_;
  pair_kernel::Filter filter_{};
  std::vector<Answer> answers_;
  Rows x_, next_, gradient_, here_, there_;  // here_, there_: filtered gradients
  std::vector<Rows> vectors_;
  LbfgsMemory memory_;
  // The root's offset beside the rows, in the preconditioned space: of each slot and of the gradient.
  std::array<Eigen::Vector3d, LbfgsMemory::kGradient + 1> offsets_;
  Eigen::Array3d offset_ = Eigen::Array3d::Zero();
  double offset_scale_ = 1.0;
  Value value_;  // at x_
};

// A lane's segment was filtered from zero: adds what the segment before it (after it, backwards) leaves over.
void LaneLbfgs::carry_on(Rows& y, bool backwards) const {
  const auto rows = static_cast<std::size_t>(lanes_.setup().rows);
  const int blocks = lanes_.blocks();
  const auto at = [&](int block, std::size_t row) -> Row& {
    return y[static_cast<std::size_t>(backwards ? blocks - 1 - block : block) * rows + row];
  };
  for (std::size_t row = 0; row < rows; ++row) {
    const Answer& answer = answers_[row];
    if (answer.first.empty()) continue;
    Row first{}, second{};  // the state that each lane begins with
    Eigen::Vector2d state = Eigen::Vector2d::Zero();
    for (int k = 0; k < kLanes; ++k) {
      const int lane = backwards ? kLanes - 1 - k : k;
      first.lane[lane] = static_cast<float>(state[0]);
      second.lane[lane] = static_cast<float>(state[1]);
      const double last = at(blocks - 1, row).lane[lane];
      const double before = blocks > 1 ? at(blocks - 2, row).lane[lane] : 0.0;
      state = answer.over * state + Eigen::Vector2d(last, before);
    }
    for (int block = 0; block < static_cast<int>(answer.first.size()); ++block) {
      Row& value = at(block, row);
      for (int lane = 0; lane < kLanes; ++lane)
        value.lane[lane] += answer.first[block] * first.lane[lane] + answer.second[block] * second.lane[lane];
    }
  }
}

LaneLbfgs::Value LaneLbfgs::evaluate_at(const Rows& x, const Eigen::Array3d& offset, Rows& out,
                                        Eigen::Vector3d& offset_out) {
  const pair_kernel::Step step = lanes_.make_step(weights_, offset);
  const LaneProblem::Sums sums = lanes_.sweep({.x = x.data() + lanes_.halo(),
                                               .next = nullptr,
                                               .mean = nullptr,
                                               .square = nullptr,
                                               .gradient = gradient_.data()},
                                              step);
  lanes_.kernel().filter_gradient(whole(), x.data() + lanes_.halo(), gradient_.data(), out.data());
  carry_on(out, false);
  offset_out.setZero();
  if (options_.root_translation == RootTranslation::kConstantOffset) {
    for (int r = 0; r < (lanes_.setup().upright ? 2 : 3); ++r)
      offset_out[r] = sums[pair_kernel::kForce + r] / offset_scale_;
  }
  Value value{0.0, lanes_.terms(sums, weights_)};
  value.objective = value.terms.total(weights_);
  return value;
}

double LaneLbfgs::longest_turn(const Rows& direction) const {
  float longest = 1e-6F;
  for (std::size_t first = 0; first < direction.size(); first += lanes_.rows()) {
    for (int i = 0; i < lanes_.setup().dof; ++i) {
      for (const float value : direction[first + i].lane) longest = std::max(longest, std::abs(value));
    }
  }
  return longest;
}

// Products of slot's s and y and of the gradient with everything.
void LaneLbfgs::multiply(int slot) {
  const int pairs = std::min(memory_.pairs() + 1, LbfgsMemory::kPairs);
  std::vector<const Row*> vectors;
  vectors.reserve(2 * static_cast<std::size_t>(pairs));
  for (int i = 0; i < 2 * pairs; ++i) vectors.push_back(vectors_[i].data());
  const int count = 2 * pairs;
  std::vector<double> total(3 * (count + 1), 0.0);
  for (int begin = 0; begin < lanes_.blocks(); begin += kBlocksPerSum) {
    pair_kernel::VectorSweep part = whole();
    part.begin = begin;
    part.end = std::min(begin + kBlocksPerSum, lanes_.blocks());
    std::vector<Row> sums(3 * (count + 1));
    lanes_.kernel().dots(part, vectors.data(), count, slot, here_.data(), sums.data());
    for (std::size_t i = 0; i < sums.size(); ++i) {
      for (const float value : sums[i].lane) total[i] += value;
    }
  }
  for (int i = 0; i <= count; ++i) {
    const int index = i < count ? i : LbfgsMemory::kGradient;
    const std::array<int, 3> with = {slot, slot + 1, LbfgsMemory::kGradient};
    for (int k = 0; k < 3; ++k) memory_.set(index, with[k], total[3 * i + k] + offsets_[index].dot(offsets_[with[k]]));
  }
}

double LaneLbfgs::choose_direction(Rows& direction, Eigen::Vector3d& offset) {
  const Eigen::VectorXd factor = memory_.direction();
  std::vector<const Row*> vectors;
  std::vector<float> factors;
  double slope = 0.0;
  offset.setZero();
  for (int i = 0; i <= LbfgsMemory::kGradient; ++i) {
    if (factor[i] == 0.0) continue;
    vectors.push_back(i == LbfgsMemory::kGradient ? here_.data() : vectors_[i].data());
    factors.push_back(static_cast<float>(factor[i]));
    offset += factor[i] / offset_scale_ * offsets_[i];
    slope += factor[i] * memory_.product(i, LbfgsMemory::kGradient);
  }
  lanes_.kernel().combine(whole(), vectors.data(), factors.data(), static_cast<int>(vectors.size()), direction.data());
  carry_on(direction, true);
  return slope;
}

// Goes along `direction` until the objective is lower there: then next_ and there_ hold the place and its gradient.
std::optional<LaneLbfgs::Step> LaneLbfgs::search(const Rows& direction, const Eigen::Vector3d& offset_direction) {
  double rate = std::min(1.0, kFarthestTurn / longest_turn(direction));
  for (int halving = 0; halving <= kHalvings; ++halving, rate *= 0.5) {
    lanes_.kernel().move(whole(), x_.data() + lanes_.halo(), direction.data(), static_cast<float>(rate),
                         static_cast<float>(kLongestTurn), next_.data() + lanes_.halo());
    lanes_.fill_halo(next_);
    Step step{.offset = offset_ + rate * offset_direction.array()};
    step.value = evaluate_at(next_, step.offset, there_, step.offset_gradient);
    if (step.value.objective < value_.objective) return step;
  }
  return std::nullopt;
}

// Moves to next_, remembering the step; false where its curvature is of no use.
bool LaneLbfgs::take(const Step& step) {
  const int slot = memory_.next_slot();
  lanes_.kernel().step(whole(), x_.data() + lanes_.halo(), next_.data() + lanes_.halo(), here_.data(), there_.data(),
                       vectors_[slot].data(), vectors_[slot + 1].data());
  offsets_[slot] = offset_scale_ * (step.offset - offset_).matrix();
  offsets_[slot + 1] = step.offset_gradient - offsets_[LbfgsMemory::kGradient];
  offsets_[LbfgsMemory::kGradient] = step.offset_gradient;
  std::swap(here_, there_);
  std::swap(x_, next_);
  offset_ = step.offset;
  value_ = step.value;
  multiply(slot);
  return memory_.keep();
}

void LaneLbfgs::descend(const PairWeights& weights, int iterations, PairSolution& solution) {
  weights_ = weights;
  memory_.forget();
  value_ = evaluate_at(x_, offset_, here_, offsets_[LbfgsMemory::kGradient]);
  multiply(0);  // of the gradient with itself
  Rows direction = lanes_.make_rows();
  int small = 0;
  for (int i = 0; i < iterations && small < 3; ++i) {
    solution.terms.push_back(value_.terms);
    solution.total.push_back(value_.objective);
    Eigen::Vector3d offset_direction;
    if (choose_direction(direction, offset_direction) >= 0.0) {
      memory_.forget();
      choose_direction(direction, offset_direction);
    }
    const std::optional<Step> step = search(direction, offset_direction);
    if (!step && memory_.pairs() == 0) break;
    const double before = value_.objective;
    if (!step || !take(*step)) memory_.forget();
    if (step) small = before - value_.objective < options_.lbfgs_tolerance * before ? small + 1 : 0;
  }
}

PairSolution LaneLbfgs::solve() {
  PairSolution solution;
  const PairWeights last = weights_;
  const int imitation = imitation_iterations(options_);
  if (imitation > 0) descend(pair_iteration(options_, 0).weights, imitation, solution);
  descend(last, options_.lbfgs_iterations - imitation, solution);
  solution.terms.push_back(value_.terms);
  solution.total.push_back(value_.objective);
  solution.x = lanes_.variables(x_, offset_);
  return solution;
}

}  // namespace

PairSolution solve_by_lane_lbfgs(const PairProblem& problem, const PairOptions& options, KernelKind kernel) {
  PairSolution solution = LaneLbfgs(problem, options, kernel).solve();
  solution.kernel = kernel;
  return solution;
}

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
