#include "duet/hardware/twin/fake_arms.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <span>

#include "duet/core/json.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "duet/policies/controls/control_policy.h"

namespace duet {
namespace {

constexpr int kArmsBegin = 15, kWeightAt = 29;  // motors of the arm topic
constexpr double kReleasedIn = 1.0;             // [s]
constexpr double kOthersFor = 0.5;              // that a frame of somebody else counts [s]
constexpr double kActionRate = 50.0;            // of the motion's references [1/s]
constexpr float kArmKp = 60.0f, kArmKd = 1.5f;  // of the maker's example [N m/rad, N m s/rad]
constexpr std::int32_t kNoSuchCall = 3203, kBadParameter = 3104;

std::string list_of_actions() {
  nlohmann::json list = nlohmann::json::array();
  for (const ArmPreset& preset : kArmPresets) list.push_back({{"id", preset.id}, {"name", preset.name}});
  return dumped(list);
}

}  // namespace

FakeArms::FakeArms(std::shared_ptr<const RobotModel> robot)
    : robot_(std::move(robot)), motion_(control_maker("vendor", robot_)()) {}

FakeArms::~FakeArms() = default;

RpcResponse FakeArms::answer(const RpcRequest& request, double now, int fsm) {
  RpcResponse response{.id = request.id, .api = static_cast<std::int64_t>(request.call), .code = 0, .data = ""};
  if (request.call == ServiceCall::kListArmActions) {
    response.data = list_of_actions();
  } else if (request.call == ServiceCall::kDoArmAction) {
    const std::optional<int> id = fsm_of(request.parameter.data());
    response.code = id ? begin(*id, now, fsm) : kBadParameter;
  } else {
    response.code = kNoSuchCall;
  }
  return response;
}

bool FakeArms::is_over(double now) const {
  if (preset_ == nullptr) return true;
  return now - begun_ > preset_->lasts || (released_ != kNever && now - released_ > kReleasedIn);
}

std::int32_t FakeArms::begin(int id, double now, int fsm) {
  if (!fsm_walks(fsm)) return kNotWalking;
  if (id == kReleaseArm) {
    if (preset_ != nullptr && released_ == kNever) released_ = now;
    return 0;
  }
  const ArmPreset* preset = arm_preset(id);
  if (preset == nullptr) return kUnknownAction;
  if (others_at_ != kNever && now - others_at_ < kOthersFor) return kArmsOccupied;
  if (!is_over(now)) return preset_ == preset ? 0 : kArmsHeld;
  preset_ = preset;
  begun_ = now;
  released_ = kNever;
  planned_.clear();
  motion_->reset({.task = preset->task, .prompt = "", .start = robot_->standing_state()});
  return 0;
}

bool FakeArms::write_arms(std::uint8_t mode_machine, double now, LowCommandFrame& frame) {
  if (preset_ == nullptr) return false;
  const bool over = is_over(now);
  const double until = released_ != kNever ? released_ : now;
  const int tick = static_cast<int>(kActionRate * (until - begun_));
  if (planned_.empty() || tick - planned_from_ >= static_cast<int>(planned_.size())) {
    ObservationFrame standing;
    standing.robot = robot_->standing_state();
    planned_ = motion_->plan({.history = std::span(&standing, 1), .tick = tick});
    planned_from_ = tick;
  }
  joints_ = robot_->default_command(planned_[static_cast<std::size_t>(tick - planned_from_)].q);
  build_command(joints_, mode_machine, frame);
  for (int j = 0; j < kArmsBegin; ++j) frame.motor[j] = {};
  for (int j = kArmsBegin; j < kG1Motors; ++j) {
    frame.motor[j].kp = kArmKp;
    frame.motor[j].kd = kArmKd;
  }
  const double left = released_ == kNever ? 1.0 : std::clamp(1.0 - (now - released_) / kReleasedIn, 0.0, 1.0);
  frame.motor[kWeightAt].q = over ? 0.0f : static_cast<float>(left);
  frame.crc = checksum_of(frame);
  if (over) preset_ = nullptr;
  return true;
}

}  // namespace duet
