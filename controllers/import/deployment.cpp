// YAML files of deployments: unitree_rl_lab's and mjlab's deploy.yaml, rl_sar's config.yaml, unitree_rl_gym's.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "duet/controllers/import/draft.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

constexpr int kMostJoints = 200;  // of a robot

class DeploymentReader {
 public:
  DeploymentReader(const YAML::Node& document, const std::string& file, const std::string& card,
                   const Metadata& metadata)
      : root_(document), file_(file), card_(card), metadata_(metadata) {}

  Draft read() {
    if (!root_.IsMap()) refuse("a mapping", describe(root_));
    if (root_["joint_ids_map"] && root_["actions"]) return isaac_lab();
    if (root_["kps"] && root_["num_obs"]) return rl_gym();
    if (root_.size() == 1 && root_.begin()->second.IsMap() && root_.begin()->second["rl_kp"]) return rl_sar();
    refuse("a deployment of unitree_rl_lab or mjlab ('joint_ids_map'), rl_sar ('rl_kp') or unitree_rl_gym ('kps')",
           "other keys");
  }

 private:
  [[noreturn]] void refuse(const std::string& expected, const std::string& found) const {
    throw InputError(fmt::format("'{}': expected {}, found {}", file_, expected, found));
  }
  // The numbers of a list, or of one for all.
  [[nodiscard]] std::vector<double> numbers(const YAML::Node& in, const char* key, std::size_t count) const {
    const YAML::Node node = in[key];
    if (!node || node.IsNull()) refuse(fmt::format("the key '{}'", key), "none");
    std::vector<double> values;
    if (node.IsScalar())
      values.assign(std::max<std::size_t>(count, 1), node.as<double>());
    else
      for (const YAML::Node& each : node) values.push_back(each.as<double>());
    if (count > 0 && values.size() != count)
      refuse(fmt::format("{} numbers in '{}'", count, key), fmt::format("{}", values.size()));
    if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); }))
      refuse(fmt::format("finite numbers in '{}'", key), "others");
    return values;
  }
  // Which motor each of the network's joints is.
  [[nodiscard]] std::vector<int> motors_of(const YAML::Node& in, const char* key) const {
    const std::vector<double> map = numbers(in, key, 0);
    if (map.empty()) refuse(fmt::format("numbers in '{}'", key), "none");
    std::vector<int> motors;
    motors.reserve(map.size());
    for (const double motor : map)
      motors.push_back(whole_number(motor, 0, static_cast<int>(map.size()) - 1, key, file_));
    return motors;
  }
  [[nodiscard]] double number_or(const YAML::Node& in, const char* key, double other) const {
    return in[key] && in[key].IsScalar() ? in[key].as<double>() : other;
  }

  // The robot's joints in the network's order: `map` says which of its motors each is.
  void set_joints(Draft& draft, const std::vector<int>& map, const std::vector<std::string>& names) {
    const YAML::Node model = root_["xml_path"];
    const DraftBody body =
        names.empty() ? body_of(map.size(), card_, file_, model && model.IsScalar() ? model.Scalar() : std::string())
                      : body_of(names, card_, file_);
    if (names.empty()) {
      draft.card = body.card;
      draft.assumed.push_back(
          fmt::format("the robot is '{}'{} and motors are numbered as its joints: the file does not name them",
                      body.card, card_.empty() ? " (--robot gives another)" : ""));
    }
    if (const std::vector<int>& arm = body.robot->roles.arms[0]; !arm.empty())
      trunk_ = body.robot->links[body.robot->links[arm.front() + 1].parent].name;
    for (const int motor : map) {
      DescriptorJoint joint;
      joint.name =
          names.empty() ? body.robot->joints[motor].name : body.robot->joints[joint_of(*body.robot, names[motor])].name;
      joint.action = 1.0;
      draft.joints.push_back(joint);
    }
  }
  static void set_gains(Draft& draft, const std::vector<double>& kp, const std::vector<double>& kd,
                        const std::vector<double>& pose, const std::vector<double>& scale) {
    for (std::size_t i = 0; i < draft.joints.size(); ++i) {
      draft.joints[i].kp = kp[i];
      draft.joints[i].kd = kd[i];
      draft.joints[i].neutral = pose[i];
      draft.joints[i].action = scale[i];
    }
  }
  // Numbers that are listed by motor, in the network's order.
  static std::vector<double> in_order(const std::vector<double>& by_motor, const std::vector<int>& map) {
    std::vector<double> numbers;
    numbers.reserve(map.size());
    for (const int motor : map) numbers.push_back(by_motor[motor]);
    return numbers;
  }
  [[nodiscard]] std::vector<std::string> metadata_joints() const {
    const auto names = metadata_.find("joint_names");
    return names == metadata_.end() ? std::vector<std::string>{} : metadata_words(names->second);
  }

  // A tracker's errors are of the body that the network names, or else of the one that carries the arms.
  void add_term(Draft& draft, const std::string& name, TermFacts facts) const {
    const auto said = metadata_.find("anchor_body_name");
    facts.anchor = said == metadata_.end() ? trunk_ : said->second;
    draft.terms.push_back(draft_term(name, facts, file_));
    if (said == metadata_.end() && name.find("anchor") != std::string::npos)
      draft.assumed.push_back(
          fmt::format("'{}' is of '{}', which carries the arms: the file does not say", name, trunk_));
  }

  // ---- unitree_rl_lab, mjlab

  Draft isaac_lab() {
    Draft draft{.kind = "IsaacLab or mjlab", .network = "policy.onnx", .starts_full = true};
    const std::vector<int> map = motors_of(root_, "joint_ids_map");
    std::vector<std::string> motors(map.size());  // names by motor, where the network's file has names
    if (const std::vector<std::string> names = metadata_joints(); names.size() == map.size())
      for (std::size_t i = 0; i < map.size(); ++i) motors[map[i]] = names[i];
    else
      motors.clear();
    set_joints(draft, map, motors);
    const YAML::Node action = root_["actions"]["JointPositionAction"];
    if (!action) refuse("'actions' of the kind JointPositionAction", "others");
    const std::size_t n = map.size();
    const std::vector<double> kp = numbers(root_, "stiffness", n), kd = numbers(root_, "damping", n),
                              pose = numbers(root_, "default_joint_pos", n), scale = numbers(action, "scale", n);
    const std::vector<double> offset =
        action["offset"] && !action["offset"].IsNull() ? numbers(action, "offset", n) : pose;
    set_gains(draft, in_order(kp, map), in_order(kd, map), pose, scale);
    for (std::size_t i = 0; i < n; ++i)
      if (std::abs(offset[i] - pose[i]) > 1e-6)
        refuse("an 'offset' of the action that is the default pose",
               fmt::format("{:g} for '{}', whose default is {:g}", offset[i], draft.joints[i].name, pose[i]));
    if (action["clip"] && !action["clip"].IsNull())
      draft.assumed.emplace_back("targets are not clipped: 'clip' of JointPositionAction is left out");
    draft.from["joints"] = fmt::format(
        "order: 'joint_ids_map'{}; kp: 'stiffness', kd: 'damping', by motor; default: "
        "'default_joint_pos'; action: 'scale' of JointPositionAction",
        motors.empty() ? "" : "; names: 'joint_names' of the network");
    draft.rate_hz = 1.0 / number_or(root_, "step_dt", 0.02);
    draft.from["rate_hz"] = "1 / 'step_dt'";
    read_isaac_terms(draft);
    read_ranges(draft);
    return draft;
  }

  void read_isaac_terms(Draft& draft) {
    const YAML::Node observations = root_["observations"];
    if (!observations || !observations.IsMap()) refuse("a mapping 'observations'", "none");
    draft.from["observation"] = "'observations'";
    for (const auto& entry : observations) {
      const std::string name = entry.first.Scalar();
      if (name == "use_gym_history") {
        draft.frame_major = entry.second.as<bool>(false);
        continue;
      }
      const YAML::Node term = entry.second;
      if (!term.IsMap()) refuse(fmt::format("a mapping for the term '{}'", name), describe(term));
      TermFacts facts;
      if (term["scale"] && !term["scale"].IsNull()) facts.scale = numbers(term, "scale", 0);
      if (const YAML::Node clip = term["clip"]; clip && clip.IsSequence() && clip.size() == 2)
        facts.clip = std::max(std::abs(clip[0].as<double>()), std::abs(clip[1].as<double>()));
      if (const YAML::Node params = term["params"]; params && params.IsMap() && params["period"])
        facts.clock = fmt::format("frequency_hz: {:.17g}, standing: zero, after_standing: runs_on",
                                  1.0 / params["period"].as<double>());
      add_term(draft, name, facts);
      draft.terms.back().frames =
          whole_number(number_or(term, "history_length", 1.0), 0, kMostFrames, "history_length", file_);
      draft.frames_seen |= draft.terms.back().frames > 1;
      draft.has_clock |= !facts.clock.empty();
    }
    if (draft.frames_seen)
      draft.assumed.emplace_back("a history begins with its first frame repeated, as in unitree_rl_lab's deployment");
  }

  void read_ranges(Draft& draft) {
    const YAML::Node commands = root_["commands"];
    const YAML::Node ranges =
        commands && commands.IsMap() && commands["base_velocity"] ? commands["base_velocity"]["ranges"] : YAML::Node();
    if (!ranges || !ranges.IsMap()) return;  // a tracker
    VelocityInterface command;
    const auto range = [&](const char* key) {
      const std::vector<double> bounds = numbers(ranges, key, 2);
      return CommandRange{bounds[0], bounds[1]};
    };
    command.forward = range("lin_vel_x");
    command.lateral = range("lin_vel_y");
    command.yaw = range("ang_vel_z");
    draft.from["command"] = "'commands.base_velocity.ranges'";
    if (draft.has_clock) {
      command.stands_below = StandBounds{.speed = 0.1, .yaw_rate = 0.1};
      draft.assumed.emplace_back(
          "the phase is (0, 0) below 0.1 m/s and 0.1 rad/s and runs on behind, as in unitree_rl_mjlab's deployment");
    }
    draft.command = command;
  }

  // ---- rl_sar

  // The robot's own file, which stands in the folder above the policy's: it has the names and the rate.
  [[nodiscard]] YAML::Node base() const {
    namespace fs = std::filesystem;
    const fs::path folder = fs::path(file_).parent_path();
    for (const fs::path& place : {folder / "base.yaml", folder / ".." / "base.yaml"})
      if (fs::exists(place)) {
        const YAML::Node document = parse_yaml(read_data(place.string()), place.string());
        if (document.IsMap() && document.size() == 1 && document.begin()->second.IsMap())
          return document.begin()->second;
      }
    return {};
  }

  Draft rl_sar() {
    const YAML::Node config = root_.begin()->second, robot = base();
    Draft draft{.kind = "rl_sar", .network = config["model_name"] ? config["model_name"].as<std::string>() : ""};
    const std::vector<int> map = motors_of(config, "joint_mapping");
    const std::size_t n = map.size();
    std::vector<std::string> names;
    if (robot && robot["joint_names"])
      for (const YAML::Node& name : robot["joint_names"]) names.push_back(name.as<std::string>());
    if (names.size() != n) names.clear();
    set_joints(draft, map, names);
    const std::vector<double> kp = numbers(config, "rl_kp", n), kd = numbers(config, "rl_kd", n),
                              pose = numbers(config, "default_dof_pos", n), scale = numbers(config, "action_scale", n),
                              low = numbers(config, "clip_actions_lower", n),
                              up = numbers(config, "clip_actions_upper", n);
    set_gains(draft, kp, kd, pose, scale);
    for (std::size_t i = 0; i < n; ++i) draft.joints[i].clip = ActionRange{low[i], up[i]};
    draft.from["joints"] = fmt::format(
        "order: 'joint_mapping'{}; default: 'default_dof_pos'; kp: 'rl_kp'; kd: 'rl_kd'; action: 'action_scale'; clip: "
        "'clip_actions_lower', 'clip_actions_upper'",
        names.empty() ? "" : "; names: 'joint_names' of base.yaml");
    if (robot && robot["dt"] && robot["decimation"]) {
      draft.rate_hz = 1.0 / (robot["dt"].as<double>() * robot["decimation"].as<double>());
      draft.from["rate_hz"] = "base.yaml: 1 / ('dt' 'decimation')";
      draft.dt = robot["dt"].as<double>();
      draft.from["own_physics"] = "base.yaml: 'dt'";
    } else {
      draft.assumed.emplace_back("rate_hz is 50: there is no base.yaml that says");
    }
    read_rl_sar_terms(draft, config);
    return draft;
  }

  void read_rl_sar_terms(Draft& draft, const YAML::Node& config) {
    const std::pair<const char*, const char*> scales[] = {{"lin_vel", "lin_vel_scale"},
                                                          {"ang_vel", "ang_vel_scale"},
                                                          {"dof_pos", "dof_pos_scale"},
                                                          {"dof_vel", "dof_vel_scale"},
                                                          {"commands", "commands_scale"}};
    const std::vector<double> history =
        config["observations_history"] ? numbers(config, "observations_history", 0) : std::vector<double>{};
    for (std::size_t i = 0; i < history.size(); ++i)
      if (history[i] != static_cast<double>(history.size() - 1 - i))
        refuse("'observations_history' from the oldest frame to 0", "another order");
    const YAML::Node priority = config["observations_history_priority"];
    draft.frame_major = !priority || priority.as<std::string>() == "time";
    draft.from["observation"] = "'observations' with their scales, clip: 'clip_obs'";
    for (const YAML::Node& node : config["observations"]) {
      TermFacts facts{.clip = number_or(config, "clip_obs", 100.0), .clipped = true};
      for (const auto& [term, key] : scales)
        if (node.as<std::string>() == term) facts.scale = numbers(config, key, 0);
      add_term(draft, node.as<std::string>(), facts);
      draft.terms.back().frames = static_cast<int>(std::max<std::size_t>(history.size(), 1));
      if (node.as<std::string>() == "commands") {
        draft.command = VelocityInterface{.forward = {-1, 1}, .lateral = {-1, 1}, .yaw = {-1, 1}};
        draft.assumed.emplace_back("velocities are taken up to 1 m/s and 1 rad/s: the file does not say");
      }
    }
  }

  // ---- unitree_rl_gym

  Draft rl_gym() {
    Draft draft{.kind = "unitree_rl_gym"};
    if (root_["policy_path"])
      draft.network = std::filesystem::path(root_["policy_path"].as<std::string>()).filename().string();
    const int n = whole_number(number_or(root_, "num_actions", 0.0), 1, kMostJoints, "num_actions", file_);
    std::vector<int> map(n);
    std::iota(map.begin(), map.end(), 0);
    set_joints(draft, map, {});
    const std::vector<double> kp = numbers(root_, "kps", n), kd = numbers(root_, "kds", n),
                              pose = numbers(root_, "default_angles", n), scale = numbers(root_, "action_scale", n);
    set_gains(draft, kp, kd, pose, scale);
    draft.from["joints"] = "kp: 'kps'; kd: 'kds'; default: 'default_angles'; action: 'action_scale'";
    draft.rate_hz = 1.0 / (number_or(root_, "simulation_dt", 0.002) * number_or(root_, "control_decimation", 10.0));
    draft.from["rate_hz"] = "1 / ('simulation_dt' 'control_decimation')";
    if (root_["simulation_dt"]) draft.dt = root_["simulation_dt"].as<double>();
    draft.from["own_physics"] = "'simulation_dt'";
    const std::pair<const char*, const char*> terms[] = {{"base_ang_vel", "ang_vel_scale"},
                                                         {"projected_gravity", ""},
                                                         {"commands", "cmd_scale"},
                                                         {"dof_pos", "dof_pos_scale"},
                                                         {"dof_vel", "dof_vel_scale"},
                                                         {"actions", ""},
                                                         {"sin_phase", ""},
                                                         {"cos_phase", ""}};
    for (const auto& [name, scale_key] : terms) {
      TermFacts facts{.clock = "frequency_hz: 1.25"};
      if (*scale_key != '\0') facts.scale = numbers(root_, scale_key, 0);
      draft.terms.push_back(draft_term(name, facts, file_));
    }
    draft.command = VelocityInterface{.forward = {-1, 1, 0.2}, .lateral = {-1, 1, 0.2}, .yaw = {-1, 1}};
    draft.assumed.emplace_back(
        "order of the terms, a clock of 0.8 s and velocities up to 1 m/s are those of unitree_rl_gym's "
        "deploy_mujoco.py");
    return draft;
  }

  const YAML::Node root_;
  const std::string& file_;
  const std::string& card_;
  const Metadata& metadata_;
  std::string trunk_;  // of the robot, "" where nothing carries arms
};

}  // namespace

Draft draft_of_deployment(const YAML::Node& document, const std::string& file, const std::string& card,
                          const Metadata& metadata) {
  try {
    return DeploymentReader(document, file, card, metadata).read();
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("'{}': {}", file, error.what()));
  }
}

}  // namespace duet
