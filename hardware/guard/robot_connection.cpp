#include "duet/hardware/guard/robot_connection.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/executors/arm_action.h"
#include "duet/hardware/executors/homie_executor.h"
#include "duet/robots/human_body.h"
#include "duet/robots/yaml_schema.h"

namespace duet {

double RobotConnection::executor_heard(double now) {
  executor_.poll(now);
  return executor_.answers() ? executor_.heard_at() : kNever;
}

bool RobotConnection::take(LowStateFrame& frame) {
  if (!wire_.take(frame)) return false;
  if (odometry_ != nullptr) odometry_->see(frame);
  return true;
}

namespace {

constexpr const char* kRobotSchema = "duet.robot/1";
// Gains of arms beside a person: the maker's example for its arm topic.
constexpr double kArmStiffness = 60.0, kArmDamping = 1.5;

// HOMIE's controller drives the arms with its own.
void take_homies_gains(ExecutedJoints& executed, const RobotModel& robot) {
  for (const std::vector<int>& arm : robot.roles.arms)
    for (std::size_t k = 0; k < arm.size(); ++k) {
      executed.kp[arm[k]] = kHomieArmStiffness.at(k);
      executed.kd[arm[k]] = kHomieArmDamping.at(k);
    }
  executed.fixed_gains = true;
}

// Bones of an adult of 1.75 m, where nobody measured: pelvis to head, legs and arms [m].
constexpr std::array<double, 24> kAdultBones = {0.12, 0.11, 0.11,  0.12,  0.40, 0.40, 0.13,  0.42,
                                                0.42, 0.06, 0.135, 0.135, 0.20, 0.14, 0.14,  0.10,
                                                0.11, 0.11, 0.29,  0.29,  0.25, 0.25, 0.085, 0.085};

void read_touches(const YamlSection& top, std::vector<TouchPair>& touches) {
  for (const YAML::Node& node : top.items("touches")) {
    if (!node.IsSequence() || node.size() != 2 || !node[0].IsScalar() || !node[1].IsScalar())
      top.fail(node.Mark().line + 1,
               fmt::format("key 'touches': expected [part of the robot, part of a person], found {}", describe(node)));
    touches.push_back({node[0].Scalar(), node[1].Scalar()});
  }
}

int whole_number(const YamlSection& top, const char* key) {
  constexpr double kMost = 1e6;
  int number = 0;
  read_value(top, {.name = key, .range = {-kMost, kMost}}, number);
  return number;
}

// A robot without a word of odometry has none.
void read_executor(const YamlSection& top, RobotConfig& config) {
  const auto names = [](const auto& table) { return std::vector<std::string>(table.begin(), table.end()); };
  config.odometry = config.twin ? OdometrySource::kTwin : OdometrySource::kNone;
  read_optional(top, {.name = "executor", .choices = names(kExecutorNames)}, config.executor);
  read_optional(top, {.name = "odometry", .choices = names(kOdometryNames)}, config.odometry);
  read_optional(top, {"arm_action"}, config.arm_action);
  const bool acts = config.executor == ExecutorKind::kVendorArmAction;
  if (acts != !config.arm_action.empty())
    top.fail(top.line(acts ? "executor" : "arm_action"),
             "expected executor 'vendor-arm-action' and the name of an 'arm_action', or neither, found one of them");
  if (!acts) return;
  try {
    (void)arm_preset(config.arm_action);
  } catch (const std::invalid_argument& error) {
    top.fail(top.line("arm_action"), error.what());
  }
  if (config.person)
    top.fail(top.line("executor"),
             "the maker's arm actions pass no limit of this program: expected 'person: false', found true");
}

const Schema<LcmPlace>& lcm_schema() {
  using P = LcmPlace;
  static const Schema<P> schema = {
      optional_key({"group"}, &P::group), optional_key({.name = "port", .range = {1, 65535}}, &P::port),
      optional_key({"interface"}, &P::interface), optional_key({.name = "hops", .range = {0, 255}}, &P::hops)};
  return schema;
}

const Schema<NetworkPlace>& network_schema() {
  using P = NetworkPlace;
  static const Schema<P> schema = {required_key({"bind"}, &P::bind), required_key({"key"}, &P::key)};
  return schema;
}

const Schema<ChecklistDemand>& checklist_demand_schema() {
  using D = ChecklistDemand;
  constexpr double kMostHours = 168.0;  // a week
  static const Schema<D> schema = {required_key({"form"}, &D::form),
                                   optional_key({.name = "hours", .range = {0.1, kMostHours}}, &D::hours),
                                   optional_key({.name = "up_to", .choices = checklist_names()}, &D::up_to),
                                   optional_key({"required"}, &D::required)};
  return schema;
}

void read_network(const std::string& file, const YamlSection& top, RobotConfig& config) {
  read_mapping(file, top.node("network"), "network", network_schema(), config.network);
  try {
    (void)network_address(config.network.bind);
  } catch (const std::invalid_argument& error) {
    top.fail(top.line("network"), fmt::format("key 'bind': {}", error.what()));
  }
  config.has_network = true;
}

void read_camera(const std::string& file, const YAML::Node& node, RobotConfig& config) {
  const YamlSection section(file, node, "camera", {"position", "quat_wxyz", "latency"});
  constexpr double kFarthest = 2.0;  // of a camera from the base [m]
  Pose& X_BC = config.camera.X_BC;
  X_BC.p = section.vector3("position");
  if (X_BC.p.norm() > kFarthest)
    section.fail_key("position",
                     fmt::format("expected at most {} m from the base, found {}", kFarthest, X_BC.p.norm()));
  const std::vector<YAML::Node> items = section.items("quat_wxyz");
  Eigen::Vector4d quat_wxyz = Eigen::Vector4d::Zero();
  for (std::size_t k = 0; k < std::min<std::size_t>(items.size(), 4); ++k)
    if (!items[k].IsScalar() || !YAML::convert<double>::decode(items[k], quat_wxyz[static_cast<Eigen::Index>(k)]))
      section.fail_key("quat_wxyz", "expected 4 numbers, found others");
  if (items.size() != 4 || !(std::abs(quat_wxyz.norm() - 1.0) < 1e-3))
    section.fail_key("quat_wxyz", "expected a unit quaternion w, x, y, z, found another");
  X_BC.R = Eigen::Quaterniond(quat_wxyz[0], quat_wxyz[1], quat_wxyz[2], quat_wxyz[3]).normalized();
  read_optional(section, {.name = "latency", .range = {0.0, SafetyRules{}.person.hold}}, config.camera.latency);
  config.has_camera = true;
}

}  // namespace

constexpr double kLongestRamp = 10.0;  // of gains [s]

RobotConfig parse_robot_config(const std::string& text, const std::string& file) {
  const YamlSection top(
      file, parse_yaml(text, file), "robot",
      {"schema", "robot",  "interface", "domain",         "mode_machine", "allow_motion", "twin",
       "person", "limits", "touches",   "contact_limits", "executor",     "odometry",     "arm_action",
       "lcm",    "camera", "network",   "checklist",      "gain_ramp",    "arm_gravity"});
  top.require_schema(kRobotSchema);
  RobotConfig config;
  config.permission = {.allow_motion = false,
                       .robot = top.text("robot"),
                       .interface = top.text("interface"),
                       .domain = whole_number(top, "domain"),
                       .mode_machine = whole_number(top, "mode_machine")};
  read_optional(top, {"allow_motion"}, config.permission.allow_motion);
  read_optional(top, {"twin"}, config.twin);
  read_optional(top, {"person"}, config.person);
  read_optional(top, {"contact_limits"}, config.contact_limits);
  read_optional(top, {.name = "gain_ramp", .range = {0.0, kLongestRamp}}, config.gain_ramp);
  read_optional(top, {"arm_gravity"}, config.arm_gravity);
  if (top.has("limits")) read_fields(file, top.node("limits"), "limits", hardware_limit_fields(), config.limits);
  read_touches(top, config.touches);
  read_executor(top, config);
  if (top.has("lcm")) read_mapping(file, top.node("lcm"), "lcm", lcm_schema(), config.lcm);
  if (top.has("camera")) read_camera(file, top.node("camera"), config);
  if (top.has("network")) read_network(file, top, config);
  if (top.has("checklist"))
    read_mapping(file, top.node("checklist"), "checklist", checklist_demand_schema(), config.checklist);
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
  if (config.executor != ExecutorKind::kVendorArmAction)
    for (const std::vector<int>& arm : limiter.robot->roles.arms)
      limiter.executed.joints.insert(limiter.executed.joints.end(), arm.begin(), arm.end());
  limiter.executed.kp.setConstant(limiter.robot->dof(), kArmStiffness);
  limiter.executed.kd.setConstant(limiter.robot->dof(), kArmDamping);
  if (config.executor == ExecutorKind::kHomieLcm) {
    take_homies_gains(limiter.executed, *limiter.robot);
    setup.rules.executor = kHomieAges;
  }
  limiter.person = config.person;
  limiter.human = make_human_body(kAdultBones);
  limiter.contact_limits =
      load_contact_limits(config.contact_limits.empty() ? default_contact_limits_path() : config.contact_limits);
  limiter.touches = config.touches;
  setup.mode_machine = config.permission.mode_machine;
  setup.stance = limiter.robot->default_command(limiter.robot->neutral);
  setup.dry_run = dry_run;
  setup.has_battery = true;
  setup.executor = config.executor;
  setup.odometry = config.odometry;
  const bool answers = config.executor == ExecutorKind::kHomieLcm || is_makers(config.executor);
  setup.rules.executor_answers = !dry_run && answers;
  setup.rules.stands_alone = answers;
  setup.gain_ramp = config.gain_ramp;
  setup.arm_gravity = config.arm_gravity;
  return setup;
}

}  // namespace duet
