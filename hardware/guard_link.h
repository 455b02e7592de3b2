// A planner's way to the guard and back, be it in another process or in this one. One owner, one thread.
#pragma once

#include <memory>
#include <string>

#include "duet/hardware/datagram_socket.h"
#include "duet/hardware/guard_message.h"
#include "duet/hardware/guard_report.h"

namespace duet {

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

}  // namespace duet
