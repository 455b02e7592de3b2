#include "duet/hardware/twin/fakes.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "duet/core/require.h"
#include "duet/hardware/executors/homie_executor.h"
#include "duet/hardware/wire/low_level_frame.h"

namespace duet {
namespace {

constexpr int kFirstArm = 15;
constexpr double kLegPose[6] = {-0.1, 0.0, 0.0, 0.3, -0.2, 0.0};
// Its gains: a leg, the waist, an arm.
constexpr double kLegStiffness[6] = {150, 150, 150, 300, 40, 40}, kLegDamping[6] = {2, 2, 2, 4, 2, 2};
constexpr double kWaistStiffness = 300, kWaistDamping = 5;

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
    const auto of_arm = static_cast<std::size_t>((j - kFirstArm) % 7);
    command.kp[j] = kHomieArmStiffness[of_arm];
    command.kd[j] = kHomieArmDamping[of_arm];
  }
  return command;
}

}  // namespace

void FakeHomie::receive(std::span<const std::byte> datagram, double now) {
  const std::string_view channel = channel_of(datagram);
  PedalCommand pedal;
  ArmAction arms;
  if (channel == PedalCommand::kChannel) {
    if (!decode(datagram, pedal).refusal.empty()) {
      ++traffic_.refused;
      return;
    }
    velocity_ = pedal.command;
    velocity_[2] *= kHomieYawShare;
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

void FakeHomie::write_command(std::uint8_t mode_machine, LowCommandFrame& frame) {
  if (joints_.q_target.size() == 0) joints_ = homie_command();
  if (arms_)
    for (int j = 0; j < kLcmArmJoints; ++j) joints_.q_target[kFirstArm + j] = arms_->act[static_cast<std::size_t>(j)];
  build_command(joints_, mode_machine, frame);
}

std::size_t FakeHomie::write_targets(double now, std::uint32_t sequence, LcmBuffer& buffer) {
  PdTargets targets;
  for (std::size_t j = 0; j < 12; ++j) targets.q_des[j] = kLegPose[j % 6];
  targets.timestamp_us = static_cast<std::int64_t>(1e6 * now);
  return encode(targets, sequence, buffer);
}

std::size_t FakeHomie::write_echo(const RobotReading& reading, std::uint32_t sequence, LcmBuffer& buffer) {
  BodyControlData body;
  for (std::size_t j = 0; j < kLcmJoints; ++j) {
    body.q[j] = static_cast<float>(reading.state.q[static_cast<Eigen::Index>(j)]);
    body.qd[j] = static_cast<float>(reading.state.v[static_cast<Eigen::Index>(j)]);
  }
  return encode(body, sequence, buffer);
}

namespace {

constexpr int kFirstArmOfTopic = 15, kMotorOfWeight = 29;
constexpr std::int32_t kUnknownCall = 3203, kWrongParameter = 3104;

}  // namespace

FakeSport::FakeSport(JointCommand stance, int fsm)
    : stance_(std::move(stance)),
      joints_(stance_),
      fsm_(fsm),
      arms_(stance_.q_target),
      arms_kp_(stance_.kp),
      arms_kd_(stance_.kd) {}

RpcResponse FakeSport::answer(const RpcRequest& request, double now) {
  RpcResponse response{.id = request.id, .api = static_cast<std::int64_t>(request.call), .code = 0, .data = ""};
  if (request.call == ServiceCall::kGetFsm) {
    response.data = R"({"data":)" + std::to_string(fsm_) + "}";
    return response;
  }
  const std::optional<SportOrder> order = order_of(request.call, request.parameter.data());
  if (request.call != ServiceCall::kSetFsm && request.call != ServiceCall::kSetVelocity)
    response.code = kUnknownCall;
  else if (!order)
    response.code = kWrongParameter;
  else if (request.call == ServiceCall::kSetFsm)
    fsm_ = order->fsm;
  else if (fsm_walks(fsm_)) {
    order_ = *order;
    ordered_at_ = now;
  }
  refused_ += response.code != 0 ? 1 : 0;
  return response;
}

void FakeSport::obey_arms(const LowCommandFrame& frame) {
  if (frame.crc != checksum_of(frame) || frame.mode_pr != kPitchRollMode) {
    ++refused_;
    return;
  }
  weight_ = std::clamp(static_cast<double>(frame.motor[kMotorOfWeight].q), 0.0, 1.0);
  for (int j = kFirstArmOfTopic; j < kG1Motors; ++j) {
    arms_[j] = frame.motor[j].q;
    arms_kp_[j] = frame.motor[j].kp;
    arms_kd_[j] = frame.motor[j].kd;
  }
}

VelocityCommand FakeSport::velocity(double now) const {
  const bool lasts = fsm_walks(fsm_) && now - ordered_at_ < order_.duration;
  return lasts ? order_.velocity : VelocityCommand{};
}

void FakeSport::write_command(std::uint8_t mode_machine, LowCommandFrame& frame) {
  if (fsm_ == kFsmDamp) return build_damping(kDampingGain, mode_machine, frame);
  joints_ = stance_;
  for (int j = kFirstArmOfTopic; j < kG1Motors; ++j) {
    joints_.q_target[j] += weight_ * (arms_[j] - stance_.q_target[j]);
    joints_.kp[j] += weight_ * (arms_kp_[j] - stance_.kp[j]);
    joints_.kd[j] += weight_ * (arms_kd_[j] - stance_.kd[j]);
  }
  build_command(joints_, mode_machine, frame);
}

RpcResponse FakeSwitcher::answer(const RpcRequest& request) {
  RpcResponse response{.id = request.id, .api = static_cast<std::int64_t>(request.call), .code = 0, .data = ""};
  if (request.call == ServiceCall::kCheckMode) {
    response.data = R"({"form":"0","name":")" + (runs_ ? known_ : "") + R"("})";
  } else if (request.call == ServiceCall::kReleaseMode) {
    runs_ = false;
  } else if (request.call == ServiceCall::kSelectMode) {
    const bool known = !known_.empty() && name_of(request.parameter.data()) == known_;
    response.code = known ? 0 : kWrongParameter;
    runs_ = runs_ || known;
  } else {
    response.code = kUnknownCall;
  }
  return response;
}

namespace {

const PersonPlay& checked_play(const PersonPlay& play) {
  require(play.rate > 0.0 && std::isfinite(play.rate), "player of a person: expected a rate above 0, found {}",
          play.rate);
  require(play.noise >= 0.0 && std::isfinite(play.noise),
          "player of a person: expected a noise of at least 0 m, found {}", play.noise);
  require(play.unseen >= 0.0 && play.unseen <= 1.0, "player of a person: expected a share from 0 to 1, found {}",
          play.unseen);
  return play;
}

}  // namespace

PersonPlayer::PersonPlayer(const HumanMotion& person, const Pose& X_WB, const Pose& X_BC, const PersonPlay& play)
    : person_(resample(person, checked_play(play).rate)),
      X_CW_((X_WB * X_BC).inverse()),
      play_(play),
      random_(play.seed, stream_key({"person-player"})) {}

bool PersonPlayer::next(PersonEstimate& estimate) {
  if (frame_ >= person_.frames()) return false;
  estimate.sequence = static_cast<std::uint64_t>(frame_) + 1;
  estimate.stamp = frame_ / play_.rate;
  estimate.latency = play_.latency;
  estimate.seen = !random_.chance(play_.unseen);
  for (int j = 0; j < kSmplJoints; ++j) {
    const Eigen::Vector3d noise(random_.normal(), random_.normal(), random_.normal());
    estimate.joints.col(j) = X_CW_ * Eigen::Vector3d(person_.joints.at(frame_, j)) + play_.noise * noise;
  }
  ++frame_;
  return true;
}

Pose base_of_reactor(const HumanMotion& reactor, double height) {
  const Eigen::Vector3d pelvis = reactor.joints.at(0, kPelvis);
  return {yaw_rotation(heading(reactor.joints, 0)), {pelvis.x(), pelvis.y(), height}};
}

}  // namespace duet
