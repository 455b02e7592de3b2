#include "duet/hardware/twin/twin_operator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <stdexcept>

#include "duet/core/names.h"
#include "duet/core/require.h"

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
  if (held && let_down_at_ == kNever && time - held_since_ > kHungFor && time - still_since_ > kStillFor)
    let_down_at_ = time;
}

void TwinOperator::press(double time, TwinModel& twin) {
  const bool press_start = !stood_ && time - damped_since_ > kDampedFor;
  const bool stands = asks_ && let_down_at_ != kNever && time - let_down_at_ > kLetDownFor + kStoodFor;
  if (press_start || (stands && time >= next_press_)) {
    const bool starts = press_start || (!stood_ && pressed_ != RemoteKey::kStart);
    pressed_ = starts ? RemoteKey::kStart : RemoteKey::kA;
    pressed_until_ = time + kPressed;
    next_press_ = time + kPressedEvery;
    stood_ = stood_ || press_start;
  }
  twin.remote.keys = bit(RemoteKey::kR1);
  if (time < pressed_until_) twin.remote.keys |= bit(pressed_);
}

namespace {

constexpr std::array<std::string_view, 11> kFaultNames = {"drop", "delay",       "flip",     "freeze", "nan",   "hot",
                                                          "tilt", "remote_lost", "dead_man", "mode",   "charge"};

[[noreturn]] void refuse(const std::string& text) {
  throw std::invalid_argument(fmt::format(
      "twin fault: expected KIND@BEGIN:END or KIND@BEGIN:END=VALUE, for example 'drop@3:5=100', found '{}'", text));
}

double number_in(std::string_view part, const std::string& text) {
  const std::optional<double> value = parse_number(part);
  if (!value || *value < 0.0) refuse(text);
  return *value;
}

}  // namespace

std::vector<std::string> twin_fault_names() { return {kFaultNames.begin(), kFaultNames.end()}; }

TwinFault parse_twin_fault(const std::string& text) {
  const std::size_t at = text.find('@'), colon = text.find(':'), equals = text.find('=');
  if (at == std::string::npos || colon == std::string::npos || colon < at) refuse(text);
  const std::string kind = text.substr(0, at);
  const auto known = std::ranges::find(kFaultNames, kind);
  if (known == kFaultNames.end())
    throw std::invalid_argument(unknown_name_message("twin fault", kind, twin_fault_names()));
  const std::string_view all = text;
  const std::size_t end = equals == std::string::npos ? text.size() : equals;
  if (end < colon) refuse(text);
  TwinFault fault{.kind = static_cast<TwinFaultKind>(known - kFaultNames.begin()),
                  .begin = number_in(all.substr(at + 1, colon - at - 1), text),
                  .end = number_in(all.substr(colon + 1, end - colon - 1), text)};
  if (equals != std::string::npos) fault.value = number_in(all.substr(equals + 1), text);
  if (fault.end <= fault.begin) refuse(text);
  return fault;
}

FaultyTwin::FaultyTwin(TwinModel& twin, std::vector<TwinFault> faults, std::uint64_t seed)
    : twin_(twin), faults_(std::move(faults)), random_(seed, stream_key({"twin faults"})) {}

const TwinFault* FaultyTwin::active(TwinFaultKind kind, double time) const {
  const auto found = std::ranges::find_if(
      faults_, [&](const TwinFault& f) { return f.kind == kind && time >= f.begin && time < f.end; });
  return found == faults_.end() ? nullptr : &*found;
}

void FaultyTwin::set_condition(double time) {
  const TwinFault* hot = active(TwinFaultKind::kHot, time);
  const TwinFault* tilt = active(TwinFaultKind::kTilt, time);
  twin_.condition.winding = hot != nullptr ? hot->value : TwinCondition{}.winding;
  twin_.condition.roll = tilt != nullptr ? tilt->value : 0.0;
  const TwinFault* charge = active(TwinFaultKind::kCharge, time);
  twin_.condition.charge = charge != nullptr ? charge->value : TwinCondition{}.charge;
  twin_.condition.mode_machine_offset = active(TwinFaultKind::kMode, time) != nullptr ? 1 : 0;
  twin_.remote.heard = active(TwinFaultKind::kRemoteLost, time) == nullptr;
  if (active(TwinFaultKind::kDeadMan, time) != nullptr)
    twin_.remote.keys &= static_cast<std::uint16_t>(~(1u << static_cast<int>(RemoteKey::kR1)));
}

void FaultyTwin::spoil(double time, LowStateFrame& frame) {
  if (active(TwinFaultKind::kFreeze, time) != nullptr) {
    frame.tick = last_tick_;
    seal(frame);
  }
  last_tick_ = frame.tick;
  if (active(TwinFaultKind::kNan, time) != nullptr) {
    frame.motor[0].q = std::numeric_limits<float>::quiet_NaN();
    seal(frame);
  }
  const TwinFault* flip = active(TwinFaultKind::kFlip, time);
  if (flip != nullptr && random_.chance(0.01 * flip->value)) frame.motor[random_.below(kFrameMotors)].sensor[0] ^= 1u;
}

bool FaultyTwin::next_state(double time, LowStateFrame& frame) {
  set_condition(time);
  twin_.write_state(frame);
  spoil(time, frame);
  const TwinFault* drop = active(TwinFaultKind::kDrop, time);
  if (drop != nullptr && random_.chance(0.01 * drop->value)) return false;
  const TwinFault* delay = active(TwinFaultKind::kDelay, time);
  if (delay == nullptr && late_.empty()) return true;
  late_.push_back({time + (delay != nullptr ? 1e-3 * delay->value : 0.0), frame});
  if (late_.front().leaves > time) return false;
  frame = late_.front().frame;
  late_.pop_front();
  return true;
}

}  // namespace duet
