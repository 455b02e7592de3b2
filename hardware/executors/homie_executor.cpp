#include "duet/hardware/executors/homie_executor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace duet {
namespace {

constexpr double kHomiePeriod = 0.02;  // of its policy [s]
constexpr double kSteeredFor = 0.5;    // for which another sender counts [s]
constexpr int kGoodbyes = 5;           // datagrams get lost
constexpr int kMostDatagrams = 64;     // of a tick
constexpr int kFirstArmMotor = 15;

}  // namespace

HomieExecutor::HomieExecutor(const LcmPlace& place, double height, double period)
    : channel_(place),
      height_(height),
      ticks_between_(std::max(1, static_cast<int>(std::lround(kHomiePeriod / period)))) {}

HomieExecutor::~HomieExecutor() { close(); }

void HomieExecutor::poll(double now) {
  now_ = now;
  BodyControlData body;
  PdTargets targets;
  PedalCommand pedal;
  ArmAction arms;
  for (int k = 0; k < kMostDatagrams; ++k) {
    bool own = false;
    const std::size_t size = channel_.receive(buffer_, own);
    if (size == 0) return;
    const auto datagram = std::span<const std::byte>(buffer_).first(size);
    if (decode(datagram, body).refusal.empty())
      echoed_at_ = now;
    else if (decode(datagram, targets).refusal.empty())
      hear_policy(targets, now);
    else if (!own && (decode(datagram, pedal).refusal.empty() || decode(datagram, arms).refusal.empty()))
      steered_at_ = now;
  }
}

// A message that comes again is no sign of life.
void HomieExecutor::hear_policy(const PdTargets& targets, double now) {
  if (targets.timestamp_us != stamp_) policy_at_ = now;
  stamp_ = targets.timestamp_us;
}

std::string HomieExecutor::complaint() const {
  if (echoed_at_ == kNever) return "HOMIE's controller has not been heard (LCM channel 'body_control_data')";
  if (!(now_ - policy_at_ < kHomieAges.hold)) return "HOMIE's policy is not heard (LCM channel 'pd_plustau_targets')";
  if (now_ - steered_at_ < kSteeredFor) return "somebody else steers HOMIE ('pedal_command' or 'arm_action')";
  if (writers_ != 1) return fmt::format("expected one writer of commands, HOMIE's controller, found {}", writers_);
  return "";
}

int HomieExecutor::foreign_writers(int command_writers) {
  writers_ = command_writers;
  return std::max(command_writers - 1, 0) + (now_ - steered_at_ < kSteeredFor ? 1 : 0);
}

void HomieExecutor::close() {
  if (!open_) return;
  for (int k = 0; k < kGoodbyes; ++k) publish({0.0, 0.0, 0.0, height_});
  open_ = false;
}

// A frame that damps has no targets: HOMIE keeps the last ones.
bool HomieExecutor::write(const LowCommandFrame& frame) {
  if (!open_) return false;
  bool damps = true;
  for (int j = 0; j < kLcmArmJoints; ++j) damps = damps && frame.motor[kFirstArmMotor + j].kp == 0.0f;
  if (damps) return true;
  for (int j = 0; j < kLcmArmJoints; ++j) arms_.act[static_cast<std::size_t>(j)] = frame.motor[kFirstArmMotor + j].q;
  has_arms_ = true;
  return true;
}

void HomieExecutor::send(const VelocityCommand& velocity) {
  if (open_ && ticks_++ % ticks_between_ == 0) publish(velocity);
}

void HomieExecutor::publish(const VelocityCommand& velocity) {
  const PedalCommand pedal{{velocity.forward, velocity.lateral, velocity.yaw_rate / kHomieYawShare, velocity.height}};
  (void)channel_.send(std::span<const std::byte>(buffer_).first(encode(pedal, sequence_++, buffer_)));
  if (has_arms_) (void)channel_.send(std::span<const std::byte>(buffer_).first(encode(arms_, sequence_++, buffer_)));
}

}  // namespace duet
