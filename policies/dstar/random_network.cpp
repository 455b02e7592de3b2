#include "duet/policies/dstar/random_network.h"

#include <cmath>

#include "duet/core/random.h"
#include "duet/core/require.h"
#include "duet/policies/language.h"

namespace duet {
namespace {

float small(Random& random) { return static_cast<float>(0.1 * random.normal()); }

Tensor random_tensor(const TensorShape& described, Random& random) {
  Tensor tensor{.shape = described.shape, .values = {}};
  std::int64_t count = 1, inputs = 1;
  for (std::size_t i = 0; i < tensor.shape.size(); ++i) {
    count *= tensor.shape[i];
    if (i > 0) inputs *= tensor.shape[i];
  }
  const bool weight = described.name.ends_with(".weight");
  const bool norm = weight && tensor.shape.size() == 1;
  const double deviation = weight && !norm ? 1.0 / std::sqrt(static_cast<double>(inputs)) : 0.1;
  tensor.values.reserve(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i)
    tensor.values.push_back(static_cast<float>((norm ? 1.0 : 0.0) + deviation * random.normal()));
  return tensor;
}

void fill_normaliser(Eigen::VectorXf& mean, Eigen::VectorXf& deviation, int size, Random& random) {
  mean.resize(size);
  deviation.resize(size);
  for (float& value : mean) value = small(random);
  for (float& value : deviation) value = std::exp(small(random));
}

}  // namespace

DstarNetwork random_dstar_network(const DstarConfig& config, const RobotModel& robot, std::uint64_t seed) {
  const std::string problem = config_problem(config);
  require(problem.empty(), "random_dstar_network: {}", problem);
  DstarNetwork network{.config = config,
                       .robot = robot.name,
                       .joints = robot.joint_names(),
                       .channels = channel_names(robot),
                       .weights = {},
                       .frame_mean = {},
                       .frame_deviation = {},
                       .plan_mean = {},
                       .plan_deviation = {},
                       .language = std::string(kBuiltInLanguage),
                       .notes = {{"seed", std::to_string(seed)}, {"training", "none: random weights"}}};
  Random random(seed, stream_key({"dstar", "weights"}));
  for (const TensorShape& shape : dstar_tensors(config)) network.weights[shape.name] = random_tensor(shape, random);
  fill_normaliser(network.frame_mean, network.frame_deviation, kFrameSize, random);
  fill_normaliser(network.plan_mean, network.plan_deviation, kPlanSize, random);
  return network;
}

}  // namespace duet
