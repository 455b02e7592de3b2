#include "duet/controllers/wbc_sim/wbc_sim.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string_view>

#include "duet/core/field.h"
#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/core/share.h"
#include "duet/nn/mlp.h"

namespace duet {
namespace {

class WbcSim final : public Controller {
 public:
  WbcSim(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const WbcNetwork> network)
      : robot_(std::move(robot)),
        network_(std::move(network)),
        policy_(*network_),
        tracker_(robot_, network_->gait),
        observer_(network_->kind, robot_->dof()) {
    action_.setZero(robot_->dof());
  }

  [[nodiscard]] std::string_view name() const override { return "wbc_sim"; }

  void reset(const RobotState&) override {
    action_.setZero();
    observer_.reset();
    started_ = false;
  }

  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    if (started_)
      tracker_.update(state, reference);
    else
      tracker_.reset(reference);
    read_sensors(state, tracker_, sensors_);
    started_ = true;
    action_ = policy_.act(observer_.update(sensors_, action_));
    fill(command);
  }

 private:
  void fill(JointCommand& command) const {
    command.q_target.resize(robot_->dof());
    for (int i = 0; i < robot_->dof(); ++i)
      command.q_target[i] = std::clamp(tracker_.q()[i] + network_->action_scale[i] * static_cast<double>(action_[i]),
                                       robot_->joints[i].lower, robot_->joints[i].upper);
    command.kp = network_->kp;
    command.kd = network_->kd;
    command.tau_ff.setZero(robot_->dof());
  }

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const WbcNetwork> network_;  // shared: many episodes run one network
  WbcPolicy policy_;
  WbcTracker tracker_;
  WbcObserver observer_;
  WbcSensors sensors_;
  Eigen::VectorXf action_;
  bool started_ = false;
};

constexpr std::string_view kShipped[] = {"braced", "student", "braced_oracle", "oracle"};

struct WbcSimOptions {
  std::string network = "braced";
};

const FieldTable<WbcSimOptions>& wbc_sim_options() {
  static const FieldTable<WbcSimOptions> table = {field<WbcSimOptions>(
      {.name = "network",
       .meaning =
           "braced (learnt with pushes, steps out of them), student (the one before, which did not), braced_oracle or "
           "oracle (which see the base velocity), or the path of a network"},
      &WbcSimOptions::network)};
  return table;
}

}  // namespace

std::unique_ptr<Controller> make_wbc_sim_controller(std::shared_ptr<const RobotModel> robot,
                                                    std::shared_ptr<const WbcNetwork> network) {
  require(network->joints == robot->joint_names(), "wbc_sim: the network was made for other joints than the robot's");
  return std::make_unique<WbcSim>(std::move(robot), std::move(network));
}

std::string wbc_sim_network_path(const ControllerOptions& options) {
  std::string network = read_options("controller", "wbc_sim", wbc_sim_options(), options).network;
  if (std::ranges::find(kShipped, network) == std::end(kShipped)) return network;
  return share_file("network of WBC-Sim", "controllers/wbc_sim/" + network + ".safetensors");
}

ControllerInfo wbc_sim_info() {
  return {"wbc_sim",
          "WBC-Sim of the supplement, trained by `duet train wbc`: stands, steps and tracks the whole reference", "g1",
          true, option_list<ControllerOption>(wbc_sim_options())};
}

namespace {

constexpr const char* kFormat = "duet.wbc-network/1";
// How an output becomes a target: part of what a network is, so that one made for another rule is refused.
constexpr const char* kAction = "target = base + scale * clip(action, 4); base: legs of the gait, upper body of u_t";
constexpr const char* kRate = "50";
static_assert(kTickRate == 50.0);

std::string name_of(WbcKind kind) { return kind == WbcKind::kOracle ? "oracle" : "student"; }

nlohmann::json channels_of(WbcKind kind, int joints) {
  nlohmann::json json = nlohmann::json::array();
  for (const LayoutEntry& channel : WbcLayout(joints).channels(kind))
    json.push_back({{"name", channel.name}, {"size", channel.size}});
  return json;
}

// Any input does, as long as each of its numbers matters: about one deviation to either side of the mean.
Eigen::VectorXf golden_input(const WbcNetwork& network) {
  Eigen::VectorXf input = network.mean;
  for (Eigen::Index i = 0; i < input.size(); ++i)
    input[i] += network.deviation[i] * std::sin(0.7F * static_cast<float>(i) + 0.1F);
  return input;
}

// In full precision whatever the weights are in: the golden pair has to be.
template <typename Vector>
Tensor tensor_of(const Vector& values) {
  Tensor tensor{.shape = {values.size()}, .values = {}, .type = TensorType::kF32};
  for (const auto value : values) tensor.values.push_back(static_cast<float>(value));
  return tensor;
}

void round_to_half(Mlp& mlp) {
  const auto rounded = [](float value) { return static_cast<float>(Eigen::half(value)); };
  for (MlpLayer& layer : mlp.layers) {
    layer.W = layer.W.unaryExpr(rounded).eval();
    layer.b = layer.b.unaryExpr(rounded).eval();
  }
}

// Reading, with every message in one form.
class NetworkReader {
 public:
  NetworkReader(const SafeTensors& tensors, const std::string& file) : tensors_(tensors), file_(file) {}

  [[nodiscard]] std::string text(const std::string& key) const {
    const auto found = tensors_.metadata.find(key);
    if (found == tensors_.metadata.end())
      throw InputError(fmt::format("{}: no '{}' in the header: not a network of WBC-Sim", file_, key));
    return found->second;
  }
  void expect(const std::string& what, const std::string& expected, const std::string& found) const {
    if (expected != found)
      throw InputError(fmt::format("{}: {} is '{}', expected '{}'", file_, what, excerpt(found), expected));
  }
  [[nodiscard]] Eigen::VectorXf vector(const std::string& name, Eigen::Index size) const {
    const auto found = tensors_.tensors.find(name);
    if (found == tensors_.tensors.end()) throw InputError(fmt::format("{}: no tensor '{}'", file_, name));
    const std::vector<float>& values = found->second.values;
    if (static_cast<Eigen::Index>(values.size()) != size)
      throw InputError(fmt::format("{}: tensor '{}' has {} values, expected {}", file_, name, values.size(), size));
    Eigen::VectorXf vector = Eigen::Map<const Eigen::VectorXf>(values.data(), size);
    if (!vector.allFinite())
      throw InputError(fmt::format("{}: tensor '{}' has values that are not finite", file_, name));
    return vector;
  }

 private:
  const SafeTensors& tensors_;
  const std::string& file_;
};

nlohmann::json parse_list(const NetworkReader& reader, const std::string& key, const std::string& file) {
  nlohmann::json json = parse_json(reader.text(key), fmt::format("{}: '{}' in the header", file, key));
  if (!json.is_array()) throw InputError(fmt::format("{}: '{}' in the header is not a list", file, key));
  return json;
}

void check_joints(const NetworkReader& reader, const RobotModel& robot, const std::string& file) {
  const nlohmann::json joints = parse_list(reader, "joints", file);
  if (joints.size() != robot.joints.size())
    throw InputError(
        fmt::format("{}: made for {} joints, robot '{}' has {}", file, joints.size(), robot.name, robot.dof()));
  for (int i = 0; i < robot.dof(); ++i) {
    const std::string found = joints[i].is_string() ? joints[i].get<std::string>() : dumped(joints[i]);
    reader.expect(fmt::format("joint {}", i), robot.joints[i].name, found);
  }
}

void check_channels(const NetworkReader& reader, WbcKind kind, int joints, const std::string& file) {
  const nlohmann::json found = parse_list(reader, "observation", file), expected = channels_of(kind, joints);
  for (size_t i = 0; i < std::max(found.size(), expected.size()); ++i)
    reader.expect(fmt::format("observation channel {}", i), i < expected.size() ? dumped(expected[i]) : "nothing",
                  i < found.size() ? dumped(found[i]) : "nothing");
}

void check_golden(const NetworkReader& reader, const WbcNetwork& network, const std::string& file) {
  const Eigen::VectorXf input = reader.vector("golden.input", network.mean.size());
  const Eigen::VectorXf output = reader.vector("golden.output", network.mlp.outputs());
  WbcPolicy policy(network);
  const double error = (policy.act({input.data(), static_cast<size_t>(input.size())}) - output).cwiseAbs().maxCoeff();
  if (!(error <= kGoldenError))
    throw InputError(
        fmt::format("{}: the golden output is missed by {:.2g}, expected at most {:g}: weights and output "
                    "are not of one network",
                    file, error, kGoldenError));
}

struct GaitNumber {
  const char* name;
  double GaitOptions::*value;
  double low = 0.0, high = 10.0;
};
constexpr GaitNumber kGaitNumbers[] = {
    {"frequency", &GaitOptions::frequency, 0.1, 5.0}, {"swing_height", &GaitOptions::swing_height},
    {"max_speed", &GaitOptions::max_speed},           {"max_turn", &GaitOptions::max_turn},
    {"still_speed", &GaitOptions::still_speed},       {"still_turn", &GaitOptions::still_turn},
    {"start_distance", &GaitOptions::start_distance}, {"start_angle", &GaitOptions::start_angle},
    {"lead_time", &GaitOptions::lead_time},           {"capture_time", &GaitOptions::capture_time}};

std::string text_of(const GaitOptions& gait) {
  nlohmann::json json;
  for (const GaitNumber& number : kGaitNumbers) json[number.name] = gait.*number.value;
  return dumped(json);
}

// Networks of before there was a choice do not say.
GaitOptions read_gait(const SafeTensors& tensors, const std::string& file) {
  GaitOptions gait;
  const auto found = tensors.metadata.find("gait");
  if (found == tensors.metadata.end()) return gait;
  const nlohmann::json json = parse_json(found->second, fmt::format("{}: 'gait' in the header", file));
  for (const GaitNumber& number : kGaitNumbers) {
    if (!json.is_object() || !json.contains(number.name) || !json[number.name].is_number())
      throw InputError(fmt::format("{}: 'gait' in the header has no number '{}'", file, number.name));
    const auto value = json[number.name].get<double>();
    if (!(value >= number.low && value <= number.high))
      throw InputError(fmt::format("{}: '{}' of the gait is {}, expected a number from {} to {}", file, number.name,
                                   value, number.low, number.high));
    gait.*number.value = value;
  }
  return gait;
}

long whole_number(const NetworkReader& reader, const std::string& key, const std::string& file) {
  const std::string text = reader.text(key);
  try {
    return std::stol(text);
  } catch (const std::exception&) {
    throw InputError(fmt::format("{}: '{}' in the header is '{}', expected a whole number", file, key, excerpt(text)));
  }
}

}  // namespace

WbcPolicy::WbcPolicy(const WbcNetwork& network)
    : network_(network),
      runner_(network.mlp),
      inverse_deviation_(network.deviation.cwiseInverse()),
      input_(network.mean.size()),
      action_(network.mlp.outputs()) {}

const Eigen::VectorXf& WbcPolicy::act(std::span<const float> observation) {
  input_ = ((Eigen::Map<const Eigen::ArrayXf>(observation.data(), input_.size()) - network_.mean.array()) *
            inverse_deviation_.array())
               .cwiseMax(-kNormalClip)
               .cwiseMin(kNormalClip);
  const std::span<const float> output = runner_.run({input_.data(), static_cast<size_t>(input_.size())});
  const auto bound = static_cast<float>(kActionBound);
  // Written so that what is not a number stays so.
  for (Eigen::Index i = 0; i < action_.size(); ++i)
    action_[i] = output[i] > bound ? bound : (output[i] < -bound ? -bound : output[i]);
  return action_;
}

void save_wbc_network(const std::string& path, const WbcNetwork& network, TensorType type) {
  require(network.mlp.inputs() == WbcLayout(network.mlp.outputs()).size(network.kind) &&
              network.mean.size() == network.mlp.inputs() && network.deviation.size() == network.mlp.inputs(),
          "save_wbc_network: {} inputs and a normaliser of {} for {} joints", network.mlp.inputs(), network.mean.size(),
          network.mlp.outputs());
  SafeTensors tensors;
  add_mlp(tensors, "mlp", network.mlp);
  tensors.tensors["input.mean"] = tensor_of(network.mean);
  tensors.tensors["input.deviation"] = tensor_of(network.deviation);
  tensors.tensors["action.scale"] = tensor_of(network.action_scale);
  tensors.tensors["joint.neutral"] = tensor_of(network.neutral);
  tensors.tensors["joint.kp"] = tensor_of(network.kp);
  tensors.tensors["joint.kd"] = tensor_of(network.kd);
  tensors.metadata = {{"format", kFormat},
                      {"kind", name_of(network.kind)},
                      {"robot", network.robot},
                      {"joints", dumped(nlohmann::json(network.joints))},
                      {"observation", dumped(channels_of(network.kind, network.mlp.outputs()))},
                      {"rate_hz", kRate},
                      {"action", kAction},
                      {"gait", text_of(network.gait)},
                      {"seed", std::to_string(network.seed)},
                      {"steps", std::to_string(network.steps)},
                      {"note", network.note}};
  const Eigen::VectorXf input = golden_input(network);
  WbcNetwork stored = network;
  if (type == TensorType::kF16) round_to_half(stored.mlp);
  WbcPolicy policy(stored);
  tensors.tensors["golden.input"] = tensor_of(input);
  tensors.tensors["golden.output"] = tensor_of(policy.act({input.data(), static_cast<size_t>(input.size())}));
  write_safetensors(path, tensors, type);
}

bool is_wbc_network(const SafeTensors& tensors) {
  const auto format = tensors.metadata.find("format");
  return format != tensors.metadata.end() && format->second == kFormat;
}

WbcNetwork load_wbc_network(const std::string& path, const RobotModel& robot) {
  const SafeTensors tensors = read_safetensors(path);
  const NetworkReader reader(tensors, path);
  reader.expect("the format", kFormat, reader.text("format"));
  WbcNetwork network;
  const std::string kind = reader.text("kind");
  if (kind != "oracle" && kind != "student")
    throw InputError(fmt::format("{}: kind is '{}', expected 'oracle' or 'student'", path, excerpt(kind)));
  network.kind = kind == "oracle" ? WbcKind::kOracle : WbcKind::kStudent;
  require_made_for(reader.text("robot"), robot, path);
  check_joints(reader, robot, path);
  check_channels(reader, network.kind, robot.dof(), path);
  reader.expect("the rate_hz", kRate, reader.text("rate_hz"));
  reader.expect("the action", kAction, reader.text("action"));
  network.robot = robot.name;
  network.joints = robot.joint_names();
  network.mlp = read_mlp(tensors, "mlp", path);
  const int inputs = WbcLayout(robot.dof()).size(network.kind);
  if (network.mlp.inputs() != inputs || network.mlp.outputs() != robot.dof())
    throw InputError(fmt::format("{}: a network of {} inputs and {} outputs, expected {} and {}", path,
                                 network.mlp.inputs(), network.mlp.outputs(), inputs, robot.dof()));
  network.mean = reader.vector("input.mean", inputs);
  network.deviation = reader.vector("input.deviation", inputs);
  if ((network.deviation.array() <= 0.0F).any())
    throw InputError(fmt::format("{}: tensor 'input.deviation' has values that are not positive", path));
  network.action_scale = reader.vector("action.scale", robot.dof()).cast<double>();
  network.neutral = reader.vector("joint.neutral", robot.dof()).cast<double>();
  network.kp = reader.vector("joint.kp", robot.dof()).cast<double>();
  network.kd = reader.vector("joint.kd", robot.dof()).cast<double>();
  network.gait = read_gait(tensors, path);
  network.seed = static_cast<std::uint64_t>(whole_number(reader, "seed", path));
  network.steps = whole_number(reader, "steps", path);
  network.note = reader.text("note");
  check_golden(reader, network, path);
  return network;
}

}  // namespace duet
