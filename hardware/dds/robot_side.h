// Everything between the guard and the robot of a configuration: wire, executor, odometry, put together.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "duet/hardware/dds/dds_wire.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/guard/robot_connection.h"

namespace duet {

struct RobotSideOptions {
  bool commands = false;  // false: whatever the configuration says, nothing is there that could command
  double period = 0.002;  // of the guard's ticks [s]
  int velocity_port = 0;  // of a twin that takes velocities at 127.0.0.1; read where it is the executor
  std::string pose_socket = "duet-pose.socket";  // where a tracker sends; read for external odometry
};

class RobotSide {
 public:
  // Throws as open_robot_wire, LcmChannel and DatagramSocket do; std::invalid_argument for a twin as executor without a
  // port.
  RobotSide(const RobotConfig& config, const RobotSideOptions& options);

  RobotConnection& connection() { return *connection_; }
  Executor& executor() { return *executor_; }
  // Null where the maker's own walking is the executor, and where nothing is commanded.
  ModeWatch* maker_mode() { return mode_ ? &*mode_ : nullptr; }

 private:
  void make_odometry(const RobotConfig& config, const RobotSideOptions& options);
  void make_executor(const RobotConfig& config, const RobotSideOptions& options);

  std::unique_ptr<RobotWire> wire_;
  std::unique_ptr<SportWire> sport_;
  std::optional<ModeWatch> mode_;
  std::unique_ptr<VelocitySink> velocity_;
  std::unique_ptr<OdometryReader> odometry_;
  std::unique_ptr<Executor> executor_;
  std::unique_ptr<RobotConnection> connection_;
};

}  // namespace duet
