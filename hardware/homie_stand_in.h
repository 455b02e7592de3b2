// A stand-in for HOMIE's two processes, for tests and for `duet-g1-services`: what they take, how they understand it,
// and the defects that whoever steers them has to reckon with - no check of age, order or limits. No policy: the legs
// keep a pose. Facts: docs/hardware.md, "Executors". A pure function of what it is given. One owner, one thread.
#pragma once

#include <optional>

#include "duet/hardware/lcm_message.h"
#include "duet/hardware/low_level_frame.h"

namespace duet {

// Counts of the messages that came, and their gaps.
struct HomieTraffic {
  long pedals = 0, arms = 0, hands = 0;  // messages
  long refused = 0;                      // of these channels, with another fingerprint or length
  double longest_gap = 0.0;              // between two pedal commands [s]
  double last_pedal = kNever;
};

class HomieStandIn {
 public:
  // A datagram of the group.
  void receive(std::span<const std::byte> datagram, double now);
  // The command that its controller writes 200 times a second. Before any arm target the arms go to 0.
  void write_command(std::uint8_t mode_machine, LowCommandFrame& frame);
  // Writes what HOMIE's controller echoes; returns the datagram's length.
  static std::size_t write_echo(const RobotReading& reading, std::uint32_t sequence, LcmBuffer& buffer);

  [[nodiscard]] const std::array<double, 4>& velocity() const { return velocity_; }  // the last, however old
  [[nodiscard]] const HomieTraffic& traffic() const { return traffic_; }
  [[nodiscard]] bool has_arms() const { return arms_.has_value(); }

 private:
  std::array<double, 4> velocity_{0.0, 0.0, 0.0, 0.74};
  std::optional<ArmAction> arms_;
  HomieTraffic traffic_;
  JointCommand joints_;
};

}  // namespace duet
