// The clock that walking networks are shown, and the gate that tells when a command is one to stand. Nothing allocates
// after construction.
#pragma once

#include <optional>
#include <vector>

namespace duet {

// A command below both is one to stand.
struct StandBounds {
  double speed = 0.0;     // in the plane [m/s]
  double yaw_rate = 0.0;  // [rad/s]
};

// Whether a walker is told to stand, and since when it walks.
class StandGate {
 public:
  explicit StandGate(const std::optional<StandBounds>& bounds = {}) : bounds_(bounds) {}  // none: never to stand

  void reset() { walking_tick_ = -1; }
  // The command of a tick: velocity in the plane [m/s] and yaw rate [rad/s].
  void update(double forward, double lateral, double yaw_rate);

  [[nodiscard]] bool stands() const { return stands_; }              // of the last update
  [[nodiscard]] long walking_tick() const { return walking_tick_; }  // 0 at the first tick of walking

 private:
  std::optional<StandBounds> bounds_;
  bool stands_ = false;
  long walking_tick_ = -1;
};

struct GaitClock {
  double frequency_hz = 0.0;
  std::vector<double> phases{};    // at the start [rad]
  std::vector<double> standing{};  // phases held while told to stand, one each; empty: the clock goes on
  std::optional<double> stance{};  // share of a turn, in (0, 1), that takes the first half of the wave
};

// Angle of one of the clock's phases [rad]. `tick`: since the start. With `standing` the clock starts at its phases
// whenever the gate lets it go.
double gait_angle(const GaitClock& clock, std::size_t phase, long tick, const StandGate& gate);

}  // namespace duet
