#include "duet/hardware/guard/walker.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"

namespace duet {
namespace {

// How far the root that is followed may be ahead of the measured one: what a robot that is held back would make up for
// once it is free again.
constexpr double kMostLead = 0.25;     // [m]
constexpr double kMostTurnLead = 0.4;  // [rad]

bool has_descriptor(const std::string& controller) {
  return controller != "wbc_sim" && controller != "vmc" && controller != "pd";
}

}  // namespace

LeastSteps least_steps(const std::string& controller) {
  if (!has_descriptor(controller)) return {};
  const Descriptor descriptor = load_descriptor(controller);
  if (!descriptor.command) return {};
  return {.forward = descriptor.command->forward.steps_from, .yaw = descriptor.command->yaw.steps_from};
}

bool is_told_velocities(const std::string& controller) {
  return !controller.empty() && has_descriptor(controller) && load_descriptor(controller).command.has_value();
}

Walker::Walker(const std::string& controller, const ControllerOptions& options,
               const std::shared_ptr<const RobotModel>& robot)
    : Walker(std::move(*load(controller, options, robot)())) {}

std::function<std::unique_ptr<Walker>()> Walker::load(const std::string& controller, const ControllerOptions& options,
                                                      const std::shared_ptr<const RobotModel>& robot) {
  const ControllerInfo info = controller_info(controller);
  require(info.walks, "walker: expected a controller that walks, found '{}'", controller);
  check_controller_options(info, options);
  const LeastSteps least = duet::least_steps(controller);
  if (is_told_velocities(controller)) {
    return [=, make = load_told(controller, robot, options).make] {
      auto told = std::make_shared<VelocityCommand>();
      return std::unique_ptr<Walker>(
          new Walker(controller, least, robot, told, make_guarded(make(options, told), robot)));
    };
  }
  return [=, make = load_controller(controller, robot, options).make] {
    return std::unique_ptr<Walker>(new Walker(controller, least, robot, nullptr, make(options)));
  };
}

Walker::Walker(std::string name, const LeastSteps& least, std::shared_ptr<const RobotModel> robot,
               std::shared_ptr<VelocityCommand> told, std::unique_ptr<Controller> controller)
    : name_(std::move(name)),
      least_(least),
      robot_(std::move(robot)),
      told_(std::move(told)),
      controller_(std::move(controller)) {
  command_ = robot_->default_command(robot_->neutral);
  reference_.q = robot_->neutral;
}

void Walker::begin(const RobotState& state) {
  controller_->reset(state);
  yaw_ = yaw_of(state.X_WB.R);
  reference_.X_WB = {yaw_rotation(yaw_), state.X_WB.p};
  command_ = robot_->default_command(state.q);
}

// The root that is followed moves at the velocity, never far from the measured one.
void Walker::lead(const RobotState& state, const VelocityCommand& velocity) {
  Eigen::Vector2d place = reference_.X_WB.p.head<2>();
  place += kTick * (Eigen::Rotation2Dd(yaw_) * Eigen::Vector2d(velocity.forward, velocity.lateral));
  const Eigen::Vector2d ahead = place - state.X_WB.p.head<2>();
  if (ahead.norm() > kMostLead) place = state.X_WB.p.head<2>() + kMostLead * ahead.normalized();
  const double measured = yaw_of(state.X_WB.R);
  const double turn = std::remainder(yaw_ + kTick * velocity.yaw_rate - measured, 2.0 * std::numbers::pi);
  yaw_ = measured + std::clamp(turn, -kMostTurnLead, kMostTurnLead);
  reference_.X_WB.p = {place.x(), place.y(), velocity.height};
  reference_.X_WB.R = yaw_rotation(yaw_);
}

const JointCommand& Walker::update(const RobotState& state, const VelocityCommand& velocity, const Eigen::VectorXd& q) {
  lead(state, velocity);
  if (told_ != nullptr) *told_ = velocity;
  reference_.q = robot_->neutral;
  for (const std::vector<int>& arm : robot_->roles.arms)
    for (const int joint : arm) reference_.q[joint] = q[joint];
  controller_->act(state, reference_, command_);
  for (int j = 0; j < robot_->dof(); ++j)
    command_.q_target[j] = std::clamp(command_.q_target[j], robot_->joints[j].lower, robot_->joints[j].upper);
  return command_;
}

namespace {

bool is_finite(const OdometrySample& sample) {
  return sample.X_WB.p.allFinite() && sample.X_WB.R.coeffs().allFinite() && sample.v_WB.allFinite();
}

}  // namespace

RootVelocity::RootVelocity(OdometrySource source, const HardwareLimits& limits, const LeastSteps& least)
    : law_(limits, least), height_(limits.height) {
  require(source != OdometrySource::kNone,
          "root velocity: expected a source of odometry (legs, external, vendor, twin), found none: supplement A.4.3 "
          "needs the measured place and speed of the root");
}

VelocityCommand RootVelocity::update(const OdometrySample& odometry, const Reference& reference, double now,
                                     double most_age) {
  const double age = now - odometry.at;
  if (!odometry.valid || !is_finite(odometry) || !(age >= 0.0 && age <= most_age)) {
    law_.reset();
    return {0.0, 0.0, 0.0, height_};
  }
  state_.X_WB = odometry.X_WB;
  state_.v_WB = odometry.v_WB;
  return law_.update(state_, reference.X_WB);
}

}  // namespace duet
