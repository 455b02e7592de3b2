#include "duet/training/dstar/torch/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/numbers.h"

namespace duet {
namespace {

using torch::Tensor;

const Tensor& weight(const Weights& weights, const std::string& name) { return weights.at(name); }

Tensor linear(const Weights& weights, const std::string& name, const Tensor& x) {
  return torch::linear(x, weight(weights, name + ".weight"), weight(weights, name + ".bias"));
}

Tensor layer_norm(const Weights& weights, const std::string& name, const Tensor& x) {
  return torch::layer_norm(x, {x.size(-1)}, weight(weights, name + ".weight"), weight(weights, name + ".bias"), 1e-5);
}

Tensor group_norm(const Weights& weights, const std::string& name, const Tensor& x, int groups) {
  return torch::group_norm(x, groups, weight(weights, name + ".weight"), weight(weights, name + ".bias"), 1e-5);
}

// x (B, T, D) -> (B, T, D): heads are contiguous parts of D.
Tensor attention(const Weights& weights, const std::string& qkv_name, const std::string& out_name, const Tensor& x,
                 int heads) {
  const auto B = x.size(0), T = x.size(1), D = x.size(2);
  const Tensor qkv = linear(weights, qkv_name, x).view({B, T, 3, heads, D / heads}).permute({2, 0, 3, 1, 4});
  const Tensor scores = torch::matmul(qkv[0], qkv[1].transpose(-1, -2)) / std::sqrt(static_cast<double>(D) / heads);
  const Tensor mixed = torch::matmul(torch::softmax(scores, -1), qkv[2]);
  return linear(weights, out_name, mixed.transpose(1, 2).reshape({B, T, D}));
}

Tensor stream(const DstarConfig& config, const Weights& weights, const std::string& name, const Tensor& frames) {
  Tensor x = linear(weights, name + ".in", frames) + weight(weights, name + ".position");
  for (int layer = 0; layer < config.layers; ++layer) {
    const std::string at = fmt::format("{}.{}", name, layer);
    x = x + attention(weights, at + ".qkv", at + ".out", layer_norm(weights, at + ".norm1", x), config.heads);
    const Tensor inner = torch::gelu(linear(weights, at + ".up", layer_norm(weights, at + ".norm2", x)));
    x = x + linear(weights, at + ".down", inner);
  }
  return linear(weights, name + ".head", layer_norm(weights, name + ".norm", x.select(1, x.size(1) - 1)));
}

Tensor temporal(const DstarConfig& config, const Weights& weights, const ModelInput& input) {
  const auto last = [](const Tensor& frames, int count) { return frames.slice(1, frames.size(1) - count); };
  Tensor both = stream(config, weights, "long", last(input.past, config.long_frames));
  if (config.short_stream)
    both = torch::cat({both, stream(config, weights, "short", last(input.frames, config.short_frames))}, 1);
  return linear(weights, "temporal", both);
}

Tensor phase_logits(const Weights& weights, const Tensor& f_temp) {
  return linear(weights, "phase.classify2", torch::silu(linear(weights, "phase.classify1", f_temp)));
}

Tensor phase_attention(const DstarConfig& config, const Weights& weights, const Tensor& f_temp, const Tensor& logits) {
  const Tensor p = torch::softmax(logits, 1);
  const auto B = f_temp.size(0);
  const int width = config.temporal / config.tokens;
  Tensor sum;
  for (int i = 0; i < kPhases; ++i) {
    const Tensor qkv = linear(weights, fmt::format("phase.expert.{}", i), f_temp).view({B, 3, config.tokens, width});
    const Tensor q = qkv.select(1, 0), k = qkv.select(1, 1), v = qkv.select(1, 2);
    const Tensor scores = torch::matmul(q, k.transpose(-1, -2)) / std::sqrt(static_cast<double>(width));
    const Tensor expert = torch::matmul(torch::softmax(scores, -1), v).reshape({B, config.temporal});
    const Tensor share = p.slice(1, i, i + 1) * expert;
    sum = i == 0 ? share : sum + share;
  }
  return linear(weights, "phase.out", sum);
}

Tensor zone_encoding(const Weights& weights, const Tensor& distance) {
  const Tensor d = distance.unsqueeze(-1);
  const std::vector<Tensor> inside = {(d < 0.3), (d >= 0.3) * (d < 0.8), (d >= 0.8)};
  Tensor sum;
  for (int zone = 0; zone < kZones; ++zone) {
    const std::string at = fmt::format("spatial.zone.{}", zone);
    const Tensor e = linear(weights, at + ".2", torch::silu(linear(weights, at + ".1", d))) * inside[zone];
    sum = zone == 0 ? e : sum + e;
  }
  return sum.flatten(1);
}

Tensor spatial_reasoning(const DstarConfig& config, const Weights& weights, const ModelInput& input,
                         const Tensor& f_temp) {
  const Tensor orientation = torch::silu(linear(weights, "spatial.orientation", input.orientation));
  const Tensor f_spatial = torch::cat({input.position, zone_encoding(weights, input.distance), orientation}, 1);
  const Tensor f_field = linear(weights, "spatial.field2", torch::silu(linear(weights, "spatial.field1", f_spatial)));
  const Tensor tokens = torch::stack({f_field, linear(weights, "spatial.temporal", f_temp)}, 1);
  const Tensor fused =
      tokens + attention(weights, "spatial.fusion.qkv", "spatial.fusion.out", tokens, config.fusion_heads);
  return linear(weights, "spatial.out", fused.flatten(1));
}

Tensor step_embedding(const DstarConfig& config, const Weights& weights, const Tensor& step) {
  const int half = config.step_embedding / 2;
  const Tensor frequency =
      torch::exp(-std::log(10000.0) / half * torch::arange(half, step.options().dtype(torch::kFloat32)));
  const Tensor angle = step.to(torch::kFloat32).unsqueeze(1) * frequency;
  const Tensor waves = torch::cat({torch::sin(angle), torch::cos(angle)}, 1);
  return linear(weights, "step.2", torch::silu(linear(weights, "step.1", waves)));
}

Tensor convolution(const Weights& weights, const std::string& name, const Tensor& x) {
  return torch::conv1d(x, weight(weights, name + ".weight"), weight(weights, name + ".bias"), 1, 1);
}

}  // namespace

torch::Tensor classify(const DstarConfig& config, const Weights& weights, const ModelInput& input) {
  return phase_logits(weights, temporal(config, weights, input));
}

ModelCondition encode(const DstarConfig& config, const Weights& weights, const ModelInput& input) {
  ModelCondition result;
  const torch::Tensor f_temp = temporal(config, weights, input);
  std::vector<torch::Tensor> parts = {f_temp};
  if (config.phase_attention) {
    result.phase_logits = phase_logits(weights, f_temp);
    parts.push_back(phase_attention(config, weights, f_temp, result.phase_logits));
  }
  if (config.spatial_reasoning) parts.push_back(spatial_reasoning(config, weights, input, f_temp));
  if (config.language_on) parts.push_back(input.language);
  result.condition = linear(weights, "condition.2", torch::silu(linear(weights, "condition.1", torch::cat(parts, 1))));
  return result;
}

torch::Tensor denoise(const DstarConfig& config, const Weights& weights, const torch::Tensor& x,
                      const torch::Tensor& step, const torch::Tensor& condition) {
  const torch::Tensor embedded = step_embedding(config, weights, step);
  torch::Tensor h = (linear(weights, "denoise.in", x) + weight(weights, "denoise.position")).transpose(1, 2);
  for (int block = 0; block < config.blocks; ++block) {
    const std::string at = fmt::format("denoise.{}", block);
    torch::Tensor y = group_norm(weights, at + ".norm1", h, config.groups);
    y = group_norm(weights, at + ".norm2", convolution(weights, at + ".conv1", torch::silu(y)), config.groups);
    const torch::Tensor film = (linear(weights, at + ".film_condition", condition) +
                                torch::linear(embedded, weight(weights, at + ".film_step.weight")))
                                   .unsqueeze(-1);
    y = y * (1.0 + film.slice(1, 0, config.channels)) + film.slice(1, config.channels);
    h = h + convolution(weights, at + ".conv2", torch::silu(y));
  }
  const torch::Tensor out = torch::silu(group_norm(weights, "denoise.norm", h, config.groups)).transpose(1, 2);
  return linear(weights, "denoise.out", out);
}

torch::Tensor sample(const DstarConfig& config, const Weights& weights, const torch::Tensor& noise,
                     const torch::Tensor& condition) {
  const std::vector<double> alpha_bar = squared_cosine_alpha_bar(config.training_steps);
  const std::vector<int> steps = ddim_steps(config.training_steps, config.inference_steps);
  torch::Tensor x = noise;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const torch::Tensor step = torch::full({x.size(0)}, steps[i], x.options().dtype(torch::kInt64));
    const torch::Tensor x0 = denoise(config, weights, x, step, condition).clamp(-5.0, 5.0);
    const double now = alpha_bar[steps[i]], next = i + 1 < steps.size() ? alpha_bar[steps[i + 1]] : 1.0;
    const torch::Tensor eps = (x - std::sqrt(now) * x0) / std::sqrt(1.0 - now);
    x = std::sqrt(next) * x0 + std::sqrt(1.0 - next) * eps;
  }
  return x;
}

namespace {

constexpr float kInputClip = 10.0F;

torch::Tensor vector_tensor(const Eigen::VectorXf& v) {
  return torch::from_blob(const_cast<float*>(v.data()), {v.size()}).clone();
}

}  // namespace

torch::Tensor view(Eigen::MatrixXf& matrix, at::IntArrayRef shape) { return torch::from_blob(matrix.data(), shape); }

torch::Tensor normal_noise(at::IntArrayRef shape, Random& random) {
  torch::Tensor noise = torch::empty(shape);
  auto* out = noise.data_ptr<float>();
  std::generate(out, out + noise.numel(), [&] { return static_cast<float>(random.normal()); });
  return noise;
}

Units::Units(const WindowStatistics& statistics, const LanguageEncoder& encoder, bool leads)
    : frame_mean_(vector_tensor(statistics.frame_mean)),
      frame_deviation_(vector_tensor(statistics.frame_deviation)),
      mean_(vector_tensor(statistics.plan_mean).view({kAnchors, kAnchorSize})),
      deviation_(vector_tensor(statistics.plan_deviation).view({kAnchors, kAnchorSize})) {
  for (const Task task : kPaperTasks) {
    std::vector<std::vector<float>>& rows = prompts_.emplace_back();
    for (const std::string& command : commands_of(task, leads)) rows.push_back(encoder.embed(command));
  }
}

torch::Tensor Units::frames(Eigen::MatrixXf& raw) const {
  const torch::Tensor frames = view(raw, {raw.cols(), kHistoryFrames, kFrameSize});
  return ((frames - frame_mean_) / frame_deviation_).clamp(-kInputClip, kInputClip);
}

torch::Tensor Units::language(const WindowBatch& batch) const {
  const auto size = static_cast<std::int64_t>(prompts_[0][0].size());
  torch::Tensor rows = torch::empty({batch.size, size});
  for (int i = 0; i < batch.size; ++i) {
    const std::vector<float>& row = prompts_[batch.task[i]][batch.prompt[i]];
    std::copy(row.begin(), row.end(), rows.data_ptr<float>() + size * i);
  }
  return rows;
}

ModelInput Units::input(WindowBatch& batch) const {
  return {frames(batch.frames),
          frames(batch.past),
          view(batch.position, {batch.size, kPositionSize}),
          view(batch.distance, {batch.size, kRelations}),
          view(batch.orientation, {batch.size, kOrientationSize}),
          language(batch)};
}

namespace {

constexpr double kPositionBound = 0.05, kBranchShare = 0.3;

double bound_of(const TensorShape& shape) {
  if (shape.name.ends_with("position")) return kPositionBound;
  const double inputs = static_cast<double>(WeightBlock::count(shape)) / static_cast<double>(shape.shape[0]);
  const bool last = shape.name.ends_with("conv2.weight") || shape.name.ends_with("film_condition.weight") ||
                    shape.name.ends_with("film_step.weight");
  return (last ? kBranchShare : 1.0) * std::sqrt(1.5 / inputs);
}

}  // namespace

WeightBlock::WeightBlock(const DstarConfig& config) : shapes_(dstar_tensors(config)) {
  std::size_t size = 0;
  for (const TensorShape& shape : shapes_) size += count(shape);
  values_.assign(size, 0.0F);
}

std::size_t WeightBlock::count(const TensorShape& shape) {
  std::size_t n = 1;
  for (const std::int64_t d : shape.shape) n *= static_cast<std::size_t>(d);
  return n;
}

Weights WeightBlock::views(bool learn) {
  Weights weights;
  float* at = values_.data();
  for (const TensorShape& shape : shapes_) {
    torch::Tensor view = torch::from_blob(at, shape.shape, torch::kFloat32);
    weights[shape.name] = learn ? view.requires_grad_(true) : view;
    at += count(shape);
  }
  return weights;
}

std::map<std::string, duet::Tensor> WeightBlock::tensors() const {
  std::map<std::string, duet::Tensor> result;
  const float* at = values_.data();
  for (const TensorShape& shape : shapes_) {
    result[shape.name] = {shape.shape, {at, at + count(shape)}};
    at += count(shape);
  }
  return result;
}

void WeightBlock::assign(const std::map<std::string, duet::Tensor>& tensors) {
  float* at = values_.data();
  for (const TensorShape& shape : shapes_) at = std::ranges::copy(tensors.at(shape.name).values, at).out;
}

void WeightBlock::initialise(std::uint64_t seed) {
  Random random(seed, stream_key({"dstar weights"}));
  float* at = values_.data();
  for (const TensorShape& shape : shapes_) {
    float* const end = at + count(shape);
    if (shape.name.ends_with(".bias")) {
      std::fill(at, end, 0.0F);
    } else if (shape.name.find("norm") != std::string::npos) {
      std::fill(at, end, 1.0F);
    } else {
      const double bound = bound_of(shape);
      std::generate(at, end, [&] { return static_cast<float>(random.uniform(-bound, bound)); });
    }
    at = end;
  }
}

}  // namespace duet
