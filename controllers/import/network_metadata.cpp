// The metadata of ONNX files: the keys of holosoma and those of BeyondMimic, mjlab and their forks.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/import/draft.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

class MetadataReader {
 public:
  MetadataReader(const Metadata& metadata, const std::string& file, const std::string& card)
      : metadata_(metadata), file_(file), card_(card) {}

  Draft read() {
    if (has("experiment_config") || (has("dof_names") && has("kp"))) return holosoma();
    if (has("observation_names")) return beyond_mimic();
    std::vector<std::string> keys;
    for (const auto& entry : metadata_) keys.push_back(entry.first);
    throw InputError(fmt::format(
        "'{}': expected metadata of holosoma ('dof_names', 'kp', 'experiment_config') or of BeyondMimic or mjlab "
        "('observation_names', 'joint_names'), found {}: import the YAML file of its deployment",
        file_, keys.empty() ? "none" : excerpt(fmt::format("{}", fmt::join(keys, ", ")))));
  }

 private:
  [[nodiscard]] bool has(const char* key) const { return metadata_.contains(key); }
  [[nodiscard]] std::vector<std::string> words(const char* key) const {
    const auto found = metadata_.find(key);
    if (found == metadata_.end())
      throw InputError(fmt::format("'{}': expected the metadata '{}', found none", file_, key));
    return metadata_words(found->second);
  }
  // As many numbers as there are joints; one is all of theirs.
  [[nodiscard]] std::vector<double> numbers(const char* key, std::size_t count) const {
    std::vector<double> values;
    for (const std::string& word : words(key)) {
      const std::optional<double> value = parse_number(word);
      if (!value || !std::isfinite(*value))
        throw InputError(fmt::format("'{}': metadata '{}': expected numbers, found '{}'", file_, key, excerpt(word)));
      values.push_back(*value);
    }
    if (values.size() == 1) values.resize(count, values[0]);
    if (values.size() != count)
      throw InputError(fmt::format("'{}': metadata '{}': expected {} numbers, one for each joint, found {}", file_, key,
                                   count, values.size()));
    return values;
  }

  void set_joints(Draft& draft, const char* names, const char* kp, const char* kd) {
    const std::vector<std::string> joints = words(names);
    body_ = body_of(joints, card_, file_);
    const std::vector<double> stiffness = numbers(kp, joints.size()), damping = numbers(kd, joints.size());
    for (std::size_t j = 0; j < joints.size(); ++j) {
      DescriptorJoint joint;
      joint.name = body_.robot->joints[joint_of(*body_.robot, joints[j])].name;
      joint.kp = stiffness[j];
      joint.kd = damping[j];
      joint.action = 1.0;
      draft.joints.push_back(joint);
    }
    draft.from["joints"] = fmt::format("'{}'; kp: '{}'; kd: '{}'", names, kp, kd);
  }

  // ---- BeyondMimic, mjlab

  Draft beyond_mimic() {
    Draft draft{.kind = "BeyondMimic or mjlab"};
    set_joints(draft, "joint_names", "joint_stiffness", "joint_damping");
    const std::vector<double> pose = numbers("default_joint_pos", draft.joints.size());
    const std::vector<double> scale = numbers("action_scale", draft.joints.size());
    bool exact = false;
    for (std::size_t j = 0; j < draft.joints.size(); ++j) {
      DescriptorJoint& joint = draft.joints[j];
      joint.neutral = pose[j];
      // Files have three decimals; mjlab makes a scale of a quarter of the effort over kp.
      const double quotient = 0.25 * body_.robot->joints[joint_of(*body_.robot, joint.name)].effort / joint.kp;
      const bool is_quotient = std::abs(quotient - scale[j]) < 6e-4;
      exact |= is_quotient && quotient != scale[j];
      joint.action = is_quotient ? quotient : scale[j];
    }
    draft.from["joints"] += fmt::format("; default: 'default_joint_pos'; action: 'action_scale'{}",
                                        exact ? ", as the quotient 0.25 effort / kp that it rounds" : "");
    draft.assumed.emplace_back("rate_hz is 50: the file does not say");
    draft.assumed.emplace_back("the terms have the scale 1 and no clip: the file does not say");
    read_terms(draft);
    return draft;
  }

  void read_terms(Draft& draft) {
    const std::vector<std::string> names = words("observation_names");
    const std::vector<std::string> commands =
        has("command_names") ? words("command_names") : std::vector<std::string>{};
    const bool tracks = std::ranges::find(commands, "motion") != commands.end();
    const std::vector<double> frames = has("observation_history_lengths")
                                           ? numbers("observation_history_lengths", names.size())
                                           : std::vector<double>(names.size(), 1.0);
    TermFacts facts;
    if (has("anchor_body_name")) facts.anchor = metadata_.at("anchor_body_name");
    facts.clock = "frequency_hz: 1.6666666666666667, standing: zero, after_standing: runs_on";
    draft.from["observation"] = "'observation_names'";
    for (std::size_t i = 0; i < names.size(); ++i) {
      const char* command = tracks ? "motion_command" : "velocity_commands";
      draft.terms.push_back(draft_term(names[i] == "command" ? command : names[i], facts, file_));
      draft.terms.back().name = names[i];
      draft.terms.back().frames = whole_number(frames[i], 0, kMostFrames, "observation_history_lengths", file_);
    }
    if (tracks) return;
    draft.command = VelocityInterface{.forward = {-1, 1}, .lateral = {-1, 1}, .yaw = {-1, 1}};
    draft.assumed.emplace_back("velocities are taken up to 1 m/s and 1 rad/s: the file does not say");
    if (std::ranges::find(names, "phase") == names.end()) return;
    draft.command->stands_below = StandBounds{.speed = 0.1, .yaw_rate = 0.1};
    draft.assumed.emplace_back("the phase turns in 0.6 s and is (0, 0) below 0.1 m/s: the file does not say");
  }

  // ---- holosoma

  Draft holosoma() {
    Draft draft{.kind = "holosoma"};
    set_joints(draft, "dof_names", "kp", "kd");
    if (has("experiment_config"))
      read_experiment(draft, parse_yaml(metadata_.at("experiment_config"), file_));
    else
      take_tables(draft);
    if (has("command_ranges")) read_ranges(draft, parse_yaml(metadata_.at("command_ranges"), file_));
    return draft;
  }

  void read_ranges(Draft& draft, const YAML::Node& ranges) {
    VelocityInterface command;
    const std::pair<const char*, CommandRange*> keys[] = {
        {"lin_vel_x", &command.forward}, {"lin_vel_y", &command.lateral}, {"ang_vel_yaw", &command.yaw}};
    for (const auto& [key, range] : keys) {
      if (!ranges.IsMap() || !ranges[key] || !ranges[key].IsSequence() || ranges[key].size() != 2) return;  // a tracker
      *range = {ranges[key][0].as<double>(), ranges[key][1].as<double>()};
    }
    command.stands_below = StandBounds{.speed = 0.01, .yaw_rate = 0.01};
    draft.command = command;
    draft.from["command"] = "'command_ranges'";
    draft.assumed.emplace_back("a command below 0.01 m/s and 0.01 rad/s means to stand, as in holosoma's deployment");
  }

  // A file of the four keys alone: the rest is holosoma's own, of the robot whose joints it has.
  void take_tables(Draft& draft) {
    for (const char* own : {"holosoma", "holosoma_t1"}) {
      const Descriptor tables = load_descriptor(own);
      if (tables.joints.size() != draft.joints.size()) continue;
      bool all = true;
      for (DescriptorJoint& joint : draft.joints) {
        const auto found = std::ranges::find(tables.joints, joint.name, &DescriptorJoint::name);
        all = all && found != tables.joints.end();
        if (!all) break;
        joint.neutral = found->neutral;
        joint.action = found->action;
      }
      if (!all) continue;
      const bool t1 = tables.robot == "t1";
      draft.action_clip = tables.action_clip;
      draft.assumed.push_back(fmt::format(
          "default pose, scales, order of the terms, clock and clip are those of holosoma's {}: the file does not say",
          t1 ? "T1" : "G1"));
      set_walker_terms(draft, t1 ? 1.0 : 0.25, t1 ? 0.1 : 0.05);
      return;
    }
    throw InputError(fmt::format(
        "'{}': expected the metadata 'experiment_config' or the joints of holosoma's G1 or T1, found neither", file_));
  }

  void set_walker_terms(Draft& draft, double gyro, double speeds) {
    for (const char* name : {"actions", "base_ang_vel", "command_ang_vel", "command_lin_vel", "cos_phase", "dof_pos",
                             "dof_vel", "projected_gravity", "sin_phase"}) {
      TermFacts facts{.clock = clock(1.0), .clipped = true};
      if (name == std::string("base_ang_vel")) facts.scale = {gyro};
      if (name == std::string("dof_vel")) facts.scale = {speeds};
      draft.terms.push_back(draft_term(name, facts, file_));
    }
  }

  static std::string clock(double period) {
    return fmt::format(
        "frequency_hz: {:.9g}, phases: [0, 3.141592653589793], standing: [3.141592653589793, 3.141592653589793]",
        1.0 / period);
  }

  // A part of the configuration; throws where there is none.
  [[nodiscard]] YAML::Node part(const YAML::Node& config, const std::vector<const char*>& path) const {
    YAML::Node at = YAML::Clone(config);
    for (const char* key : path) {
      if (!at.IsMap() || !at[key])
        throw InputError(
            fmt::format("'{}': experiment_config: expected '{}', found none", file_, fmt::join(path, ".")));
      at.reset(at[key]);
    }
    return at;
  }
  [[nodiscard]] double number_or(const YAML::Node& config, const std::vector<const char*>& path, double other) const {
    try {
      return part(config, path).as<double>();
    } catch (const std::exception&) {
      return other;
    }
  }

  // The body of a tracker's errors; "" where the configuration names none.
  [[nodiscard]] std::string anchor_of(const YAML::Node& config) const {
    try {
      return part(config, {"command", "setup_terms", "motion_command", "params", "motion_config", "body_name_ref"})[0]
          .as<std::string>();
    } catch (const std::exception&) {
      return "";
    }
  }

  void read_experiment(Draft& draft, const YAML::Node& config) {
    const YAML::Node control = part(config, {"robot", "control"});
    if (const YAML::Node type = control["control_type"]; type && type.Scalar() != "P")
      throw InputError(fmt::format("'{}': experiment_config: robot.control.control_type: expected 'P', found '{}'",
                                   file_, excerpt(type.Scalar())));
    const YAML::Node pose = part(config, {"robot", "init_state", "default_joint_angles"});
    const double scale = number_or(control, {"action_scale"}, 1.0);
    const YAML::Node by_effort = control["action_scales_by_effort_limit_over_p_gain"];
    const bool scaled = by_effort && by_effort.as<bool>(false);
    const YAML::Node efforts = scaled ? part(config, {"robot", "dof_effort_limit_list"}) : YAML::Node();
    const std::vector<std::string> names = words("dof_names");
    for (std::size_t j = 0; j < draft.joints.size(); ++j) {
      draft.joints[j].neutral = pose[names[j]] ? pose[names[j]].as<double>() : 0.0;
      draft.joints[j].action = scaled ? scale * efforts[j].as<double>() / draft.joints[j].kp : scale;
    }
    draft.from["joints"] += "; default: experiment_config's robot.init_state; action: its robot.control";
    draft.rate_hz = number_or(config, {"simulator", "config", "sim", "fps"}, 200.0) /
                    number_or(config, {"simulator", "config", "sim", "control_decimation"}, 4.0);
    draft.from["rate_hz"] = "experiment_config's simulator.config.sim: fps / control_decimation";
    draft.dt = physics_step_of(metadata_);
    draft.from["own_physics"] = "experiment_config's simulator.config.sim: 1 / fps";
    draft.action_clip = number_or(control, {"action_clip_value"}, 100.0);
    draft.from["action"] = "experiment_config's robot.control.action_clip_value";
    read_groups(draft, config);
  }

  // Terms stand in the input in the order of their names.
  void read_groups(Draft& draft, const YAML::Node& config) {
    const YAML::Node group = part(config, {"observation", "groups", "actor_obs"});
    const int frames = whole_number(number_or(group, {"history_length"}, 1.0), 0, kMostFrames, "history_length", file_);
    std::map<std::string, YAML::Node> terms;
    for (const auto& entry : part(group, {"terms"})) terms[entry.first.Scalar()] = entry.second;
    for (const auto& [name, term] : terms) {
      TermFacts facts{.scale = {number_or(term, {"scale"}, 1.0)}, .anchor = anchor_of(config), .clipped = true};
      facts.clock =
          clock(number_or(config, {"command", "setup_terms", "locomotion_gait", "params", "gait_period"}, 1.0));
      const YAML::Node clip = term["clip"];
      if (clip && clip.IsSequence() && clip.size() == 2) facts.clip = clip[1].as<double>();
      draft.terms.push_back(draft_term(name, facts, file_));
      draft.terms.back().frames = frames;
    }
    draft.from["observation"] = "experiment_config's observation.groups.actor_obs, in the order of the terms' names";
    const YAML::Node terrain = config["terrain"] ? config["terrain"]["terrain_term"] : YAML::Node();
    if (terrain && terrain["mesh_type"] && terrain["mesh_type"].Scalar() == "load_obj")
      draft.assumed.emplace_back(
          "the ground is flat: it was trained on a ground of its own (terrain.mesh_type load_obj)");
  }

  const Metadata& metadata_;
  const std::string& file_;
  const std::string& card_;
  DraftBody body_;
};

}  // namespace

std::optional<double> physics_step_of(const Metadata& metadata) {
  const auto found = metadata.find("experiment_config");
  if (found == metadata.end()) return std::nullopt;
  try {
    const YAML::Node config = parse_yaml(found->second, "experiment_config");
    const auto fps = config["simulator"]["config"]["sim"]["fps"].as<double>();
    return fps > 0.0 ? std::optional(1.0 / fps) : std::nullopt;
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

Draft draft_of_metadata(const Metadata& metadata, const std::string& file, const std::string& card) {
  try {
    return MetadataReader(metadata, file, card).read();
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("'{}': metadata: {}", file, error.what()));
  }
}

}  // namespace duet
