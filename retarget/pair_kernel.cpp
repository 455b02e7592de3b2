#include "retarget/pair_kernel.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "retarget/kernel_types.h"

namespace duet {

namespace {

using pair_kernel::kHalo;
using pair_kernel::kHumanRows;
using pair_kernel::kLanes;
using pair_kernel::Row;
using Kernel = void (*)(const pair_kernel::Sweep&);

constexpr int kChunk = 64;  // blocks per call: lane sums in float stay short, their total is in double

Kernel kernel_function(KernelKind kind) {
  switch (kind) {
    case KernelKind::kV4:
      return pair_kernel::sweep_v4;
    case KernelKind::kV3:
      return pair_kernel::sweep_v3;
    default:
      return pair_kernel::sweep_v2;
  }
}

void copy3(const Eigen::Vector3d& from, float* to) {
  for (int r = 0; r < 3; ++r) to[r] = static_cast<float>(from[r]);
}

pair_kernel::Joint pack_joint(const ChainJoint& joint) {
  pair_kernel::Joint out{};
  out.parent = joint.parent;
  out.axis = joint.axis;
  out.turned = joint.turned;
  copy3(joint.offset, out.offset);
  for (int i = 0; i < 9; ++i) out.rotation[i] = static_cast<float>(joint.rotation(i / 3, i % 3));
  return out;
}

pair_kernel::Setup pack_setup(const PairProblem& problem, const PairOptions& options) {
  const PairChain& chain = problem.chain;
  pair_kernel::Setup setup{};
  setup.dof = chain.dof();
  setup.points = static_cast<int>(chain.points.size());
  setup.keys = chain.keys();
  setup.mean_norm = options.kin_loss == KinLoss::kMeanNorm;
  setup.adapt_human = options.adapt_human;
  setup.per_frame_translation = options.root_translation == RootTranslation::kPerFrame;
  setup.rows = setup.dof + 3 + (setup.adapt_human ? kHumanRows : 0) + (setup.per_frame_translation ? 3 : 0);
  for (int j = 0; j < setup.dof; ++j) {
    setup.joints[j] = pack_joint(chain.joints[j]);
    setup.lower[j] = static_cast<float>(chain.joints[j].lower);
    setup.upper[j] = static_cast<float>(chain.joints[j].upper);
  }
  for (int k = 0; k < setup.points; ++k) {
    setup.point[k].link = chain.points[k].link;
    copy3(chain.points[k].offset, setup.point[k].offset);
  }
  std::copy(chain.pair_points.begin(), chain.pair_points.end(), setup.pair_point);
  std::copy(chain.key_points.begin(), chain.key_points.end(), setup.key_point);
  std::copy(problem.human_offset.begin(), problem.human_offset.end(), setup.human_offset);
  return setup;
}

// A problem in blocks and the state of its optimisation.
class LaneSolver {
 public:
  LaneSolver(const PairProblem& problem, const PairOptions& options, KernelKind kernel)
      : options_(options),
        kernel_(kernel_function(kernel)),
        setup_(pack_setup(problem, options)),
        frames_(problem.frames()),
        blocks_((frames_ + kLanes - 1) / kLanes),
        constant_rows_(pair_kernel::kHuman + 3 * setup_.keys + static_cast<int>(problem.distances.rows())) {
    constants_.resize(static_cast<std::size_t>(blocks_) * constant_rows_);
    x_.resize(static_cast<std::size_t>(blocks_ + 2 * kHalo) * setup_.rows);
    next_ = x_;
    mean_.resize(static_cast<std::size_t>(blocks_) * setup_.rows);
    square_ = mean_;
    for (int block = 0; block < blocks_; ++block) {
      for (int lane = 0; lane < kLanes; ++lane) pack_frame(problem, block, lane);
    }
  }

  PairTerms iterate(const PairIteration& iteration);
  [[nodiscard]] PairVariables variables() const;

 private:
  void pack_frame(const PairProblem& problem, int block, int lane);
  [[nodiscard]] pair_kernel::Step make_step(const PairIteration& iteration) const;
  std::array<double, pair_kernel::kSums> sweep(const pair_kernel::Step& step);
  [[nodiscard]] PairTerms terms(const std::array<double, pair_kernel::kSums>& sums, const PairWeights& weights) const;
  void move_offset(const PairIteration& iteration, const Eigen::Vector3d& gradient);
  void fill_halo();

  const PairOptions& options_;
  Kernel kernel_;
  pair_kernel::Setup setup_;
  int frames_;
  int blocks_;
  int constant_rows_;
  std::vector<Row> constants_, x_, next_, mean_, square_;
  Eigen::Array3d offset_ = Eigen::Array3d::Zero();
  Eigen::Array3d offset_mean_ = Eigen::Array3d::Zero();
  Eigen::Array3d offset_square_ = Eigen::Array3d::Zero();
};

// Padding frames repeat the last frame with weight zero: finite, and without influence.
void LaneSolver::pack_frame(const PairProblem& problem, int block, int lane) {
  Row* rows = &constants_[static_cast<std::size_t>(block) * constant_rows_];
  const int t = lane * blocks_ + block;
  const int source = std::min(t, frames_ - 1);
  const auto set = [&](int row, double value) { rows[row].lane[lane] = static_cast<float>(value); };
  const auto edge = [&](int from) { return from >= 0 && from + 1 < frames_ ? 1.0 : 0.0; };
  const auto bend = [&](int middle) { return middle >= 1 && middle + 1 < frames_ ? 1.0 : 0.0; };
  const bool inside = t < frames_;
  set(pair_kernel::kWeight, inside ? 1.0 : 0.0);
  set(pair_kernel::kEdgeBefore, inside ? edge(t - 1) : 0.0);
  set(pair_kernel::kEdgeAfter, edge(t));
  set(pair_kernel::kBendBefore, inside ? bend(t - 1) : 0.0);
  set(pair_kernel::kBend, bend(t));
  set(pair_kernel::kBendAfter, bend(t + 1));
  set(pair_kernel::kCosYaw, std::cos(problem.yaw[source]));
  set(pair_kernel::kSinYaw, std::sin(problem.yaw[source]));
  const Eigen::Matrix3Xd targets = problem.targets.frame(source).colwise() - problem.root.col(source);
  for (int i = 0; i < 3 * kRetargetPairs; ++i) set(pair_kernel::kTarget + i, targets.data()[i]);
  const Eigen::Matrix3Xd human = problem.human.frame(source).colwise() - problem.root.col(source);
  for (int i = 0; i < 3 * setup_.keys; ++i) set(pair_kernel::kHuman + i, human.data()[i]);
  const int first = pair_kernel::kHuman + 3 * setup_.keys;
  for (int i = 0; i < problem.distances.rows(); ++i) set(first + i, problem.distances(i, source));
}

// The kernel's gradient is that of T times the objective: of the size of one frame's, whatever the length.
pair_kernel::Step LaneSolver::make_step(const PairIteration& iteration) const {
  const PairWeights& w = iteration.weights;
  const ContactFactors contact = contact_factors(options_, setup_.keys);
  const double frames = frames_;
  pair_kernel::Step step{};
  step.kin = static_cast<float>(setup_.mean_norm ? w.kin / kRetargetPairs : 2.0 * w.kin);
  step.con_robot = static_cast<float>(4.0 * w.con * contact.all * contact.robot);
  step.con_cross = static_cast<float>(4.0 * w.con * contact.all * contact.cross);
  step.con_human = static_cast<float>(4.0 * w.con * contact.all * contact.human);
  step.hum = static_cast<float>(2.0 * w.hum);
  step.pose = static_cast<float>(2.0 * w.pose / setup_.dof);
  step.velocity = static_cast<float>(2.0 * w.temp * frames / (frames - 1.0));
  step.acceleration = static_cast<float>(2.0 * w.temp * w.acceleration * frames / (frames - 2.0));
  step.rate = static_cast<float>(iteration.rate / (1.0 - std::pow(0.9, iteration.adam_step)));
  step.square = static_cast<float>(1.0 / std::sqrt(1.0 - std::pow(0.999, iteration.adam_step)));
  step.epsilon = static_cast<float>(iteration.epsilon * frames);
  for (int r = 0; r < 3; ++r) step.offset[r] = static_cast<float>(offset_[r]);
  return step;
}

std::array<double, pair_kernel::kSums> LaneSolver::sweep(const pair_kernel::Step& step) {
  std::array<double, pair_kernel::kSums> total{};
  const std::size_t halo = static_cast<std::size_t>(kHalo) * setup_.rows;
  for (int begin = 0; begin < blocks_; begin += kChunk) {
    std::array<Row, pair_kernel::kSums> sums{};
    kernel_({.setup = &setup_,
             .step = &step,
             .constants = constants_.data(),
             .constant_rows = static_cast<std::size_t>(constant_rows_),
             .x = x_.data() + halo,
             .next = next_.data() + halo,
             .mean = mean_.data(),
             .square = square_.data(),
             .rows = static_cast<std::size_t>(setup_.rows),
             .begin = begin,
             .end = std::min(begin + kChunk, blocks_),
             .sums = sums.data()});
    // A fixed order: the result does not depend on the width of the kernel.
    for (int i = 0; i < pair_kernel::kSums; ++i) {
      for (const float value : sums[i].lane) total[i] += value;
    }
  }
  return total;
}

PairTerms LaneSolver::terms(const std::array<double, pair_kernel::kSums>& sums, const PairWeights& weights) const {
  const ContactFactors contact = contact_factors(options_, setup_.keys);
  const double frames = frames_;
  PairTerms out;
  out.kin = sums[pair_kernel::kKin] / (setup_.mean_norm ? kRetargetPairs * frames : frames);
  out.con = 2.0 * contact.all / frames *
            (contact.robot * sums[pair_kernel::kConRobot] + contact.cross * sums[pair_kernel::kConCross] +
             contact.human * sums[pair_kernel::kConHuman]);
  out.hum = sums[pair_kernel::kHum] / frames;
  out.temp = sums[pair_kernel::kVelocity] / (frames - 1.0) +
             weights.acceleration * sums[pair_kernel::kAcceleration] / (frames - 2.0);
  out.pose = sums[pair_kernel::kPose] / (frames * setup_.dof);
  return out;
}

void LaneSolver::move_offset(const PairIteration& iteration, const Eigen::Vector3d& gradient) {
  if (options_.root_translation != RootTranslation::kConstantOffset) return;
  offset_mean_ = 0.9 * offset_mean_ + 0.1 * gradient.array();
  offset_square_ = 0.999 * offset_square_ + 0.001 * gradient.array().square();
  const double k = iteration.adam_step;
  const Eigen::Array3d root = (offset_square_ / (1.0 - std::pow(0.999, k))).sqrt();
  offset_ -= iteration.rate / (1.0 - std::pow(0.9, k)) * offset_mean_ / (root + iteration.epsilon);
}

// Block b < 0 or b >= blocks holds the neighbours in time of the first and last blocks: the same rows of another
// block, shifted by whole lanes. Lanes without a neighbour get zero; their weights are zero too.
void LaneSolver::fill_halo() {
  for (const int b : {-2, -1, blocks_, blocks_ + 1}) {
    const int shift = b < 0 ? -((-b + blocks_ - 1) / blocks_) : b / blocks_;
    const int source = b - shift * blocks_;
    const Row* from = &x_[static_cast<std::size_t>(source + kHalo) * setup_.rows];
    Row* to = &x_[static_cast<std::size_t>(b + kHalo) * setup_.rows];
    for (int j = 0; j < setup_.dof; ++j) {
      to[j] = Row{};
      const std::span<const float> lanes(from[j].lane);
      if (shift < 0) {
        std::copy(lanes.begin(), lanes.end() + shift, to[j].lane - shift);
      } else {
        std::copy(lanes.begin() + shift, lanes.end(), to[j].lane);
      }
    }
  }
}

PairTerms LaneSolver::iterate(const PairIteration& iteration) {
  if (iteration.reset) {
    std::fill(mean_.begin(), mean_.end(), Row{});
    std::fill(square_.begin(), square_.end(), Row{});
    offset_mean_.setZero();
    offset_square_.setZero();
  }
  const auto sums = sweep(make_step(iteration));
  std::swap(x_, next_);
  fill_halo();
  const Eigen::Vector3d force(sums[pair_kernel::kForce], sums[pair_kernel::kForce + 1], sums[pair_kernel::kForce + 2]);
  move_offset(iteration, force / frames_);
  return terms(sums, iteration.weights);
}

PairVariables LaneSolver::variables() const {
  PairVariables out = PairVariables::zero(setup_.dof, frames_);
  const int first_translation = setup_.dof + 3 + kHumanRows;
  for (int t = 0; t < frames_; ++t) {
    const Row* rows = &x_[static_cast<std::size_t>(t % blocks_ + kHalo) * setup_.rows];
    const int lane = t / blocks_;
    for (int i = 0; i < setup_.rows; ++i) {
      const bool translation = setup_.per_frame_translation && i >= setup_.rows - 3;
      out.frames(translation ? first_translation + i - (setup_.rows - 3) : i, t) = rows[i].lane[lane];
    }
  }
  out.offset = offset_;
  return out;
}

}  // namespace

bool kernel_runs_here(KernelKind kernel) {
  switch (kernel) {
    case KernelKind::kV4:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
             __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl") && kernel_runs_here(KernelKind::kV3);
    case KernelKind::kV3:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
             __builtin_cpu_supports("bmi2");
    default:
      return true;
  }
}

bool kernel_fits(const PairProblem& problem) {
  return problem.chain.dof() <= pair_kernel::kMaxJoints && problem.chain.points.size() <= pair_kernel::kMaxPoints &&
         problem.chain.keys() <= pair_kernel::kMaxKeys;
}

PairSolution solve_in_lanes(const PairProblem& problem, const PairOptions& options, KernelKind kernel) {
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
