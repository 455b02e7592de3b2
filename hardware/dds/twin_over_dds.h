// A twin as a process of its own, and its guard on a thread of this one: what a planner here talks to is the guard's
// socket, and what the guard talks to is DDS.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/twin/twin_model.h"
#include "duet/hardware/wire/robot_wire.h"

namespace duet {

// duet-g1-twin, for as long as this lives. One owner, one thread.
class TwinProcess {
 public:
  // Throws std::runtime_error where the program cannot be started.
  TwinProcess(const std::string& program, const std::vector<std::string>& arguments);
  ~TwinProcess();
  TwinProcess(const TwinProcess&) = delete;
  TwinProcess& operator=(const TwinProcess&) = delete;
  void send(int signal) const;

 private:
  pid_t pid_ = -1;
};

struct TwinOverDdsOptions {
  std::string program;  // duet-g1-twin
  DdsPlace place;
  TwinOptions twin;
  bool lock_step = true;
  std::vector<std::string> more;  // arguments of the twin, as "--fault"
  std::string socket;             // of the guard; made anew
};

// The program beside this one. Throws MissingError where it is not there.
std::string twin_program();

class TwinOverDds final : public GuardLink {
 public:
  // The guard is armed as soon as it is ready. Throws as open_robot_wire, RobotGuard and DatagramSocket do. `walker`
  // and `log` may be null.
  TwinOverDds(const TwinOverDdsOptions& options, const GuardSetup& setup, std::unique_ptr<Walker> walker, RunLog* log);
  ~TwinOverDds() override;

  bool send(const PlannerMessage& message) override { return link_->send(message); }
  bool send(const PersonMessage& message) override { return link_->send(message); }
  bool stop() override { return link_->stop(); }
  // Throws what ended the guard's thread.
  bool next(GuardReport& report) override;
  [[nodiscard]] double patience() const override { return link_->patience(); }
  [[nodiscard]] std::string name() const override { return link_->name(); }
  [[nodiscard]] const TwinProcess& process() const { return *process_; }

 private:
  void run_thread(const GuardSetup& setup, RunLog* log, bool lock_step);

  std::unique_ptr<TwinProcess> process_;
  std::unique_ptr<RobotWire> wire_;
  std::unique_ptr<Walker> walker_;
  NoVelocity nobody_;
  std::unique_ptr<DatagramSocket> socket_;
  ReportSender reports_;
  std::atomic<bool> ends_ = false;
  std::exception_ptr failure_;
  std::atomic<bool> failed_ = false;
  std::unique_ptr<SocketGuardLink> link_;
  std::thread thread_;
};

}  // namespace duet
