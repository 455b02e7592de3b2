// Messages over one connected stream socket, with a deadline for each call: never blocks past it, never raises SIGPIPE.
// One owner, not thread-safe.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "duet/policies/external/message.h"

namespace duet {

using Deadline = std::chrono::steady_clock::time_point;

class MessageSocket {
 public:
  enum class Result {
    kDone,
    kLate,    // not by the deadline
    kClosed,  // the other side is gone
  };

  // Owns `descriptor` and makes it non-blocking.
  explicit MessageSocket(int descriptor);
  // Asked several times a second while a call waits; where it is true the call ends with kLate.
  void stop_when(std::function<bool()> stop_asked) { stop_asked_ = std::move(stop_asked); }
  ~MessageSocket();
  MessageSocket(const MessageSocket&) = delete;
  MessageSocket& operator=(const MessageSocket&) = delete;

  // kLate: the message is not sent, or its rest follows with the next call. What an earlier call left goes first.
  Result send(std::string_view message, Deadline deadline);
  // Throws InputError as MessageBuffer::next.
  Result receive(std::string& message, Deadline deadline);

 private:
  Result flush(Deadline deadline);
  [[nodiscard]] Result wait(short events, Deadline deadline) const;

  int descriptor_;
  std::function<bool()> stop_asked_;
  std::string outgoing_;
  MessageBuffer incoming_;
};

// Two ends of a local connection, closed on exec. Throws std::runtime_error.
struct SocketPair {
  int ours = -1, theirs = -1;
};
SocketPair connected_pair();

// Connects to a server: the path of a local socket, or "host:port" (TCP). Throws MissingError naming it and the reason.
int connect_to(const std::string& address, Deadline deadline);

}  // namespace duet
