// Time by the clock of whoever sends: the robot's count in its states, a camera's stamp. Nothing here reads a clock. No
// allocation. One owner, one thread.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

namespace duet {

// Periods between the robot's states by its own count. The unit of the count is not known (a G1 counts milliseconds,
// a twin its states): it rises from one state to the next by the least that it ever rose.
class StateCount {
 public:
  // Periods since the state before, those that were not read included; 1 for the first, at most 50.
  double periods_to(std::uint32_t tick);

 private:
  std::uint32_t tick_ = 0, least_rise_ = std::numeric_limits<std::uint32_t>::max();
  bool any_ = false;
};

// How much later messages come than the fastest did: the way from the sender's clock to ours took that much longer. A
// delay that never was shorter cannot be told from two clocks that were set apart. The two may drift by kClockDrift: a
// delay that grows more slowly is not seen. A sender that was silent for kSenderSilence, or whose clock does not rise,
// begins anew. One that may have our own clock, and whose first message left within the last kOneClock by it, has it:
// then every delay is known, also one that never was shorter.
inline constexpr double kClockDrift = 5e-4;    // two crystals, and what a time server may slew
inline constexpr double kSenderSilence = 0.5;  // [s]
inline constexpr double kOneClock = 1.5;       // [s]

class SenderDelay {
 public:
  explicit SenderDelay(bool may_have_our_clock = false) : may_have_our_clock_(may_have_our_clock) {}

  // `sent`: by the sender's clock [s]; `received`: by ours [s]. Returns the excess of this message [s]; 0 for
  // the first.
  double see(double sent, double received);

 private:
  double least_ = 0.0, sent_ = 0.0, received_ = 0.0;  // least: of received - sent
  bool may_have_our_clock_, any_ = false;
};

// The same of the robot's states, whose count is told apart into units of a whole number of milliseconds in its first
// second; one that fits none has no excess. Steady: the least excess of the last kSteadyStates, so that one state that
// is late is none.
inline constexpr int kSteadyStates = 50;  // a tenth of a second

class StateDelay {
 public:
  void see(std::uint32_t tick, double received);
  [[nodiscard]] double steady() const;  // [s]; 0 while it is not known

 private:
  void learn_unit(std::uint32_t tick, double received);

  SenderDelay delay_;
  double unit_ = 0.0, time_ = 0.0;  // of the count; since it began [s]
  double begin_ = 0.0, received_ = 0.0;
  std::uint32_t first_ = 0, tick_ = 0;
  bool any_ = false;
  std::array<double, kSteadyStates> last_{};  // in a ring
  std::size_t next_ = 0;
};

}  // namespace duet
