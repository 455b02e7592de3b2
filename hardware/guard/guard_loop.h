// The guard in real time: the only place that reads a clock. Every 2 ms it takes what came over the local socket and
// the wire, and ticks. One thread.
#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <string>

#include "duet/core/machine.h"
#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/guard/robot_guard.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/robot_wire.h"

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

// Calls `run`; where it throws while the robot is commanded, `damp` has to go on ticking the guard, which has been told
// to stop, until its operator ends that. Then the exception goes on.
void run_or_damp(RobotGuard& guard, const std::function<void()>& run,
                 const std::function<void(const std::exception&)>& damp);

// A planner's way to the guard and back, be it in another process or in this one. One owner, one thread.

class TwinInProcess;

class GuardLink {
 public:
  virtual ~GuardLink() = default;
  // False where nobody takes it any more.
  virtual bool send(const PlannerMessage& message) = 0;
  virtual bool send(const PersonMessage& message) = 0;
  virtual bool stop() = 0;
  // Waits for the guard's next report, 20 ms after the last by its clock; false where none came for `patience()`.
  virtual bool next(GuardReport& report) = 0;
  [[nodiscard]] virtual double patience() const = 0;  // [s]
  // The name for messages: "the guard at 'duet-guard.socket'".
  [[nodiscard]] virtual std::string name() const = 0;
  // The twin behind the guard, where both are in this process; null.
  virtual TwinInProcess* in_process() { return nullptr; }
};

// A link over the guard's local socket.
class SocketGuardLink final : public GuardLink {
 public:
  // Throws std::runtime_error where no guard receives at `socket`, and where another planner has its reports.
  explicit SocketGuardLink(const std::string& socket, double patience = 2.0);

  bool send(const PlannerMessage& message) override;
  bool send(const PersonMessage& message) override;
  bool stop() override;
  bool next(GuardReport& report) override;
  [[nodiscard]] double patience() const override { return patience_; }
  [[nodiscard]] std::string name() const override;

 private:
  std::string socket_;
  double patience_;
  DatagramSocket to_, from_;
  GuardBuffer buffer_{};
};

// The guard's end: sends a report every kReportEvery ticks to whoever waits for them.
class ReportSender {
 public:
  explicit ReportSender(const std::string& socket) : path_(report_path(socket)) {}
  // After each tick; whether a report went out.
  bool after_tick(const RobotGuard& guard);

 private:
  std::string path_;
  std::unique_ptr<DatagramSocket> planner_;
  GuardReport report_;
  ReportBuffer buffer_{};
  long ticks_ = 0;
  int silent_ = 0;  // reports until it looks again whether a planner is there
};

// How soon the scheduler lets this process run when its time has come.

// Timers of this thread, and of those that it makes from now on, wake up on time, as far as the scheduler lets them;
// nothing where the kernel refuses.
void ask_for_sharp_timers();

// The same, and they go before everything that has no such priority (SCHED_FIFO): the guard's tick, and the threads of
// DDS, where they are made afterwards. False where the system refuses; it takes CAP_SYS_NICE or a limit `rtprio`. Then
// a machine with other work to do is late, and the robot is held.
bool ask_for_real_time();

}  // namespace duet
