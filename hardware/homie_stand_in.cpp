#include "duet/hardware/homie_stand_in.h"

#include <algorithm>
#include <cstring>

namespace duet {
namespace {

constexpr int kFirstArm = 15;
constexpr double kLegPose[6] = {-0.1, 0.0, 0.0, 0.3, -0.2, 0.0};
// Its gains: a leg, the waist, an arm.
constexpr double kLegStiffness[6] = {150, 150, 150, 300, 40, 40}, kLegDamping[6] = {2, 2, 2, 4, 2, 2};
constexpr double kWaistStiffness = 300, kWaistDamping = 5;
constexpr double kArmGains[7] = {150, 150, 150, 100, 10, 10, 5}, kArmDampings[7] = {4, 4, 4, 1, 0.5, 0.5, 0.5};

// The name behind magic and sequence number; empty where there is none.
std::string_view channel_of(std::span<const std::byte> datagram) {
  constexpr std::size_t kHead = 8;
  if (datagram.size() <= kHead) return {};
  const auto* text = reinterpret_cast<const char*>(datagram.data()) + kHead;
  const void* end = std::memchr(text, 0, datagram.size() - kHead);
  return end == nullptr ? std::string_view() : std::string_view(text, static_cast<const char*>(end) - text);
}

JointCommand homie_command() {
  JointCommand command;
  for (Eigen::VectorXd* values : {&command.q_target, &command.kp, &command.kd, &command.tau_ff})
    values->setZero(kG1Motors);
  for (int j = 0; j < 12; ++j) {
    command.q_target[j] = kLegPose[j % 6];
    command.kp[j] = kLegStiffness[j % 6];
    command.kd[j] = kLegDamping[j % 6];
  }
  for (int j = 12; j < kFirstArm; ++j) {
    command.kp[j] = kWaistStiffness;
    command.kd[j] = kWaistDamping;
  }
  for (int j = kFirstArm; j < kG1Motors; ++j) {
    command.kp[j] = kArmGains[(j - kFirstArm) % 7];
    command.kd[j] = kArmDampings[(j - kFirstArm) % 7];
  }
  return command;
}

}  // namespace

void HomieStandIn::receive(std::span<const std::byte> datagram, double now) {
  const std::string_view channel = channel_of(datagram);
  PedalCommand pedal;
  ArmAction arms;
  if (channel == PedalCommand::kChannel) {
    if (!decode(datagram, pedal).refusal.empty()) {
      ++traffic_.refused;
      return;
    }
    velocity_ = pedal.command;
    ++traffic_.pedals;
    if (traffic_.last_pedal != kNever) traffic_.longest_gap = std::max(traffic_.longest_gap, now - traffic_.last_pedal);
    traffic_.last_pedal = now;
  } else if (channel == ArmAction::kChannel) {
    if (!decode(datagram, arms).refusal.empty()) {
      ++traffic_.refused;
      return;
    }
    arms_ = arms;
    ++traffic_.arms;
  } else if (channel == "hand_action") {
    ++traffic_.hands;
  }
}

void HomieStandIn::write_command(std::uint8_t mode_machine, LowCommandFrame& frame) {
  if (joints_.q_target.size() == 0) joints_ = homie_command();
  if (arms_)
    for (int j = 0; j < kLcmArmJoints; ++j) joints_.q_target[kFirstArm + j] = arms_->act[static_cast<std::size_t>(j)];
  build_command(joints_, mode_machine, frame);
}

std::size_t HomieStandIn::write_echo(const RobotReading& reading, std::uint32_t sequence, LcmBuffer& buffer) {
  BodyControlData body;
  for (std::size_t j = 0; j < kLcmJoints; ++j) {
    body.q[j] = static_cast<float>(reading.state.q[static_cast<Eigen::Index>(j)]);
    body.qd[j] = static_cast<float>(reading.state.v[static_cast<Eigen::Index>(j)]);
  }
  return encode(body, sequence, buffer);
}

}  // namespace duet
