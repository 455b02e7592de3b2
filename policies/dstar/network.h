// D-STAR (supplement A.2, F) as a file and as arithmetic: a safetensors file with named tensors, the configuration,
// channel and joint names, normalisers and a golden pair; evaluated at batch 1 on nn's dense kernels, no libtorch.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/nn/safetensors.h"
#include "duet/policies/dstar/features.h"

namespace duet {

// The note of a network that learnt to begin where the command ends in "first".
inline constexpr const char* kBegins = "begins";
inline constexpr double kPlanGoldenError = 1e-4;  // of a normalised plan at load

// Everything a file holds. Tensor names and shapes: docs/file-formats.md; weights are (out, in), row-major.
struct DstarNetwork {
  DstarConfig config;
  std::string robot;                  // name of the card
  std::vector<std::string> joints;    // order of every joint vector
  std::vector<std::string> channels;  // channel_names
  std::map<std::string, Tensor> weights;
  Eigen::VectorXf frame_mean, frame_deviation;  // 149: input' = (input - mean) / deviation, clipped to +-10
  Eigen::VectorXf plan_mean, plan_deviation;    // 180
  std::string language;                         // which encoder its embeddings are of ("duet-text-1")
  std::map<std::string, std::string> notes;     // seed, windows, epochs, data, split digest: for people; kBegins
};

// The input and the output of one evaluation, in the network's own units.
struct DstarInput {
  const DstarFeatures* features = nullptr;
  std::span<const float> language;  // config.language numbers
  std::span<const float> noise;     // kPlanSize standard normal numbers: x_T
};

// Evaluates a network again and again; keeps a share of it. No allocation after construction. One owner.
class DstarRunner {
 public:
  explicit DstarRunner(std::shared_ptr<const DstarNetwork> network);
  ~DstarRunner();
  // The plan in the units of encode_plan (denormalised). Valid until the next call.
  std::span<const float> run(const DstarInput& input);
  [[nodiscard]] std::span<const float> phases() const;  // probabilities of the last run; empty without phase attention
  [[nodiscard]] std::span<const float> normalised_plan() const;  // of the last run, before denormalisation

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

// Throws InputError (file, what, expected, found): not a D-STAR network, a robot of another name, joints or channels of
// other names or order, a missing, superfluous or misshapen tensor, a number that is not finite, a golden plan missed
// by more than kPlanGoldenError.
std::shared_ptr<const DstarNetwork> load_dstar_network(const std::string& path, const RobotModel& robot);
// With a golden pair made by evaluating it on seeded random features. Throws std::runtime_error where the file cannot
// be written, std::invalid_argument for tensors that do not fit the configuration.
void save_dstar_network(const std::string& path, const DstarNetwork& network, TensorType type);

// Names and shapes of all tensors of a configuration, in a fixed order: what a trainer fills and a reader expects.
struct TensorShape {
  std::string name;
  std::vector<std::int64_t> shape;
};
std::vector<TensorShape> dstar_tensors(const DstarConfig& config);

// F: squared-cosine schedule, shared with the trainer. alpha_bar[t] for t in [0, steps); the steps of DDIM inference,
// falling.
std::vector<double> squared_cosine_alpha_bar(int steps);
std::vector<int> ddim_steps(int training_steps, int inference_steps);

// Whether a network is one: private to policies/dstar/.

// The first thing that is wrong with its configuration, names, normalisers or tensors ("tensor 'x': expected shape (3),
// found (4)"); "" where it can be evaluated.
std::string network_problem(const DstarNetwork& network);

std::string shape_words(const std::vector<std::int64_t>& shape);

// A network of random weights: for tests and benchmarks, and what a trainer starts from.

// Weights normal with deviation 1 / sqrt(inputs), scales of norms about 1, biases and positions about 0; normalisers
// about one. Made for `robot` and the built-in language. Throws std::invalid_argument for a configuration that is
// refused by parse_dstar_config.
DstarNetwork random_dstar_network(const DstarConfig& config, const RobotModel& robot, std::uint64_t seed);

}  // namespace duet
