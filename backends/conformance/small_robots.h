// Robots small enough for closed forms, and what they are commanded. Internal to backends/conformance.
#pragma once

#include <memory>

#include "duet/backends/backend.h"

namespace duet::conformance {

// The box of Open Robotics' benchmark of free bodies: 10 kg, 0.1 x 0.4 x 0.9 m. No shape.
std::shared_ptr<const RobotModel> tumbling_box();

// 10 kg on four spheres of 20 mm, 0.4 m apart, its origin 0.1 m over the ground.
inline constexpr double kSledgeHeight = 0.1;
std::shared_ptr<const RobotModel> sledge();

// A solid ball with one sphere.
std::shared_ptr<const RobotModel> ball(double mass, double radius);

// On a base of 1e6 kg that a push of its weight holds up (hold_base): the joints are alone.
inline constexpr double kBaseMass = 1e6;

// A wheel about z, limits +-1 rad, effort 10 N m.
inline constexpr double kWheelInertia = 0.05, kWheelArmature = 0.03, kWheelEffort = 10.0;
std::shared_ptr<const RobotModel> wheel();

// `links` rods of 1 kg and 1 m in a row, hinged about y, hanging down at q = 0.
inline constexpr double kRodMass = 1.0, kRodLength = 1.0, kRodInertia = 1.0 / 12.0;
std::shared_ptr<const RobotModel> rods(int links);

// The same robot without stops, for flight that our integration does not stop either.
std::shared_ptr<const RobotModel> without_stops(const RobotModel& robot);

RobotState state_at(const RobotModel& robot, const Eigen::Vector3d& p_WB);  // neutral pose, at rest
JointCommand no_torque(const RobotModel& robot);
// The push that carries the base's weight. Reset takes it away.
void hold_base(Backend& backend);

}  // namespace duet::conformance
