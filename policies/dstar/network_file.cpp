// Networks of D-STAR in files. docs/file-formats.md describes them.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "duet/core/json.h"
#include "duet/core/random.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/policies/dstar/network.h"
#include "duet/policies/dstar/tensors.h"

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
    if (expected != found) refuse(fmt::format("{}: expected '{}', found '{}'", what, expected, shown(found)));
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

}  // namespace duet
