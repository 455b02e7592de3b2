// float by design: the way the peer is used (and measured) elsewhere.
#include <malloc.h>
#include <torch/torch.h>

#include <ctime>

#include "duet/core/require.h"
#include "duet/retarget/solver/pair_solver.h"

namespace duet {
namespace {

using torch::indexing::None;
using torch::indexing::Slice;

torch::Tensor to_tensor(const double* data, at::IntArrayRef shape) {
  const auto options = torch::TensorOptions().dtype(torch::kFloat64);
  // from_blob only reads here: the copy to float is made at once.
  return torch::from_blob(const_cast<double*>(data), shape, options).to(torch::kFloat32).clone();
}

torch::Tensor to_tensor(const Eigen::Matrix3d& m) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = m;
  return to_tensor(rows.data(), {3, 3});
}

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

torch::Tensor rotation_of(const torch::Tensor& w) {
  const auto square = (w * w).sum(-1, true) + 1e-8;
  const auto angle = square.sqrt();
  const auto a = (angle.sin() / angle).unsqueeze(-1);
  const auto b = ((1 - angle.cos()) / square).unsqueeze(-1);
  const auto x = w.select(1, 0);
  const auto y = w.select(1, 1);
  const auto z = w.select(1, 2);
  const auto zero = torch::zeros_like(x);
  const auto K = torch::stack({zero, -z, y, z, zero, -x, -y, x, zero}, 1).view({-1, 3, 3});
  return torch::eye(3) + a * K + b * torch::matmul(K, K);
}

torch::Tensor distances(const torch::Tensor& points) {
  const auto d = points.unsqueeze(2) - points.unsqueeze(1);
  return ((d * d).sum(-1) + kDistanceGuard).sqrt();
}

class Peer {
 public:
  explicit Peer(const PairProblem& problem) : chain_(problem.chain), frames_(problem.frames()) {
    const long T = frames_;
    const long keys = chain_.keys();
    targets_ = to_tensor(problem.targets.data().data(), {T, kRetargetPairs, 3});
    human_ = to_tensor(problem.human.data().data(), {T, keys, 3});
    root_ = to_tensor(problem.root.data(), {T, 3});
    heading_ = rotation_of(torch::cat({torch::zeros({T, 2}), to_tensor(problem.yaw.data(), {T, 1})}, 1));
    set_distances(problem);
    set_chain();
    move_ = torch::zeros({keys, kHumanOffsets});
    for (int k = 0; k < keys; ++k) {
      if (problem.human_offset[k] >= 0) move_[k][problem.human_offset[k]] = 1;
    }
    const auto variable = torch::TensorOptions().requires_grad(true);
    q_ = torch::zeros({T, chain_.dof()}, variable);
    w_ = torch::zeros({T, 3}, variable);
    human_offset_ = torch::zeros({T, kHumanOffsets, 3}, variable);
    offset_ = torch::zeros({1, 3}, variable);
  }

  std::vector<double> run(const PairOptions& options, int iterations) {
    torch::optim::Adam adam({q_, w_, human_offset_, offset_}, torch::optim::AdamOptions(options.schedule.stage1_rate));
    std::vector<double> totals;
    for (int i = 0; i < iterations; ++i) {
      const PairIteration iteration = pair_iteration(options, i);
      for (auto& group : adam.param_groups()) {
        static_cast<torch::optim::AdamOptions&>(group.options()).lr(iteration.rate);
      }
      adam.zero_grad();
      const torch::Tensor loss = objective(iteration.weights);
      loss.backward();
      adam.step();
      const torch::NoGradGuard no_gradient;
      q_.copy_(torch::max(torch::min(q_, upper_), lower_));
      totals.push_back(loss.item<double>());
    }
    return totals;
  }

 private:
  void set_distances(const PairProblem& problem) {
    const int points = 2 * chain_.keys();
    std::vector<double> full(static_cast<std::size_t>(frames_) * points * points, 0.0);
    for (int t = 0; t < frames_; ++t) {
      Eigen::Index row = 0;
      double* matrix = &full[static_cast<std::size_t>(t) * points * points];
      for (int i = 0; i < points; ++i) {
        for (int j = i + 1; j < points; ++j, ++row) {
          matrix[i * points + j] = matrix[j * points + i] = problem.distances(row, t);
        }
      }
    }
    original_ = to_tensor(full.data(), {frames_, points, points});
  }

  void set_chain() {
    std::vector<torch::Tensor> skews;
    std::vector<double> lower;
    std::vector<double> upper;
    for (const ChainJoint& joint : chain_.joints) {
      rotations_.push_back(to_tensor(joint.rotation));
      offsets_.push_back(to_tensor(joint.offset.data(), {3}));
      skews.push_back(to_tensor(skew(Eigen::Vector3d::Unit(joint.axis))));
      lower.push_back(joint.lower);
      upper.push_back(joint.upper);
    }
    axes_ = torch::stack(skews);
    axes_squared_ = torch::matmul(axes_, axes_);
    lower_ = to_tensor(lower.data(), {chain_.dof()});
    upper_ = to_tensor(upper.data(), {chain_.dof()});
    std::vector<torch::Tensor> points;
    for (const ChainPoint& point : chain_.points) points.push_back(to_tensor(point.offset.data(), {3}));
    points_ = torch::stack(points).unsqueeze(-1);
    const auto index = [](const std::vector<int>& v) { return torch::tensor(v).to(torch::kInt64); };
    pair_points_ = index(chain_.pair_points);
    key_points_ = index(chain_.key_points);
  }

  [[nodiscard]] torch::Tensor robot_points() const {
    const auto s = q_.sin().unsqueeze(-1).unsqueeze(-1);
    const auto c = (1 - q_.cos()).unsqueeze(-1).unsqueeze(-1);
    const auto hinges = torch::eye(3) + s * axes_ + c * axes_squared_;
    std::vector<torch::Tensor> R = {torch::matmul(rotation_of(w_), heading_)};
    std::vector<torch::Tensor> p = {root_ + offset_};
    for (int j = 0; j < chain_.dof(); ++j) {
      const ChainJoint& joint = chain_.joints[j];
      auto turn = hinges.select(1, j);
      if (joint.turned) turn = torch::matmul(rotations_[j], turn);
      p.push_back(p[joint.parent] + torch::matmul(R[joint.parent], offsets_[j]));
      R.push_back(torch::matmul(R[joint.parent], turn));
    }
    std::vector<torch::Tensor> link_R;
    std::vector<torch::Tensor> link_p;
    for (const ChainPoint& point : chain_.points) {
      link_R.push_back(R[point.link]);
      link_p.push_back(p[point.link]);
    }
    return torch::stack(link_p, 1) + torch::matmul(torch::stack(link_R, 1), points_).squeeze(-1);
  }

  [[nodiscard]] torch::Tensor objective(const PairWeights& weights) const {
    const double T = frames_;
    const auto points = robot_points();
    const auto error = points.index_select(1, pair_points_) - targets_;
    const auto keys =
        torch::cat({points.index_select(1, key_points_), human_ + torch::matmul(move_, human_offset_)}, 1);
    const auto change = distances(keys) - original_;
    const auto v = q_.index({Slice(1, None)}) - q_.index({Slice(None, -1)});
    const auto a = v.index({Slice(1, None)}) - v.index({Slice(None, -1)});
    const auto temporal = (v * v).sum() / (T - 1) + weights.acceleration * (a * a).sum() / (T - 2);
    return weights.kin * (error * error).sum() / T + weights.con * (change * change).sum() / T +
           weights.hum * (human_offset_ * human_offset_).sum() / T + weights.temp * temporal +
           weights.pose * (q_ * q_).mean();
  }

  const PairChain& chain_;
  int frames_;
  torch::Tensor targets_, human_, root_, heading_, original_, axes_, axes_squared_, lower_, upper_, points_,
      pair_points_, key_points_, move_;
  std::vector<torch::Tensor> rotations_, offsets_;
  torch::Tensor q_, w_, human_offset_, offset_;
};

double thread_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void use_one_thread() {
  if (at::get_num_threads() != 1) at::set_num_threads(1);
}

}  // namespace

bool libtorch_available() { return true; }

double libtorch_frames_per_second(const InteractionClip& clip, const RobotModel& robot, int iterations) {
  require(iterations > 0, "libtorch_frames_per_second: expected at least one iteration");
  use_one_thread();
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  PairOptions options;
  options.weights.object = 0.0;  // the peer knows two people
  InteractionClip resampled = clip;
  resampled.a = resample(clip.a, 50.0);
  resampled.b = resample(clip.b, 50.0);
  const PairProblem problem = make_pair_problem(resampled, robot, options);
  Peer(problem).run(options, 2);  // warms the allocator
  Peer peer(problem);
  const double begin = thread_seconds();
  peer.run(options, iterations);
  const double per_iteration = (thread_seconds() - begin) / iterations;
  return problem.frames() / (per_iteration * pair_iterations(options));
}

std::vector<double> libtorch_objective(const PairProblem& problem, int iterations) {
  require(problem.object.count() == 0 && !problem.chain.weighted(),
          "libtorch_objective: expected two people without an object or weights of keypoints");
  use_one_thread();
  return Peer(problem).run({}, iterations);
}

}  // namespace duet
