// Messages between duet and the process of a policy (docs/extending.md, "Messages"): a length of four bytes,
// little-endian, and as many bytes of JSON. Bytes and texts only; nothing here reads or writes a socket.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

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

}  // namespace duet
