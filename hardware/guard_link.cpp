#include "duet/hardware/guard_link.h"

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "duet/hardware/guard_loop.h"

namespace duet {
namespace {

constexpr auto kReportLook = std::chrono::microseconds(100);  // between two looks for a report
constexpr int kLookEvery = 10;                                // reports between two looks for a planner

template <typename Message>
bool send_message(DatagramSocket& socket, const Message& message, GuardBuffer& buffer) {
  const std::size_t size = encode(message, buffer);
  return socket.send(std::span<const std::byte>(buffer).first(size));
}

}  // namespace

SocketGuardLink::SocketGuardLink(const std::string& socket, double patience)
    : socket_(socket),
      patience_(patience),
      to_(DatagramSocket::to_path(socket)),
      from_(DatagramSocket::at_path(report_path(socket))) {}

bool SocketGuardLink::send(const PlannerMessage& message) { return send_message(to_, message, buffer_); }
bool SocketGuardLink::send(const PersonMessage& message) { return send_message(to_, message, buffer_); }
bool SocketGuardLink::stop() {
  const std::size_t size = encode_stop(buffer_);
  return to_.send(std::span<const std::byte>(buffer_).first(size));
}

bool SocketGuardLink::next(GuardReport& report) {
  ReportBuffer buffer;
  const double begin = monotonic_seconds();
  while (monotonic_seconds() - begin < patience_) {
    const std::size_t size = from_.receive(buffer);
    if (size > 0 && decode(std::span<const std::byte>(buffer).first(size), report)) return true;
    if (size == 0) std::this_thread::sleep_for(kReportLook);
  }
  return false;
}

std::string SocketGuardLink::name() const { return fmt::format("the guard at '{}'", socket_); }

bool ReportSender::after_tick(const RobotGuard& guard) {
  if (++ticks_ % kReportEvery != 0) return false;
  if (planner_ == nullptr) {
    if (silent_-- > 0) return false;
    silent_ = kLookEvery;
    std::error_code error;
    if (!std::filesystem::exists(path_, error)) return false;
    try {
      planner_ = std::make_unique<DatagramSocket>(DatagramSocket::to_path(path_));
    } catch (const std::runtime_error&) {
      return false;
    }
  }
  fill_report(guard, report_);
  encode(report_, buffer_);
  if (planner_->send(buffer_)) return true;
  planner_.reset();  // gone, or so busy that its queue is full: the next report tries anew
  silent_ = 0;
  return false;
}

}  // namespace duet
