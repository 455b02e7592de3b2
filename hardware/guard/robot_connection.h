// The whole way between guard and robot, put together from the wire that is listened to, the executor that is commanded
// and the source of odometry. The guard sees one wire. One owner, one thread.
#pragma once

#include <algorithm>
#include <memory>
#include <string>

#include "duet/hardware/executors/executor.h"
#include "duet/hardware/guard/person_track.h"
#include "duet/hardware/guard/robot_guard.h"
#include "duet/hardware/safety/checklist.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/lcm_message.h"
#include "duet/hardware/wire/odometry_source.h"
#include "duet/hardware/wire/robot_wire.h"

namespace duet {

// The guard's own frames to the motors: a twin's, with velocities as HOMIE's message to a port beside it, or a robot's.
class MotorExecutor final : public Executor {
 public:
  // `expected_writers`: of commands, of whom it is known; where nothing is commanded at all.
  MotorExecutor(RobotWire& wire, VelocitySink& velocity, int expected_writers = 0)
      : wire_(wire), velocity_(velocity), expected_writers_(expected_writers) {}

  void poll(double) override {}
  [[nodiscard]] double heard_at() const override { return kNever; }
  [[nodiscard]] bool answers() const override { return false; }
  [[nodiscard]] std::string complaint() const override { return ""; }
  int foreign_writers(int command_writers) override { return std::max(command_writers - expected_writers_, 0); }
  void open() override { wire_.open_writer(); }
  void close() override { wire_.close_writer(); }
  [[nodiscard]] bool is_open() const override { return wire_.has_writer(); }
  bool write(const LowCommandFrame& frame) override { return wire_.write(frame); }
  void send(const VelocityCommand& velocity) override { velocity_.send(velocity); }

 private:
  RobotWire& wire_;
  VelocitySink& velocity_;
  int expected_writers_;
};

class RobotConnection final : public RobotWire {
 public:
  // Refers to all of them. `odometry`: null where nothing measures the root.
  RobotConnection(RobotWire& wire, Executor& executor, OdometryReader* odometry)
      : wire_(wire), executor_(executor), odometry_(odometry) {}

  bool take(LowStateFrame& frame) override;
  bool take(OdometrySample& sample) override { return odometry_ != nullptr && odometry_->take(sample); }
  bool take(BatteryReading& reading) override { return wire_.take(reading); }
  double executor_heard(double now) override;
  int foreign_writers() override { return executor_.foreign_writers(wire_.foreign_writers()); }
  void open_writer() override { executor_.open(); }
  void close_writer() override { executor_.close(); }
  [[nodiscard]] bool has_writer() const override { return executor_.is_open(); }
  bool write(const LowCommandFrame& frame) override { return executor_.write(frame); }
  bool wait(double most) override { return wire_.wait(most); }

 private:
  RobotWire& wire_;
  Executor& executor_;
  OdometryReader* odometry_;
};

// The configuration of one robot or twin (YAML, docs/hardware.md, "Configuration"): what is allowed, where it is, how
// much slower or further away than the defaults it has to be.

// Where sealed datagrams are received (hardware/guard/network_door.h).
struct NetworkPlace {
  std::string bind;  // "HOST:PORT" of this computer
  std::string key;   // path of the key's file
};

struct RobotConfig {
  MotionPermission permission;
  bool twin = false;
  bool person = true;  // somebody may be near
  HardwareLimits limits;
  std::vector<TouchPair> touches;
  std::string contact_limits;  // path of the table; empty: the one that ships
  ExecutorKind executor = ExecutorKind::kTwin;
  OdometrySource odometry = OdometrySource::kTwin;
  std::string arm_action;  // of the maker, by its name; empty: the executor has none
  LcmPlace lcm;            // of HOMIE's processes
  CameraMount camera;      // what a person's joints come in
  bool has_camera = false;
  NetworkPlace network;  // where planners and estimators of other computers reach the guard
  bool has_network = false;
  ChecklistDemand checklist;
  double gain_ramp = GuardSetup{}.gain_ramp;  // as in GuardSetup
  bool arm_gravity = GuardSetup{}.arm_gravity;

  [[nodiscard]] DdsPlace place() const { return {permission.domain, permission.interface}; }
};

// Throw InputError with file, line, expected and found: unknown keys, another schema, a limit past its ceiling, a place
// as in check_place, a twin outside its domains.
RobotConfig parse_robot_config(const std::string& text, const std::string& file);
RobotConfig read_robot_config(const std::string& path);

// A guard of the G1 by that configuration: the arms are planned, legs and waist keep the stance with the card's gains.
GuardSetup guard_setup(const RobotConfig& config, bool dry_run);

}  // namespace duet
