#include "duet/controllers/root_conversion.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "duet/core/require.h"

namespace duet {
namespace {

// Proportional gains [1/s]. A.4.3 gives none: a metre is made up at the speed limit, half a radian in about two
// seconds.
constexpr double kPlaceGain = 1.0;
constexpr double kYawGain = 1.5;
// Bounds of the sideways and yaw commands beside the printed and the adopted law: slow beside a person.
constexpr double kLateralBound = 0.15;  // [m/s]
constexpr double kYawBound = 0.5;       // [rad/s]
// `direct` starts to step where the wanted speed passes this share of the smallest that steps, and stops below the
// other.
constexpr double kStartShare = 0.6;
constexpr double kStopShare = 0.25;

double wrapped(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

double within(double value, const CommandRange& range) { return std::clamp(value, range.lower, range.upper); }

// The size of `value` as a share of the smallest one that the controller answers by steps.
double share_of(double value, double steps_from) {
  return steps_from > 0.0 ? std::abs(value) / steps_from : (value == 0.0 ? 0.0 : 1.0);
}

double number_of(const std::string& text, const std::string& whole) {
  const std::optional<double> value = parse_number(text);
  require(value.has_value(), "option 'command': expected \"vx,vy,wz\" or \"vx,vy,wz,height\", found '{}'", whole);
  return *value;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == ',')
      parts.emplace_back();
    else if (c != ' ')
      parts.back() += c;
  }
  return parts;
}

}  // namespace

std::vector<std::string> root_conversion_names() { return {"printed", "adopted", "direct"}; }

VelocityCommand parse_velocity_command(const std::string& text, double standing) {
  const std::vector<std::string> parts = split(text);
  require(parts.size() == 3 || parts.size() == 4,
          "option 'command': expected \"vx,vy,wz\" or \"vx,vy,wz,height\", found '{}'", text);
  return {number_of(parts[0], text), number_of(parts[1], text), number_of(parts[2], text),
          parts.size() == 4 ? number_of(parts[3], text) : standing};
}

void RootConversion::reset() {
  phase_ = Phase::kStanding;
  brake_ticks_ = 0;
  has_stood_ = false;
  stepping_ = false;
}

VelocityCommand RootConversion::update(const RobotState& state, const Reference& reference,
                                       const Eigen::Vector3d& v_ref_W, double yaw_rate_ref) {
  const double yaw = yaw_of(state.X_WB.R);
  const Eigen::Rotation2Dd R_HW(-yaw);
  const Eigen::Vector2d goal = reference.X_WB.p.head<2>();
  const Eigen::Vector2d residual = R_HW * (goal - state.X_WB.p.head<2>());
  const double speed = (R_HW * state.v_WB.head<2>()).x();
  const double yaw_error = wrapped(yaw_of(reference.X_WB.R) - yaw);
  VelocityCommand command;
  command.height =
      std::clamp(reference.X_WB.p.z() - interface_.height_offset, interface_.height.lower, interface_.height.upper);
  if (law_ == RootConversionLaw::kDirect) {
    direct(R_HW * v_ref_W.head<2>() + kPlaceGain * residual, yaw_rate_ref + kYawGain * yaw_error, command);
    return command;
  }
  command.forward =
      law_ == RootConversionLaw::kPrinted ? printed(residual.x(), speed) : adopted(residual.x(), speed, goal);
  command.forward = within(command.forward, interface_.forward);
  command.lateral = within(std::clamp(kPlaceGain * residual.y(), -kLateralBound, kLateralBound), interface_.lateral);
  command.yaw_rate = within(std::clamp(kYawGain * yaw_error, -kYawBound, kYawBound), interface_.yaw);
  return command;
}

// Below the smallest command that steps, all three directions grow together until one of them does.
void RootConversion::direct(const Eigen::Vector2d& wanted, double turn, VelocityCommand& command) {
  const double share =
      std::max({share_of(wanted.x(), interface_.forward.steps_from),
                share_of(wanted.y(), interface_.lateral.steps_from), share_of(turn, interface_.yaw.steps_from)});
  stepping_ = share > (stepping_ ? kStopShare : kStartShare);
  if (!stepping_) return;
  const double gain = share < 1.0 ? 1.0 / share : 1.0;
  command.forward = within(gain * wanted.x(), interface_.forward);
  command.lateral = within(gain * wanted.y(), interface_.lateral);
  command.yaw_rate = within(gain * turn, interface_.yaw);
}

double RootConversion::printed(double residual, double speed) const {
  return residual <= kBrakeDistance && speed >= kBrakeSpeed ? -kReferenceSpeed : kReferenceSpeed;
}

void RootConversion::stand(const Eigen::Vector2d& goal) {
  phase_ = Phase::kStanding;
  has_stood_ = true;
  stood_for_ = goal;
}

double RootConversion::adopted(double residual, double speed, const Eigen::Vector2d& goal) {
  const double distance = std::abs(residual);
  if (phase_ == Phase::kStanding) {
    const bool moved = !has_stood_ || (goal - stood_for_).norm() > kBrakeDistance;
    if (moved && distance > kResumeDistance) phase_ = Phase::kWalking;
  }
  if (phase_ == Phase::kWalking && distance <= kBrakeDistance) {
    phase_ = Phase::kBraking;
    brake_ticks_ = 0;
  }
  if (phase_ == Phase::kBraking) {
    if (speed >= kBrakeSpeed && brake_ticks_++ < kMostBrakeTicks) return -kReferenceSpeed;
    stand(goal);
  }
  if (phase_ == Phase::kStanding) return 0.0;
  return std::copysign(std::max(kReferenceSpeed, interface_.forward.steps_from), residual);
}

}  // namespace duet
