#include "duet/hardware/twin_operator.h"

#include <algorithm>

namespace duet {
namespace {

constexpr double kDampedFor = 0.5;     // until it is stood up [s]
constexpr double kHungFor = 1.0;       // held by its motors, until the rope is let down [s]
constexpr double kStillFor = 0.5;      // that the arms' targets rest before [s]
constexpr double kLetDownFor = 1.0;    // until the rope is slack [s]
constexpr double kStoodFor = 1.0;      // on its feet, until it is told to run [s]
constexpr double kPressed = 0.1;       // [s]
constexpr double kPressedEvery = 0.5;  // [s]

std::uint16_t bit(RemoteKey key) { return static_cast<std::uint16_t>(1u << static_cast<int>(key)); }

}  // namespace

void TwinOperator::tick(double time, TwinModel& twin) {
  look(time, twin);
  press(time, twin);
  if (twin.physics() == nullptr) return;
  const double left = let_down_at_ == kNever ? 1.0 : 1.0 - (time - let_down_at_) / kLetDownFor;
  twin.physics()->hang(std::clamp(left, 0.0, 1.0));
}

void TwinOperator::look(double time, const TwinModel& twin) {
  const MotorCommandFrame& motor = twin.last_command().motor[0];
  const bool damped = motor.mode == 1 && motor.kp == 0.0f, held = motor.mode == 1 && motor.kp > 0.0f;
  if (!damped) damped_since_ = time;
  if (!held) held_since_ = time;
  for (const std::vector<int>& arm : twin.robot().roles.arms)
    for (const int joint : arm) {
      const float target = twin.last_command().motor[joint].q;
      if (target != targets_[joint]) still_since_ = time;
      targets_[joint] = target;
    }
  if (!held)
    let_down_at_ = kNever;
  else if (let_down_at_ == kNever && time - held_since_ > kHungFor && time - still_since_ > kStillFor)
    let_down_at_ = time;
}

void TwinOperator::press(double time, TwinModel& twin) {
  const bool press_start = !stood_ && time - damped_since_ > kDampedFor;
  const bool stands = let_down_at_ != kNever && time - let_down_at_ > kLetDownFor + kStoodFor;
  if (press_start || (stands && time >= next_press_)) {
    pressed_ = press_start ? RemoteKey::kStart : RemoteKey::kA;
    pressed_until_ = time + kPressed;
    next_press_ = time + kPressedEvery;
    stood_ = true;
  }
  twin.remote.keys = bit(RemoteKey::kR1);
  if (time < pressed_until_) twin.remote.keys |= bit(pressed_);
}

}  // namespace duet
