#include "duet/hardware/sport_executor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "duet/hardware/frame_checksum.h"

namespace duet {
namespace {

constexpr double kVelocityPeriod = 0.1, kVelocityLasts = 0.3;  // [s]
constexpr double kArmPeriod = 0.02, kDampPeriod = 0.2, kAskPeriod = 0.1;
constexpr double kWeightRate = 0.2;  // of the maker's example [1/s]
constexpr int kArmsFrom = 15, kWeightMotor = 29;
constexpr int kMostResponses = 16;  // of a tick

bool stands_still(const VelocityCommand& v) { return v.forward == 0.0 && v.lateral == 0.0 && v.yaw_rate == 0.0; }

}  // namespace

SportExecutor::SportExecutor(SportWire& wire, double period) : wire_(wire), period_(period) {}

SportExecutor::~SportExecutor() { close(); }

bool SportExecutor::every(double seconds) const { return ticks_ % std::max(1L, std::lround(seconds / period_)) == 0; }

void SportExecutor::poll(double now) {
  RpcResponse response;
  for (int k = 0; k < kMostResponses && wire_.take(response); ++k) hear(response, now);
  if (now - asked_at_ < kAskPeriod) return;
  asked_at_ = now;
  wire_.request(read_request(next_id_++, SportCall::kGetFsm));
}

void SportExecutor::hear(const RpcResponse& response, double now) {
  if (response.code != 0) {
    last_refusal_ = response.code;
    return;
  }
  if (response.api != static_cast<std::int64_t>(SportCall::kGetFsm)) return;
  const std::optional<int> fsm = fsm_of(response.data);
  if (!fsm) return;
  fsm_ = *fsm;
  if (fsm_walks(fsm_)) heard_at_ = now;
}

std::string SportExecutor::complaint() const {
  if (last_refusal_ != 0) return fmt::format("the maker's service refused a call with code {}", last_refusal_);
  if (fsm_ == -1) return "the maker's service 'sport' does not answer";
  if (!fsm_walks(fsm_))
    return fmt::format("the maker's machine is in state {}, expected {}, {} or {} (walking)", fsm_, kFsmStart,
                       kFsmWaistStart, kFsmRun);
  return "";
}

void SportExecutor::open() {
  if (open_) return;
  wire_.open_arms();
  open_ = true;
  weight_ = 0.0;
  has_arms_ = moved_ = false;
}

void SportExecutor::close() {
  if (!open_) return;
  wire_.request(velocity_request(next_id_++, {}, kVelocityLasts));
  wire_.close_arms();
  open_ = false;
}

// The guard's frame with the arms alone, and the weight in the motor behind the last.
bool SportExecutor::write(const LowCommandFrame& frame) {
  if (!open_) return false;
  bool damps = true;
  for (int j = kArmsFrom; j < kG1Motors; ++j) damps = damps && frame.motor[j].kp == 0.0f;
  if (!damps) {
    std::memset(&frame_, 0, sizeof(frame_));
    frame_.mode_pr = frame.mode_pr;
    frame_.mode_machine = frame.mode_machine;
    std::memcpy(&frame_.motor[kArmsFrom], &frame.motor[kArmsFrom], sizeof(MotorCommandFrame) * (kG1Motors - kArmsFrom));
    has_arms_ = moved_ = true;
  }
  if (!has_arms_) return true;
  weight_ = std::clamp(weight_ + (damps ? -kWeightRate : kWeightRate) * period_, 0.0, 1.0);
  if (!every(kArmPeriod)) return true;
  frame_.motor[kWeightMotor].q = static_cast<float>(weight_);
  frame_.crc = checksum_of(frame_);
  return wire_.write_arms(frame_);
}

// Sends at once where it comes to rest, otherwise ten times a second: each order lasts a little longer than that.
void SportExecutor::send(const VelocityCommand& velocity) {
  ++ticks_;
  if (!open_ || state_ == SafetyState::kArmed || state_ >= SafetyState::kDamp) return;
  const bool comes_to_rest = stands_still(velocity) && !stands_still(sent_);
  if (!comes_to_rest && !every(kVelocityPeriod)) return;
  sent_ = velocity;
  wire_.request(velocity_request(next_id_++, velocity, kVelocityLasts));
}

void SportExecutor::enter(SafetyState state) {
  state_ = state;
  if (!open_ || !moved_ || state < SafetyState::kDamp || fsm_ == kFsmDamp || !every(kDampPeriod)) return;
  wire_.request(fsm_request(next_id_++, kFsmDamp));
}

}  // namespace duet
