#include "duet/training/dstar/torch/units.h"

#include <algorithm>

namespace duet {
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

Units::Units(const WindowStatistics& statistics, const LanguageEncoder& encoder)
    : frame_mean_(vector_tensor(statistics.frame_mean)),
      frame_deviation_(vector_tensor(statistics.frame_deviation)),
      mean_(vector_tensor(statistics.plan_mean).view({kAnchors, kAnchorSize})),
      deviation_(vector_tensor(statistics.plan_deviation).view({kAnchors, kAnchorSize})) {
  for (const Task task : kPaperTasks) {
    std::vector<std::vector<float>> rows = {encoder.embed(task_prompt(task))};
    for (const std::string_view text : task_paraphrases(task)) rows.push_back(encoder.embed(text));
    prompts_.push_back(std::move(rows));
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
    const std::vector<float>& row = prompts_[batch.task[i]][batch.prompt[i] + 1];
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

}  // namespace duet
