#include "duet/backends/actuation.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/core/robot_state.h"

namespace duet {
namespace {

constexpr double kShortestStep = 1e-6;  // [s]; 20,000 steps a control period, far below what any engine asks for

}  // namespace

std::string step_values() { return fmt::format("a step [s] of {} or more that divides {}", kShortestStep, kTick); }

std::string refused_step(double dt) {
  const double steps = kTick / dt;
  const bool divides = dt >= kShortestStep && dt <= kTick && std::abs(steps - std::round(steps)) < 1e-9;
  return divides ? "" : step_values();
}

const std::vector<std::string>& torque_law_names() {
  static const std::vector<std::string> names = {"implicit", "explicit"};
  return names;
}

std::shared_ptr<const RobotModel> with_armature(std::shared_ptr<const RobotModel> robot, double share) {
  require(share >= 0.0 && share <= 1.0, "armature: expected a share of the card's in [0, 1], found {}", share);
  if (share == 1.0) return robot;
  auto lighter = std::make_shared<RobotModel>(*robot);
  for (RobotJoint& joint : lighter->joints) joint.armature *= share;
  return lighter;
}

}  // namespace duet
