#include "duet/hardware/executors/sport_executor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <utility>

#include "duet/hardware/wire/low_level_frame.h"

namespace duet {
namespace {

constexpr double kVelocityPeriod = 0.1, kVelocityLasts = 0.3;  // [s]
constexpr double kArmPeriod = 0.02, kDampPeriod = 0.2, kAskPeriod = 0.1, kModePeriod = 1.0;
constexpr double kWeightRate = 0.2;  // of the maker's example [1/s]
constexpr int kArmsFrom = 15, kWeightMotor = 29;
constexpr int kMostResponses = 16;  // of a tick

bool moves(SafetyState state) {
  return state == SafetyState::kStand || state == SafetyState::kRun || state == SafetyState::kHold;
}

bool stands_still(const VelocityCommand& v) { return v.forward == 0.0 && v.lateral == 0.0 && v.yaw_rate == 0.0; }

}  // namespace

SportExecutor::SportExecutor(SportWire& wire, double period, int action)
    : wire_(wire), period_(period), action_(action) {}

SportExecutor::~SportExecutor() { close(); }

bool SportExecutor::every(double seconds) const { return ticks_ % std::max(1L, std::lround(seconds / period_)) == 0; }

void SportExecutor::poll(double now) {
  RpcResponse response;
  for (int k = 0; k < kMostResponses && wire_.take(response); ++k) hear(response, now);
  if (now - asked_at_ < kAskPeriod) return;
  asked_at_ = now;
  wire_.request(read_request(next_id_++, ServiceCall::kGetFsm));
}

void SportExecutor::hear(const RpcResponse& response, double now) {
  if (response.code != 0) {
    last_refusal_ = response.code;
    return;
  }
  if (response.api != static_cast<std::int64_t>(ServiceCall::kGetFsm)) return;
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

void ModeWatch::poll(double now) {
  RpcResponse response;
  for (int k = 0; k < kMostResponses && wire_.take(response); ++k) {
    const bool answers = response.code == 0 && response.api == static_cast<std::int64_t>(ServiceCall::kCheckMode);
    if (std::optional<std::string> name = answers ? name_of(response.data) : std::nullopt) mode_ = std::move(name);
  }
  if (now - asked_at_ < kModePeriod) return;
  asked_at_ = now;
  wire_.request(read_request(next_id_++, ServiceCall::kCheckMode));
}

void SportExecutor::open() {
  if (open_) return;
  if (action_ == 0) wire_.open_arms();
  open_ = true;
  weight_ = 0.0;
  has_arms_ = moved_ = false;
}

void SportExecutor::close() {
  if (!open_) return;
  wire_.request(velocity_request(next_id_++, {}, kVelocityLasts));
  if (std::exchange(acts_, false)) wire_.request(action_request(next_id_++, kReleaseArm));
  wire_.close_arms();
  open_ = false;
}

// The guard's frame with the arms alone, and the weight in the motor behind the last.
bool SportExecutor::write(const LowCommandFrame& frame) {
  if (!open_) return false;
  if (action_ != 0) return true;
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
  if (!open_ || !moves(state_)) return;
  const bool comes_to_rest = stands_still(velocity) && !stands_still(sent_);
  if (!comes_to_rest && !every(kVelocityPeriod)) return;
  sent_ = velocity;
  wire_.request(velocity_request(next_id_++, velocity, kVelocityLasts));
}

void SportExecutor::enter(SafetyState state) {
  state_ = state;
  const bool acts = state == SafetyState::kRun;
  if (open_ && action_ != 0 && acts != acts_) {
    wire_.request(action_request(next_id_++, acts ? action_ : kReleaseArm));
    acts_ = acts;
    moved_ = true;
  }
  if (!open_ || !moved_ || state < SafetyState::kDamp || fsm_ == kFsmDamp || !every(kDampPeriod)) return;
  wire_.request(fsm_request(next_id_++, kFsmDamp));
}

namespace {

constexpr double kShortest = 0.1, kLongest = 0.5;  // of a velocity [s]
constexpr double kMostVelocity = 10.0;             // that a parameter has room for

// The value within the range of a parameter; 0 where it is not finite.
double printable(double value) { return std::isfinite(value) ? std::clamp(value, -kMostVelocity, kMostVelocity) : 0.0; }

// Parses a document that came from outside; discarded where it is not JSON.
nlohmann::json parsed(std::string_view text) {
  constexpr std::size_t kMostText = 4096;
  if (text.size() > kMostText) return nlohmann::json(nlohmann::json::value_t::discarded);
  return nlohmann::json::parse(text, nullptr, false);
}

std::optional<double> number_at(const nlohmann::json& json, std::string_view key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number()) return std::nullopt;
  const double value = found->get<double>();
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

}  // namespace

Service service_of(ServiceCall call) {
  switch (call) {
    case ServiceCall::kCheckMode:
    case ServiceCall::kSelectMode:
    case ServiceCall::kReleaseMode:
      return Service::kMotionSwitcher;
    case ServiceCall::kDoArmAction:
    case ServiceCall::kListArmActions:
      return Service::kArm;
    case ServiceCall::kGetFsm:
    case ServiceCall::kSetFsm:
    case ServiceCall::kSetVelocity:
      break;
  }
  return Service::kSport;
}

bool fsm_walks(int fsm) { return fsm == kFsmStart || fsm == kFsmWaistStart || fsm == kFsmRun; }

RpcRequest velocity_request(std::int64_t id, const VelocityCommand& velocity, double duration) {
  RpcRequest request{.id = id, .call = ServiceCall::kSetVelocity, .parameter = {}};
  const double lasts = std::isfinite(duration) ? std::clamp(duration, kShortest, kLongest) : kShortest;
  fmt::format_to_n(request.parameter.data(), request.parameter.size() - 1,
                   "{{\"velocity\":[{:.4f},{:.4f},{:.4f}],\"duration\":{:.2f}}}", printable(velocity.forward),
                   printable(velocity.lateral), printable(velocity.yaw_rate), lasts);
  return request;
}

namespace {

RpcRequest number_request(std::int64_t id, ServiceCall call, int number) {
  RpcRequest request{.id = id, .call = call, .parameter = {}};
  fmt::format_to_n(request.parameter.data(), request.parameter.size() - 1, "{{\"data\":{}}}", number);
  return request;
}

}  // namespace

RpcRequest fsm_request(std::int64_t id, int fsm) { return number_request(id, ServiceCall::kSetFsm, fsm); }

RpcRequest action_request(std::int64_t id, int action) { return number_request(id, ServiceCall::kDoArmAction, action); }

RpcRequest read_request(std::int64_t id, ServiceCall call) { return {.id = id, .call = call, .parameter = {}}; }

std::optional<int> fsm_of(std::string_view data) {
  const nlohmann::json json = parsed(data);
  if (!json.is_object()) return std::nullopt;
  const std::optional<double> number = number_at(json, "data");
  if (!number || std::abs(*number) > 1e6 || *number != std::floor(*number)) return std::nullopt;
  return static_cast<int>(*number);
}

std::optional<std::string> name_of(std::string_view data) {
  const nlohmann::json json = parsed(data);
  if (!json.is_object()) return std::nullopt;
  const auto found = json.find("name");
  return found != json.end() && found->is_string() ? std::optional(found->get<std::string>()) : std::nullopt;
}

std::optional<SportOrder> order_of(ServiceCall call, std::string_view parameter) {
  const nlohmann::json json = parsed(parameter);
  if (!json.is_object()) return std::nullopt;
  SportOrder order;
  if (call == ServiceCall::kSetFsm) {
    const std::optional<int> fsm = fsm_of(parameter);
    if (fsm) order.fsm = *fsm;
    return fsm ? std::optional(order) : std::nullopt;
  }
  const auto velocity = json.find("velocity");
  const std::optional<double> duration = number_at(json, "duration");
  if (call != ServiceCall::kSetVelocity || !duration || velocity == json.end() || !velocity->is_array() ||
      velocity->size() != 3)
    return std::nullopt;
  if (!std::ranges::all_of(*velocity, [](const nlohmann::json& v) { return v.is_number(); })) return std::nullopt;
  order.duration = *duration;
  order.velocity = {velocity->at(0).get<double>(), velocity->at(1).get<double>(), velocity->at(2).get<double>(), 0.0};
  return order;
}

}  // namespace duet
