// The guard in real time: the only place that reads a clock. Every 2 ms it takes what came over the local socket and
// the wire, and ticks. One thread.
#pragma once

#include <functional>

#include "duet/core/awake_time.h"
#include "duet/hardware/datagram_socket.h"
#include "duet/hardware/guard_message.h"
#include "duet/hardware/robot_guard.h"
#include "duet/hardware/robot_wire.h"

namespace duet {

// Velocities as HOMIE's processes and the twin take them, 50 times a second.
class LcmVelocity final : public VelocitySink {
 public:
  explicit LcmVelocity(DatagramSocket socket) : socket_(std::move(socket)) {}
  void send(const VelocityCommand& velocity) override;

 private:
  DatagramSocket socket_;
  std::uint32_t sequence_ = 0;
  long calls_ = 0;
};

// A velocity that nobody executes: of a dry run.
class NoVelocity final : public VelocitySink {
 public:
  void send(const VelocityCommand&) override {}
};

// Takes what came over the planner's socket since the last call, at most 32 messages. Returns whether a plan or a
// stop was among them.
bool take_messages(DatagramSocket& socket, RobotGuard& guard, GuardMessage& message, double now);

// Takes the wire's readings beside the robot's states: odometry, battery, who executes the commands. `now`: by
// the clock of its ticks. Called before each tick.
void take_readings(RobotWire& wire, RobotGuard& guard, double now);

// Runs until `go_on`, called after each tick, is false. `planner` may be null. `period` of ticks [s].
void run_guard(RobotGuard& guard, RobotWire& wire, DatagramSocket* planner, double period,
               const std::function<bool(double now)>& go_on);

}  // namespace duet
