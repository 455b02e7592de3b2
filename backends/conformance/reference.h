// The reference that the suite compares engines with: our own dynamics (robots/dynamics.h) integrated by Runge-Kutta,
// and the momentum and energy of a state. Internal to backends/conformance.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "duet/backends/backend.h"
#include "duet/core/numbers.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"

namespace duet::conformance {

// Random orientation and joint positions within `share` of their ranges about the middle; base and joint velocities of
// standard deviation `speed` [m/s, rad/s].
RobotState random_state(const RobotModel& robot, const Eigen::Vector3d& p_WB, double share, double speed,
                        Random& random);

// Generalised acceleration under the generalised force Q (6 + dof, robots/kinematics.h), armature included.
Eigen::VectorXd acceleration(Dynamics& dynamics, const RobotState& state, const Eigen::VectorXd& Q);

// Classical fourth-order Runge-Kutta under a constant generalised force.
RobotState integrate(const RobotModel& robot, const Eigen::Vector3d& gravity_W, const RobotState& start,
                     const Eigen::VectorXd& Q, double seconds, double dt);

struct Momentum {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   // [kg m/s], W
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  // about the centre of mass [kg m^2/s], W
};
Momentum momentum_of(const RobotModel& robot, const RobotState& state);

// Kinetic energy of the links other than the base, and their potential energy above the base: a heavy base that gives
// way by centimetres in a minute does not count. [J]
double energy_above_base(const RobotModel& robot, const RobotState& state, double gravity);

double largest_joint_error(const RobotState& a, const RobotState& b);  // [rad]

// Robots small enough for closed forms, and what they are commanded. Internal to backends/conformance.

// The box of Open Robotics' benchmark of free bodies: 10 kg, 0.1 x 0.4 x 0.9 m. No shape.
std::shared_ptr<const RobotModel> tumbling_box();

// 10 kg on four spheres of 20 mm, 0.4 m apart, its origin 0.1 m over the ground.
inline constexpr double kSledgeHeight = 0.1, kSledgeHalfWidth = 0.2;
std::shared_ptr<const RobotModel> sledge();

// A solid ball with one sphere.
std::shared_ptr<const RobotModel> ball(double mass, double radius);

// On a base of 1e6 kg that a push of its weight holds up (hold_base): the joints are alone.
inline constexpr double kBaseMass = 1e6;

// A wheel about z, limits +-1 rad, effort 10 N m.
inline constexpr double kWheelInertia = 0.05, kWheelArmature = 0.03, kWheelEffort = 10.0;
std::shared_ptr<const RobotModel> wheel();

// An arm that turns about z, with a ball for a hand at its end.
inline constexpr double kReach = 0.3, kReachRadius = 0.04;
std::shared_ptr<const RobotModel> held_hand();

// Two links that touch side by side at q = 0: a thigh along z, which turns about its own axis, and a forearm along y,
// whose elbow turns about z and presses it onto the thigh. The pair is declared.
inline constexpr double kThighInertia = 0.05, kThighRadius = 0.08;  // [kg m^2] about its axis, [m]
inline constexpr double kForearm = 0.3, kForearmRadius = 0.04;      // from the elbow to the touch, [m]
std::shared_ptr<const RobotModel> forearm_on_thigh();

// `links` rods of 1 kg and 1 m in a row, hinged about y, hanging down at q = 0.
inline constexpr double kRodMass = 1.0, kRodLength = 1.0, kRodInertia = 1.0 / 12.0;
std::shared_ptr<const RobotModel> rods(int links);

// The same robot without stops, for flight that our integration does not stop either.
std::shared_ptr<const RobotModel> without_stops(const RobotModel& robot);

RobotState state_at(const RobotModel& robot, const Eigen::Vector3d& p_WB);  // neutral pose, at rest
JointCommand no_torque(const RobotModel& robot);
// The push that carries the base's weight. Reset takes it away.
void hold_base(Backend& backend);

// Ankle feedback on the centre of mass, so that a robot under plain PD stands. Internal to backends/conformance.
class AnkleBalance {
 public:
  // Keeps a reference. The last two joints of each leg of its card are the ankle's pitch and roll (lacks_ankles).
  explicit AnkleBalance(const RobotModel& robot);
  // The card's gains about `q`, with stiffer ankles that are moved by the feedback of `state`; call it every kPeriod.
  static constexpr double kPeriod = 0.01;  // [s]
  JointCommand command(const RobotState& state, const Eigen::VectorXd& q);

 private:
  const RobotModel* robot_;
  Kinematics kinematics_;
  Eigen::MatrixXd jacobian_;
  std::vector<int> pitch_, roll_;  // joints of the ankles
};

}  // namespace duet::conformance
