// The configuration of one robot or twin (YAML, docs/hardware.md, "Configuration"): what is allowed, where it is, how
// much slower or further away than the defaults it has to be.
#pragma once

#include <string>

#include "duet/hardware/arming.h"
#include "duet/hardware/dds_place.h"
#include "duet/hardware/lcm_channel.h"
#include "duet/hardware/robot_guard.h"

namespace duet {

struct RobotConfig {
  MotionPermission permission;
  bool twin = false;
  bool person = true;  // somebody may be near
  HardwareLimits limits;
  std::vector<TouchPair> touches;
  std::string contact_limits;  // path of the table; empty: the one that ships
  ExecutorKind executor = ExecutorKind::kTwin;
  OdometrySource odometry = OdometrySource::kTwin;
  LcmPlace lcm;  // of HOMIE's processes
  Pose X_BC;     // of the camera on the base: what a person's joints come in
  bool has_camera = false;

  [[nodiscard]] DdsPlace place() const { return {permission.domain, permission.interface}; }
};

// Throw InputError with file, line, expected and found: unknown keys, another schema, a limit past its ceiling, a place
// as in check_place, a twin outside its domains.
RobotConfig parse_robot_config(const std::string& text, const std::string& file);
RobotConfig read_robot_config(const std::string& path);

// A guard of the G1 by that configuration: the arms are planned, legs and waist keep the stance with the card's gains.
GuardSetup guard_setup(const RobotConfig& config, bool dry_run);

}  // namespace duet
