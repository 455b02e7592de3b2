// Messages between duet and the process of a policy (docs/extending.md, "Messages"): a length of four bytes,
// little-endian, and as many bytes of JSON. Bytes and texts only; nothing here reads or writes a socket.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/machine.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/policy.h"

namespace duet {

inline constexpr int kPolicyMessageVersion = 1;
inline constexpr std::size_t kLargestPolicyMessage = std::size_t{1} << 20;  // [bytes]

// A message from a process.
struct PolicyMessage {
  enum class Type { kHello, kReady, kPlan };
  Type type = Type::kReady;
  int version = 0;                  // of kHello
  std::vector<std::string> joints;  // of kHello: what it takes the order of joints to be; empty: not said
  int tick = 0;                     // of kPlan: of the observation that it answers
  std::vector<float> numbers;       // of kPlan: anchor by anchor
  int anchors = 0;                  // of kPlan
};

// Throws InputError (key, expected, found): not JSON, an unknown type, a missing or superfluous key, a value of another
// type, anchors of different sizes. Numbers are not judged here (PlanDecoder does).
PolicyMessage parse_policy_message(std::string_view text);
std::string_view to_string(PolicyMessage::Type type);

// The messages that duet sends.
std::string hello_message(const PolicyDescriptor& descriptor, const RobotModel& robot,
                          const std::vector<std::string>& joints);
std::string reset_message(const EpisodeContext& context);
// `numbers`: frame by frame, oldest first.
std::string observe_message(int tick, const std::vector<float>& numbers, int frames);
std::string bye_message();

// The length in front of a message.
std::string framed(std::string_view message);

// Cuts a stream of bytes into messages.
class MessageBuffer {
 public:
  void append(std::string_view bytes) { bytes_ += bytes; }
  // The next complete message. Throws InputError for a length above kLargestPolicyMessage: the stream is of no use any
  // more.
  std::optional<std::string> next();

 private:
  std::string bytes_;
};

// Messages over one connected stream socket, with a deadline for each call: never blocks past it, never raises SIGPIPE.
// Time in which this process was stopped does not count (core/machine.h): the answer may lie there since.
// One owner, not thread-safe.

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
