// The messages of HOMIE's processes in the form of LCM, written here from its published format: no library. A datagram
// is "LC02", a sequence number, the channel's name with a 0 behind it, the fingerprint of the type, the fields; all
// big-endian. The two messages that steer the robot carry neither a time nor a checksum: whoever receives them cannot
// notice that they stopped. Pure functions without allocation; thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace duet {

inline constexpr int kLcmJoints = 29;
inline constexpr int kLcmArmJoints = 14;  // motors 15 to 28

// The share of a rate of turn that HOMIE makes of the one it is told: its deployment scales by 0.25 what its training
// scaled by 0.5.
inline constexpr double kHomieYawShare = 0.5;

// Channel "pedal_command": velocity and height, in the heading frame; the rate of turn in 1 / kHomieYawShare of what is
// meant. [m/s, m/s, rad/s, m]
struct PedalCommand {
  static constexpr std::string_view kChannel = "pedal_command";
  std::array<double, 4> command{};
};
// Channel "arm_action": targets [rad]. Channel "hand_action" has a type of the same fingerprint: only the channel's
// name tells them apart.
struct ArmAction {
  static constexpr std::string_view kChannel = "arm_action";
  std::array<double, kLcmArmJoints> act{};
};
// Channel "pd_plustau_targets": what HOMIE's policy sends to its controller. [rad], [N m], [us]
struct PdTargets {
  static constexpr std::string_view kChannel = "pd_plustau_targets";
  std::array<double, kLcmJoints> q_des{}, tau_ff{};
  std::int64_t timestamp_us = 0;
};
// Channel "body_control_data": what its controller measured; the time is never set. [rad], [rad/s]
struct BodyControlData {
  static constexpr std::string_view kChannel = "body_control_data";
  std::array<float, kLcmJoints> q{}, qd{};
  std::int64_t timestamp_us = 0;
};

inline constexpr std::size_t kMostLcmBytes = 1024;
using LcmBuffer = std::array<std::byte, kMostLcmBytes>;

// The datagram's length in `buffer`.
std::size_t encode(const PedalCommand& message, std::uint32_t sequence, LcmBuffer& buffer);
std::size_t encode(const ArmAction& message, std::uint32_t sequence, LcmBuffer& buffer);
std::size_t encode(const PdTargets& message, std::uint32_t sequence, LcmBuffer& buffer);
std::size_t encode(const BodyControlData& message, std::uint32_t sequence, LcmBuffer& buffer);

// The sequence number, or why the datagram is not such a message, as a sentence.
struct LcmReading {
  std::uint32_t sequence = 0;
  std::string_view refusal = {};  // empty: `message` was set
};
LcmReading decode(std::span<const std::byte> datagram, PedalCommand& message);
LcmReading decode(std::span<const std::byte> datagram, ArmAction& message);
LcmReading decode(std::span<const std::byte> datagram, PdTargets& message);
LcmReading decode(std::span<const std::byte> datagram, BodyControlData& message);

// The hash of a type's fields; on the wire it is turned left by one bit. Source: LCM, "type specification".
struct LcmField {
  std::string_view name, type;
  int count = 0;  // of an array; 0: a single value
};
std::uint64_t lcm_hash(std::span<const LcmField> fields);

// A group of UDP multicast as LCM uses it, on one named interface: every message of HOMIE's processes passes here as
// one datagram. A message of LCM in fragments is longer than any of them, and is refused by its reader. Nothing blocks.
// One owner, one thread.

struct LcmPlace {
  std::string group = "239.255.76.67";
  int port = 7667;
  std::string interface = "lo";  // by name; HOMIE's own processes take that of the route to the group
  int hops = 0;                  // 0: this machine only
};

class LcmChannel {
 public:
  // Throws std::runtime_error naming the group and the interface where it cannot be joined.
  explicit LcmChannel(const LcmPlace& place);
  ~LcmChannel();
  LcmChannel(const LcmChannel&) = delete;
  LcmChannel& operator=(const LcmChannel&) = delete;

  // False where it was not sent.
  bool send(std::span<const std::byte> datagram);
  // The length of the next datagram, 0 where none waits. `own`: it is ours, which the group gives back.
  std::size_t receive(std::span<std::byte> buffer, bool& own);

 private:
  void join(const LcmPlace& place);
  void connect_to(const LcmPlace& place);

  int sends_ = -1, receives_ = -1;
  std::uint32_t own_address_ = 0;  // network byte order
  std::uint16_t own_port_ = 0;
};

}  // namespace duet
