// Networks of D-STAR in files. docs/file-formats.md describes them.
#include "duet/policies/dstar/network.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "duet/core/json.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/policies/language.h"

namespace duet {
namespace {

constexpr const char* kFormat = "duet.dstar-network/1";
constexpr const char* kGoldenPlan = "golden.plan";
constexpr const char* kGoldenRest = "golden.plan_rest";  // what F16 leaves of the plan; only in such files
constexpr std::uint64_t kGoldenSeed = 20240605;

struct Golden {
  DstarFeatures features;
  std::vector<float> language;
  std::vector<float> noise = std::vector<float>(kPlanSize);
};

// The golden inputs that a configuration looks at: f(name, shape, values).
template <typename F>
void for_each_input(const DstarConfig& config, Golden& golden, const F& f) {
  using Values = std::span<float>;
  DstarFeatures& features = golden.features;
  const auto values = [](auto& matrix) { return Values(matrix.data(), static_cast<std::size_t>(matrix.size())); };
  f("golden.frames", {kHistoryFrames, kFrameSize}, values(features.frames));
  f("golden.past", {kHistoryFrames, kFrameSize}, values(features.past));
  if (config.spatial_reasoning) {
    f("golden.position", {kPositionSize}, values(features.position));
    f("golden.distance", {kRelations}, values(features.distance));
    f("golden.orientation", {kOrientationSize}, values(features.orientation));
  }
  golden.language.resize(config.language_on ? static_cast<std::size_t>(config.language) : 0);
  if (config.language_on) f("golden.language", {config.language}, Values(golden.language));
  f("golden.noise", {kAnchors, kAnchorSize}, Values(golden.noise));
}

Golden random_golden(const DstarNetwork& network) {
  Golden golden;
  Random random(kGoldenSeed, stream_key({"dstar", "golden"}));
  for_each_input(network.config, golden,
                 [&](const std::string&, const std::vector<std::int64_t>&, std::span<float> values) {
                   for (float& value : values) value = static_cast<float>(random.normal());
                 });
  DstarFeatures& features = golden.features;
  for (DstarFrames* frames : {&features.frames, &features.past})
    for (auto frame : frames->colwise())
      frame = network.frame_mean + network.frame_deviation.cwiseProduct(Eigen::VectorXf(frame));
  if (!network.config.spatial_reasoning) return golden;
  features.position = features.position.array().sin();
  features.orientation = features.orientation.array().sin();
  for (int i = 0; i < kRelations; ++i) features.distance[i] = 0.1F + 0.25F * static_cast<float>(i);  // every zone
  return golden;
}

std::vector<float> golden_plan(const std::shared_ptr<const DstarNetwork>& network, const Golden& golden) {
  DstarRunner runner(network);
  runner.run({.features = &golden.features, .language = golden.language, .noise = golden.noise});
  const std::span<const float> plan = runner.normalised_plan();
  return {plan.begin(), plan.end()};
}

// Reading, with every message in one form. Tensors are taken out: what is left at the end are weights.
class Reader {
 public:
  Reader(SafeTensors& content, const std::string& file) : content_(content), file_(file) {}

  [[noreturn]] void refuse(const std::string& problem) const {
    throw InputError(fmt::format("{}: {}", file_, problem));
  }
  [[nodiscard]] std::string text(const std::string& key) const {
    const auto found = content_.metadata.find(key);
    if (found == content_.metadata.end())
      refuse(fmt::format("expected '{}' in the header, found none: not a network of D-STAR", key));
    return found->second;
  }
  void expect(const std::string& what, const std::string& expected, const std::string& found) const {
    if (expected != found) refuse(fmt::format("{}: expected '{}', found '{}'", what, expected, excerpt(found)));
  }
  [[nodiscard]] std::vector<std::string> list(const std::string& key) const {
    const nlohmann::json json = parse_json(text(key), fmt::format("{}: '{}' in the header", file_, key));
    const bool texts =
        json.is_array() && std::ranges::all_of(json, [](const nlohmann::json& item) { return item.is_string(); });
    if (!texts) refuse(fmt::format("'{}' in the header: expected a JSON list of texts, found something else", key));
    return json.get<std::vector<std::string>>();
  }
  [[nodiscard]] std::map<std::string, std::string> notes() const {
    const nlohmann::json json = parse_json(text("notes"), fmt::format("{}: 'notes' in the header", file_));
    const bool texts =
        json.is_object() && std::ranges::all_of(json, [](const nlohmann::json& item) { return item.is_string(); });
    if (!texts) refuse("'notes' in the header: expected a JSON object of texts, found something else");
    return json.get<std::map<std::string, std::string>>();
  }
  std::vector<float> take(const std::string& name, const std::vector<std::int64_t>& shape) {
    const auto found = content_.tensors.find(name);
    if (found == content_.tensors.end()) refuse(fmt::format("expected a tensor '{}', found none", name));
    if (found->second.shape != shape)
      refuse(fmt::format("tensor '{}': expected shape {}, found {}", name, shape_words(shape),
                         shape_words(found->second.shape)));
    return std::move(content_.tensors.extract(found).mapped().values);
  }
  Eigen::VectorXf take_vector(const std::string& name, const std::vector<std::int64_t>& shape) {
    const std::vector<float> values = take(name, shape);
    return Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size()));
  }
  [[nodiscard]] bool has(const std::string& name) const { return content_.tensors.contains(name); }

 private:
  SafeTensors& content_;
  const std::string& file_;
};

void check_list(const Reader& reader, const std::string& what, const std::vector<std::string>& expected,
                const std::vector<std::string>& found) {
  for (std::size_t i = 0; i < std::max(expected.size(), found.size()); ++i)
    reader.expect(fmt::format("{} {}", what, i), i < expected.size() ? expected[i] : "nothing",
                  i < found.size() ? found[i] : "nothing");
}

struct NormaliserTensor {
  const char* name;
  Eigen::VectorXf DstarNetwork::*values;
  std::vector<std::int64_t> shape;
};

std::vector<NormaliserTensor> normaliser_tensors() {
  return {{"frame.mean", &DstarNetwork::frame_mean, {kFrameSize}},
          {"frame.deviation", &DstarNetwork::frame_deviation, {kFrameSize}},
          {"plan.mean", &DstarNetwork::plan_mean, {kAnchors, kAnchorSize}},
          {"plan.deviation", &DstarNetwork::plan_deviation, {kAnchors, kAnchorSize}}};
}

DstarNetwork read_header(const Reader& reader, const std::string& file) {
  reader.expect("the format", kFormat, reader.text("format"));
  DstarNetwork network;
  network.config = parse_dstar_config(reader.text("config"), file);
  network.robot = reader.text("robot");
  network.joints = reader.list("joints");
  network.channels = reader.list("channels");
  network.language = reader.text("language");
  network.notes = reader.notes();
  return network;
}

// A file's network and golden inputs; leaves nothing in `content` but the golden plan, where there is one.
std::shared_ptr<const DstarNetwork> read_network(SafeTensors& content, const std::string& file, Golden& golden) {
  Reader reader(content, file);
  DstarNetwork network = read_header(reader, file);
  for (const NormaliserTensor& tensor : normaliser_tensors())
    network.*tensor.values = reader.take_vector(tensor.name, tensor.shape);
  for_each_input(network.config, golden,
                 [&](const std::string& name, const std::vector<std::int64_t>& shape, std::span<float> values) {
                   std::ranges::copy(reader.take(name, shape), values.begin());
                 });
  for (auto tensor = content.tensors.begin(); tensor != content.tensors.end();) {
    const auto here = tensor++;
    if (here->first != kGoldenPlan && here->first != kGoldenRest) network.weights.insert(content.tensors.extract(here));
  }
  if (const std::string problem = network_problem(network); !problem.empty()) reader.refuse(problem);
  return std::make_shared<const DstarNetwork>(std::move(network));
}

void check_golden(SafeTensors& content, const std::string& file, const std::shared_ptr<const DstarNetwork>& network,
                  const Golden& golden) {
  const std::vector<std::int64_t> shape = {kAnchors, kAnchorSize};
  Reader reader(content, file);
  Eigen::VectorXf expected = reader.take_vector(kGoldenPlan, shape);
  if (reader.has(kGoldenRest)) expected += reader.take_vector(kGoldenRest, shape);
  const std::vector<float> plan = golden_plan(network, golden);
  const double error = (Eigen::Map<const Eigen::VectorXf>(plan.data(), kPlanSize) - expected).cwiseAbs().maxCoeff();
  if (!(error <= kPlanGoldenError))
    reader.refuse(
        fmt::format("the golden plan is missed by {:.2g}, expected at most {:g}: weights and plan are not of one "
                    "network",
                    error, kPlanGoldenError));
}

SafeTensors content_of(const DstarNetwork& network) {
  SafeTensors content;
  content.tensors = network.weights;
  for (const NormaliserTensor& tensor : normaliser_tensors()) {
    const Eigen::VectorXf& values = network.*tensor.values;
    content.tensors[tensor.name] = {tensor.shape, {values.data(), values.data() + values.size()}};
  }
  Golden golden = random_golden(network);
  for_each_input(network.config, golden,
                 [&](const std::string& name, std::vector<std::int64_t> shape, std::span<const float> values) {
                   content.tensors[name] = {std::move(shape), {values.begin(), values.end()}};
                 });
  content.metadata = {{"format", kFormat},
                      {"config", to_json_text(network.config)},
                      {"robot", network.robot},
                      {"joints", dumped(nlohmann::json(network.joints))},
                      {"channels", dumped(nlohmann::json(network.channels))},
                      {"language", network.language},
                      {"notes", dumped(nlohmann::json(network.notes))}};
  return content;
}

void add_golden_plan(SafeTensors& content, const std::vector<float>& plan, TensorType type) {
  const std::vector<std::int64_t> shape = {kAnchors, kAnchorSize};
  content.tensors[kGoldenPlan] = {shape, plan};
  if (type == TensorType::kF32) return;
  std::vector<float> rest(plan.size());
  for (std::size_t i = 0; i < plan.size(); ++i) rest[i] = plan[i] - static_cast<float>(Eigen::half(plan[i]));
  content.tensors[kGoldenRest] = {shape, rest};
}

}  // namespace

std::shared_ptr<const DstarNetwork> load_dstar_network(const std::string& path, const RobotModel& robot) {
  SafeTensors content = read_safetensors(path);
  Golden golden;
  std::shared_ptr<const DstarNetwork> network = read_network(content, path, golden);
  const Reader reader(content, path);
  require_made_for(network->robot, robot, path);
  check_list(reader, "joint", robot.joint_names(), network->joints);
  check_list(reader, "channel", channel_names(robot), network->channels);
  check_golden(content, path, network, golden);
  return network;
}

void save_dstar_network(const std::string& path, const DstarNetwork& network, TensorType type) {
  const std::string problem = network_problem(network);
  require(problem.empty(), "save_dstar_network: {}", problem);
  SafeTensors content = content_of(network);
  // The plan is of what the file holds, which F16 rounds.
  SafeTensors held = parse_safetensors(safetensors_bytes(content, type), path);
  Golden golden;
  const std::shared_ptr<const DstarNetwork> rounded = read_network(held, path, golden);
  add_golden_plan(content, golden_plan(rounded, golden), type);
  write_safetensors(path, content, type);
}

namespace {

// Collects names and shapes in the order of the network's own arithmetic.
class Shapes {
 public:
  void tensor(const std::string& name, std::vector<std::int64_t> shape) { list.push_back({name, std::move(shape)}); }
  void linear(const std::string& name, int inputs, int outputs) {
    tensor(name + ".weight", {outputs, inputs});
    tensor(name + ".bias", {outputs});
  }
  void norm(const std::string& name, int channels) {
    tensor(name + ".weight", {channels});
    tensor(name + ".bias", {channels});
  }
  void convolution(const std::string& name, int channels) {
    tensor(name + ".weight", {channels, channels, 3});
    tensor(name + ".bias", {channels});
  }
  std::vector<TensorShape> list;
};

void add_stream(Shapes& shapes, const DstarConfig& config, const std::string& name, int frames) {
  const int width = config.width;
  shapes.linear(name + ".in", kFrameSize, width);
  shapes.tensor(name + ".position", {frames, width});
  for (int l = 0; l < config.layers; ++l) {
    const std::string layer = fmt::format("{}.{}", name, l);
    shapes.norm(layer + ".norm1", width);
    shapes.linear(layer + ".qkv", width, 3 * width);
    shapes.linear(layer + ".out", width, width);
    shapes.norm(layer + ".norm2", width);
    shapes.linear(layer + ".up", width, config.feedforward);
    shapes.linear(layer + ".down", config.feedforward, width);
  }
  shapes.norm(name + ".norm", width);
  shapes.linear(name + ".head", width, config.stream);
}

void add_phase(Shapes& shapes, const DstarConfig& config) {
  shapes.linear("phase.classify1", config.temporal, config.phase_hidden);
  shapes.linear("phase.classify2", config.phase_hidden, kPhases);
  for (int i = 0; i < kPhases; ++i)
    shapes.linear(fmt::format("phase.expert.{}", i), config.temporal, 3 * config.temporal);
  shapes.linear("phase.out", config.temporal, config.phase);
}

void add_spatial(Shapes& shapes, const DstarConfig& config) {
  for (int z = 0; z < kZones; ++z) {
    shapes.linear(fmt::format("spatial.zone.{}.1", z), 1, config.zone);
    shapes.linear(fmt::format("spatial.zone.{}.2", z), config.zone, config.zone);
  }
  shapes.linear("spatial.orientation", kOrientationSize, config.orientation);
  shapes.linear("spatial.field1", kPositionSize + kRelations * config.zone + config.orientation, config.field_hidden);
  shapes.linear("spatial.field2", config.field_hidden, config.field);
  shapes.linear("spatial.temporal", config.temporal, config.field);
  shapes.linear("spatial.fusion.qkv", config.field, 3 * config.field);
  shapes.linear("spatial.fusion.out", config.field, config.field);
  shapes.linear("spatial.out", 2 * config.field, config.spatial);
}

void add_denoiser(Shapes& shapes, const DstarConfig& config) {
  const int channels = config.channels;
  shapes.linear("denoise.in", kAnchorSize, channels);
  shapes.tensor("denoise.position", {kAnchors, channels});
  for (int b = 0; b < config.blocks; ++b) {
    const std::string block = fmt::format("denoise.{}", b);
    shapes.norm(block + ".norm1", channels);
    shapes.convolution(block + ".conv1", channels);
    shapes.norm(block + ".norm2", channels);
    shapes.linear(block + ".film_condition", config.condition, 2 * channels);
    shapes.tensor(block + ".film_step.weight", {2 * channels, config.condition});
    shapes.convolution(block + ".conv2", channels);
  }
  shapes.norm("denoise.norm", channels);
  shapes.linear("denoise.out", channels, kAnchorSize);
}

std::string size_problem(const char* what, Eigen::Index expected, Eigen::Index found) {
  return expected == found ? "" : fmt::format("{}: expected {} values, found {}", what, expected, found);
}

std::string normaliser_problem(const char* name, const Eigen::VectorXf& mean, const Eigen::VectorXf& deviation,
                               Eigen::Index size) {
  if (mean.size() != size) return size_problem(fmt::format("mean of {}", name).c_str(), size, mean.size());
  if (deviation.size() != size)
    return size_problem(fmt::format("deviation of {}", name).c_str(), size, deviation.size());
  for (Eigen::Index i = 0; i < size; ++i)
    if (!(deviation[i] > 0.0F))
      return fmt::format("deviation of {}: expected positive numbers, found {} at {}", name, deviation[i], i);
  return mean.allFinite() && deviation.allFinite() ? "" : fmt::format("normaliser of {} is not finite", name);
}

std::string weights_problem(const DstarNetwork& network) {
  std::set<std::string> known;
  for (const TensorShape& expected : dstar_tensors(network.config)) {
    known.insert(expected.name);
    const auto found = network.weights.find(expected.name);
    if (found == network.weights.end()) return fmt::format("expected a tensor '{}', found none", expected.name);
    std::size_t count = 1;
    for (const std::int64_t size : expected.shape) count *= static_cast<std::size_t>(size);
    if (found->second.shape != expected.shape || found->second.values.size() != count)
      return fmt::format("tensor '{}': expected shape {}, found {} with {} values", expected.name,
                         shape_words(expected.shape), shape_words(found->second.shape), found->second.values.size());
  }
  for (const auto& [name, tensor] : network.weights)
    if (!known.contains(name)) return fmt::format("tensor '{}' is not one of this configuration", name);
  return "";
}

}  // namespace

std::vector<TensorShape> dstar_tensors(const DstarConfig& config) {
  Shapes shapes;
  add_stream(shapes, config, "long", config.long_frames);
  if (config.short_stream) add_stream(shapes, config, "short", config.short_frames);
  shapes.linear("temporal", config.stream * (config.short_stream ? 2 : 1), config.temporal);
  if (config.phase_attention) add_phase(shapes, config);
  if (config.spatial_reasoning) add_spatial(shapes, config);
  shapes.linear("condition.1", config.condition_inputs(), config.condition);
  shapes.linear("condition.2", config.condition, config.condition);
  shapes.linear("step.1", config.step_embedding, config.condition);
  shapes.linear("step.2", config.condition, config.condition);
  add_denoiser(shapes, config);
  return shapes.list;
}

std::string network_problem(const DstarNetwork& network) {
  constexpr int kJoints = kAnchorSize - 7;
  std::string problem = config_problem(network.config);
  if (problem.empty()) problem = size_problem("joints", kJoints, static_cast<Eigen::Index>(network.joints.size()));
  if (problem.empty())
    problem = size_problem("channels", kFrameSize, static_cast<Eigen::Index>(network.channels.size()));
  if (problem.empty()) problem = normaliser_problem("frames", network.frame_mean, network.frame_deviation, kFrameSize);
  if (problem.empty()) problem = normaliser_problem("plans", network.plan_mean, network.plan_deviation, kPlanSize);
  return problem.empty() ? weights_problem(network) : problem;
}

std::string shape_words(const std::vector<std::int64_t>& shape) { return fmt::format("({})", fmt::join(shape, ", ")); }

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
