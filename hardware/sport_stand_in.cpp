#include "duet/hardware/sport_stand_in.h"

#include <algorithm>
#include <cmath>

#include "duet/hardware/frame_checksum.h"

namespace duet {
namespace {

constexpr int kFirstArmOfTopic = 15, kMotorOfWeight = 29;
constexpr std::int32_t kUnknownCall = 3203, kWrongParameter = 3104;

}  // namespace

SportStandIn::SportStandIn(JointCommand stance, int fsm)
    : stance_(std::move(stance)),
      joints_(stance_),
      fsm_(fsm),
      arms_(stance_.q_target),
      arms_kp_(stance_.kp),
      arms_kd_(stance_.kd) {}

RpcResponse SportStandIn::answer(const RpcRequest& request, double now) {
  RpcResponse response{.id = request.id, .api = static_cast<std::int64_t>(request.call), .code = 0, .data = ""};
  if (request.call == SportCall::kGetFsm) {
    response.data = R"({"data":)" + std::to_string(fsm_) + "}";
    return response;
  }
  const std::optional<SportOrder> order = order_of(request.call, request.parameter.data());
  if (request.call != SportCall::kSetFsm && request.call != SportCall::kSetVelocity)
    response.code = kUnknownCall;
  else if (!order)
    response.code = kWrongParameter;
  else if (request.call == SportCall::kSetFsm)
    fsm_ = order->fsm;
  else if (fsm_walks(fsm_)) {
    order_ = *order;
    ordered_at_ = now;
  }
  refused_ += response.code != 0 ? 1 : 0;
  return response;
}

void SportStandIn::obey_arms(const LowCommandFrame& frame) {
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

VelocityCommand SportStandIn::velocity(double now) const {
  const bool lasts = fsm_walks(fsm_) && now - ordered_at_ < order_.duration;
  return lasts ? order_.velocity : VelocityCommand{};
}

void SportStandIn::write_command(std::uint8_t mode_machine, LowCommandFrame& frame) {
  if (fsm_ == kFsmDamp) return build_damping(kDampingGain, mode_machine, frame);
  joints_ = stance_;
  for (int j = kFirstArmOfTopic; j < kG1Motors; ++j) {
    joints_.q_target[j] += weight_ * (arms_[j] - stance_.q_target[j]);
    joints_.kp[j] += weight_ * (arms_kp_[j] - stance_.kp[j]);
    joints_.kd[j] += weight_ * (arms_kd_[j] - stance_.kd[j]);
  }
  build_command(joints_, mode_machine, frame);
}

}  // namespace duet
