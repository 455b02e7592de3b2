// Whether the program runs what the trainer validated.
#include <algorithm>
#include <cmath>

#include "duet/training/dstar/torch/blas.h"
#include "duet/training/dstar/torch/model.h"
#include "duet/training/dstar/trainer.h"

namespace duet {

double runner_difference(const DstarData& data, const DstarRun& run, const std::string& file, int windows) {
  const torch::NoGradGuard guard;
  one_thread_each();
  const std::shared_ptr<const DstarNetwork> network = load_dstar_network(file, *data.robot);
  Weights weights;
  for (const auto& [name, tensor] : network->weights)
    weights[name] = torch::from_blob(const_cast<float*>(tensor.values.data()), tensor.shape).clone();
  const Units units({network->frame_mean, network->frame_deviation, network->plan_mean, network->plan_deviation},
                    *data.language, network->notes.contains(kBegins));
  WindowOptions options = windows_of(run);
  options.augment = false;
  WindowMaker maker(data.robot, *data.validation, options);
  const std::vector<Window> all = list_windows(*data.validation, options);
  Random random(run.seed, stream_key({"dstar golden"}));
  WindowBatch batch;
  batch.resize(windows);
  draw_windows(maker, all, random, batch);
  const torch::Tensor noise = normal_noise({windows, kAnchors, kAnchorSize}, random);
  const ModelInput input = units.input(batch);
  const torch::Tensor plan =
      sample(network->config, weights, noise, encode(network->config, weights, input).condition).contiguous();
  DstarRunner runner(network);
  double worst = 0.0;
  for (int i = 0; i < windows; ++i) {
    const DstarFeatures features = features_of(batch, i);
    const auto row = [&](const torch::Tensor& t) { return t.data_ptr<float>() + t.numel() / windows * i; };
    const auto language = static_cast<std::size_t>(input.language.size(1));
    runner.run({&features, {row(input.language), language}, {row(noise), kPlanSize}});
    for (int k = 0; k < kPlanSize; ++k)
      worst = std::max(worst, std::abs(static_cast<double>(runner.normalised_plan()[k]) - row(plan)[k]));
  }
  return worst;
}

}  // namespace duet
