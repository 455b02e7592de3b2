// Conditions before a robot is allowed to move: facts that a person made true, one after the other. Pure; the
// readings of clocks are the caller's.
#pragma once

#include <string>

#include "duet/hardware/executor.h"
#include "duet/hardware/safety_signal.h"
#include "duet/metrics/contact_limits.h"

namespace duet {

// The permission in the configuration (docs/hardware.md, "Configuration").
struct MotionPermission {
  bool allow_motion = false;
  std::string robot;      // its serial number or address
  std::string interface;  // of the network: named, never chosen by itself
  int domain = -1;        // of DDS: 0 is the robot's own
  int mode_machine = -1;  // that the robot reports
};

struct ArmingFacts {
  MotionPermission permission;
  bool twin = false;  // a twin on this machine, not a robot
  ExecutorKind executor = ExecutorKind::kTwin;
  OdometrySource odometry = OdometrySource::kNone;
  std::string executor_complaint;  // what is wrong with it; empty: nothing
  bool asked_to_arm = false;       // on the command line
  bool dry_run = false;
  ContactLimits contact_limits;
  std::string shown_nonce, typed_nonce;
  double shown_at = kNever;  // [s], as `now`
  double now = 0.0;
  bool remote_key_held = false;
  int reported_mode_machine = -1;
  double free_log_bytes = 0.0;
  bool log_is_open = false;
};

inline constexpr double kNonceTime = 30.0;     // for which what is shown on screen may be typed [s]
inline constexpr double kLeastLogBytes = 1e9;  // on the disk of the log

// Why the robot may not be armed, the first reason as one sentence; empty where it may.
std::string arming_refusal(const ArmingFacts& facts);

}  // namespace duet
