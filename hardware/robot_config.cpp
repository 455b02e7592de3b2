#include "duet/hardware/robot_config.h"

#include <fmt/format.h>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/robots/human_body.h"
#include "duet/robots/yaml_fields.h"

namespace duet {
namespace {

constexpr const char* kRobotSchema = "duet.robot/1";
// Of arms beside a person: the maker's example for its arm topic.
constexpr double kArmStiffness = 60.0, kArmDamping = 1.5;

// Of an adult of 1.75 m, where nobody measured: pelvis to head, legs and arms [m].
constexpr std::array<double, 24> kAdultBones = {0.12, 0.11, 0.11,  0.12,  0.40, 0.40, 0.13,  0.42,
                                                0.42, 0.06, 0.135, 0.135, 0.20, 0.14, 0.14,  0.10,
                                                0.11, 0.11, 0.29,  0.29,  0.25, 0.25, 0.085, 0.085};

void read_limits(const std::string& file, const YAML::Node& node, HardwareLimits& limits) {
  read_fields(YamlSection(file, node, "limits", field_keys(hardware_limit_fields())), hardware_limit_fields(), limits);
}

void read_touches(const YamlSection& top, std::vector<TouchPair>& touches) {
  for (const YAML::Node& node : top.items("touches")) {
    if (!node.IsSequence() || node.size() != 2 || !node[0].IsScalar() || !node[1].IsScalar())
      top.fail(node.Mark().line + 1,
               fmt::format("'touches': expected [part of the robot, part of a person], found {}", describe(node)));
    touches.push_back({node[0].Scalar(), node[1].Scalar()});
  }
}

}  // namespace

RobotConfig parse_robot_config(const std::string& text, const std::string& file) {
  const YamlSection top(file, parse_yaml(text, file), "robot",
                        {"schema", "robot", "interface", "domain", "mode_machine", "allow_motion", "twin", "person",
                         "limits", "touches", "contact_limits"});
  if (const std::string schema = top.text("schema"); schema != kRobotSchema)
    top.fail(top.line("schema"), fmt::format("'schema': expected '{}', found '{}'", kRobotSchema, schema));
  RobotConfig config;
  config.permission = {.allow_motion = top.flag_or("allow_motion", false),
                       .robot = top.text("robot"),
                       .interface = top.text("interface"),
                       .domain = static_cast<int>(top.number("domain")),
                       .mode_machine = static_cast<int>(top.number("mode_machine"))};
  config.twin = top.flag_or("twin", false);
  config.person = top.flag_or("person", true);
  if (top.has("contact_limits")) config.contact_limits = top.text("contact_limits");
  if (top.has("limits")) read_limits(file, top.node("limits"), config.limits);
  read_touches(top, config.touches);
  try {
    config.twin ? check_twin_place(config.place()) : check_place(config.place());
  } catch (const std::invalid_argument& error) {
    top.fail(top.line("domain"), error.what());
  }
  return config;
}

RobotConfig read_robot_config(const std::string& path) { return parse_robot_config(read_text(path), path); }

GuardSetup guard_setup(const RobotConfig& config, bool dry_run) {
  GuardSetup setup;
  LimiterSetup& limiter = setup.limiter;
  limiter.robot = load_shared_robot();
  limiter.limits = config.limits;
  for (const std::vector<int>& arm : limiter.robot->roles.arms)
    limiter.executed.joints.insert(limiter.executed.joints.end(), arm.begin(), arm.end());
  limiter.executed.kp.setConstant(limiter.robot->dof(), kArmStiffness);
  limiter.executed.kd.setConstant(limiter.robot->dof(), kArmDamping);
  limiter.person = config.person;
  limiter.human = make_human_body(kAdultBones);
  limiter.contact_limits =
      load_contact_limits(config.contact_limits.empty() ? default_contact_limits_path() : config.contact_limits);
  limiter.touches = config.touches;
  setup.mode_machine = config.permission.mode_machine;
  setup.stance = limiter.robot->default_command(limiter.robot->neutral);
  setup.dry_run = dry_run;
  return setup;
}

}  // namespace duet
