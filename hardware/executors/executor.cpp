#include "duet/hardware/executors/executor.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kRootChannels = 7;
// The channels of the root that are executed as a velocity: x, y, and of the quaternion the turn, which is in w and z.
constexpr std::size_t kVelocityChannels[] = {0, 1, 3, 6};

std::string joint_names(const std::vector<int>& joints, const RobotModel& robot, bool named) {
  std::vector<std::string> names;
  for (int j = 0; j < robot.dof(); ++j)
    if ((std::ranges::find(joints, j) != joints.end()) == named) names.push_back(robot.joints[j].name);
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

bool is_makers(ExecutorKind kind) { return kind == ExecutorKind::kSport || kind == ExecutorKind::kVendorArmAction; }

std::string_view executor_name(ExecutorKind kind) { return kExecutorNames[static_cast<std::size_t>(kind)]; }

ExecutorKind executor_kind(const std::string& name) {
  for (std::size_t k = 0; k < kExecutorNames.size(); ++k)
    if (kExecutorNames[k] == name) return static_cast<ExecutorKind>(k);
  throw std::invalid_argument(
      fmt::format("executor: expected {}, found '{}'", fmt::join(kExecutorNames, ", "), excerpt(name)));
}

ExecutedChannels executed_channels(ExecutorKind kind, const RobotModel& robot, const std::vector<int>& joints,
                                   const std::string& walker) {
  ExecutedChannels channels;
  channels.kind = kind;
  channels.joints = joints;
  channels.homie = channels.height = kind == ExecutorKind::kHomieLcm || walker == "homie";
  switch (kind) {
    case ExecutorKind::kTwin:
    case ExecutorKind::kLowcmd:
      channels.legs =
          walker.empty() ? "keep the stance of the guard" : fmt::format("by the controller '{}' in the guard", walker);
      channels.stop = "damps every joint";
      break;
    case ExecutorKind::kHomieLcm:
      channels.legs = "by HOMIE's policy; it holds the waist at 0";
      channels.stop =
          "only stands still: HOMIE's processes own the motors and nothing here can damp them. L2 with B on the remote "
          "control, or the emergency stop, is the stop";
      break;
    case ExecutorKind::kSport:
      channels.legs = "by the maker's walking: this is not HOMIE";
      channels.stop = "asks the maker's service to damp; velocities end by themselves after 0.3 s";
      break;
    case ExecutorKind::kVendorArmAction:
      channels.joints.clear();
      channels.legs =
          "by the maker's walking, arms by its preset action, which no limit here reaches: this is not HOMIE";
      channels.stop = "asks the maker's services to release the arms and to damp";
      break;
  }
  channels.executed.assign(kRootChannels + robot.joints.size(), false);
  for (const std::size_t k : kVelocityChannels) channels.executed[k] = true;
  channels.executed[2] = channels.height;
  for (const int joint : channels.joints) channels.executed[kRootChannels + static_cast<std::size_t>(joint)] = true;
  return channels;
}

nlohmann::json executed_channels_json(const ExecutedChannels& channels, const RobotModel& robot) {
  nlohmann::json names = nlohmann::json::array();
  for (const int joint : channels.joints) names.push_back(robot.joints[joint].name);
  return {{"executor", executor_name(channels.kind)},
          {"homie", channels.homie},
          {"legs", channels.legs},
          {"root", channels.height ? "velocity and height" : "velocity"},
          {"joints", names},
          {"executed", channels.executed}};
}

std::string executed_channels_text(const ExecutedChannels& channels, const RobotModel& robot) {
  return fmt::format(
      "executor '{}' is told the velocity of the root{} and {}; it is not told roll and pitch of the root "
      "nor {}: legs {}. Damping {}.",
      executor_name(channels.kind), channels.height ? ", its height" : "",
      channels.joints.empty() ? "no joint" : "the joints " + joint_names(channels.joints, robot, true),
      joint_names(channels.joints, robot, false), channels.legs, channels.stop);
}

std::string executor_refusal(ExecutorKind kind, OdometrySource odometry, bool twin) {
  if (!twin && kind == ExecutorKind::kTwin)
    return "executor 'twin' is a twin's: a robot has 'lowcmd', 'homie-lcm', 'sport' or 'vendor-arm-action'";
  if (odometry == OdometrySource::kNone)
    return "no source of odometry: expected one of legs, external, vendor; without measured odometry nothing walks "
           "(supplement A.4.3)";
  if (!twin && odometry == OdometrySource::kTwin)
    return "odometry 'twin' is a twin's: a robot has 'legs', 'external' or 'vendor'";
  const bool own = kind == ExecutorKind::kHomieLcm || kind == ExecutorKind::kLowcmd;
  if (own && odometry == OdometrySource::kVendor)
    return fmt::format(
        "odometry 'vendor' is there only while the maker's own walking runs: executor '{}' needs 'legs' or 'external'",
        executor_name(kind));
  return "";
}

std::string walker_refusal(ExecutorKind kind, const std::string& walker, bool told) {
  if (kind == ExecutorKind::kLowcmd && !told)
    return fmt::format(
        "executor 'lowcmd' commands every motor: expected a controller that is told velocities and keeps the robot on "
        "its feet (--walker homie), found {}",
        walker.empty() ? "none" : fmt::format("'{}'", walker));
  if (!walker.empty() && (kind == ExecutorKind::kHomieLcm || is_makers(kind)))
    return fmt::format("executor '{}' walks by itself: expected no --walker, found '{}'", executor_name(kind), walker);
  return "";
}

namespace {

std::string permission_refusal(const ArmingFacts& facts) {
  const MotionPermission& permission = facts.permission;
  if (!permission.allow_motion) return "the configuration does not allow motion: 'allow_motion' is not true";
  if (permission.robot.empty()) return "the configuration names no robot: expected its serial number or address";
  if (permission.interface.empty() || permission.interface == "auto")
    return fmt::format("the configuration has to name a network interface, found '{}'", permission.interface);
  if (permission.domain < 0) return "the configuration names no domain of DDS";
  const bool of_twins =
      permission.domain >= kFirstTwinDomain || is_twin_place({permission.domain, permission.interface});
  if (facts.twin != of_twins)
    return fmt::format("domain {}: a twin has 100 to 199, or 1 on 'lo', and a robot has none of these",
                       permission.domain);
  if (permission.mode_machine != facts.reported_mode_machine)
    return fmt::format("mode_machine: expected {} as configured, the robot reports {}", permission.mode_machine,
                       facts.reported_mode_machine);
  return "";
}

std::string operator_refusal(const ArmingFacts& facts) {
  if (facts.shown_nonce.empty() || facts.typed_nonce != facts.shown_nonce)
    return fmt::format("expected the word on the screen, found '{}'", facts.typed_nonce);
  const double age = facts.now - facts.shown_at;
  if (!(age >= 0.0 && age < kNonceTime))
    return fmt::format("the word on the screen holds for {} s, it was typed after {:.1f} s", kNonceTime, age);
  if (!facts.remote_key_held) return "the key on the remote control is not held";
  return "";
}

}  // namespace

std::string arming_refusal(const ArmingFacts& facts) {
  if (facts.dry_run) return "this is a dry run: nothing here can command the robot";
  if (!facts.asked_to_arm) return "nobody asked to arm: expected 'duet hw arm'";
  if (std::string refusal = permission_refusal(facts); !refusal.empty()) return refusal;
  if (std::string refusal = executor_refusal(facts.executor, facts.odometry, facts.twin); !refusal.empty())
    return refusal;
  if (!facts.twin && !facts.contact_limits.verified())
    return fmt::format("contact limits '{}': nobody has checked them against the standard ('verified_by' is empty)",
                       facts.contact_limits.name);
  if (!facts.log_is_open) return "the log cannot be written";
  if (facts.free_log_bytes < kLeastLogBytes)
    return fmt::format("the disk of the log has {:.2f} GB left, expected at least 1", 1e-9 * facts.free_log_bytes);
  if (!facts.executor_complaint.empty())
    return fmt::format("executor '{}': {}", executor_name(facts.executor), facts.executor_complaint);
  if (!is_makers(facts.executor) && !facts.running_mode.empty())
    return fmt::format(
        "the maker's mode '{}' runs and owns the motors, says its motion_switcher: release it with the remote control "
        "before executor '{}' commands them",
        excerpt(facts.running_mode), executor_name(facts.executor));
  return operator_refusal(facts);
}

}  // namespace duet
