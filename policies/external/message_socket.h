// Messages over one connected stream socket, with a deadline for each call: never blocks past it, never raises SIGPIPE.
// Time in which this process was stopped does not count (core/awake_time.h): the answer may lie there since.
// One owner, not thread-safe.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <utility>

#include "duet/core/awake_time.h"
#include "duet/policies/external/message.h"

namespace duet {

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

  // kLate: the message is not sent, or its rest follows with the next call. The rest of an earlier call goes first.
  Result send(std::string_view message, AwakeDeadline& deadline);
  // Throws InputError as MessageBuffer::next.
  Result receive(std::string& message, AwakeDeadline& deadline);

 private:
  Result flush(AwakeDeadline& deadline);
  [[nodiscard]] Result wait(short events, AwakeDeadline& deadline) const;

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
int connect_to(const std::string& address, AwakeDeadline& deadline);

}  // namespace duet
