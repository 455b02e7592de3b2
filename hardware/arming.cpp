#include "duet/hardware/arming.h"

#include <fmt/format.h>

namespace duet {
namespace {

std::string permission_refusal(const ArmingFacts& facts) {
  const MotionPermission& permission = facts.permission;
  if (!permission.allow_motion) return "the configuration does not allow motion: 'allow_motion' is not true";
  if (permission.robot.empty()) return "the configuration names no robot: expected its serial number or address";
  if (permission.interface.empty() || permission.interface == "auto")
    return fmt::format("the configuration has to name a network interface, found '{}'", permission.interface);
  if (permission.domain < 0) return "the configuration names no domain of DDS";
  if (facts.twin != (permission.domain >= 100 && permission.domain < 200))
    return fmt::format("domain {}: a twin has 100 to 199, and a robot has none of these", permission.domain);
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
  return operator_refusal(facts);
}

}  // namespace duet
