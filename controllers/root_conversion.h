// From the root pose that a policy wants to the velocity that a walking controller is told (supplement A.4.3). The law
// is one-dimensional, along the heading; sideways and yaw get proportional control. It needs the robot's measured place
// and speed: the state's. Nothing allocates.
#pragma once

#include <string>
#include <vector>

#include "duet/controllers/descriptor.h"
#include "duet/core/robot_state.h"

namespace duet {

// The command to a velocity-commanded controller: in the robot's heading frame. [m/s, m/s, rad/s, m]
struct VelocityCommand {
  double forward = 0.0, lateral = 0.0, yaw_rate = 0.0;
  double height = 0.0;
};

// printed: as A.4.3 has it: v_ref unless (residual <= 0.15 m and speed >= 0.1 m/s), then -v_ref. It never commands 0
//          and creeps on past the goal.
// adopted: v_ref until the residual is 0.15 m; then brakes while the robot still moves forward (at most 0.6 s) and
//          stands until the goal has moved by more than 0.15 m and is more than 0.20 m away. It stops up to 0.15 m
//          short.
// direct:  the reference's own velocity plus proportional control: the closest tracking.
enum class RootConversionLaw { kPrinted, kAdopted, kDirect };

std::vector<std::string> root_conversion_names();

// "vx,vy,wz" or "vx,vy,wz,height"; the height is `standing` where it is not given. Throws std::invalid_argument for
// anything else.
VelocityCommand parse_velocity_command(const std::string& text, double standing);

inline constexpr double kReferenceSpeed = 0.2;   // v_ref and v_brake of A.4.3 [m/s]
inline constexpr double kBrakeDistance = 0.15;   // [m]
inline constexpr double kBrakeSpeed = 0.1;       // [m/s]
inline constexpr double kResumeDistance = 0.20;  // hysteresis of `adopted` [m]
inline constexpr int kMostBrakeTicks = 30;       // 0.6 s at 50 Hz

class RootConversion {
 public:
  RootConversion(RootConversionLaw law, const VelocityInterface& interface) : law_(law), interface_(interface) {}

  void reset();
  // `v_ref_W`, `yaw_rate_ref`: velocity of the reference's root, in W, and its rate of turn; used by `direct` alone.
  VelocityCommand update(const RobotState& state, const Reference& reference, const Eigen::Vector3d& v_ref_W,
                         double yaw_rate_ref);

 private:
  enum class Phase { kStanding, kWalking, kBraking };

  double printed(double residual, double speed) const;
  double adopted(double residual, double speed, const Eigen::Vector2d& goal);
  void direct(const Eigen::Vector2d& wanted, double turn, VelocityCommand& command);
  void stand(const Eigen::Vector2d& goal);

  RootConversionLaw law_;
  VelocityInterface interface_;
  Phase phase_ = Phase::kStanding;
  int brake_ticks_ = 0;
  bool has_stood_ = false;                               // at stood_for_
  Eigen::Vector2d stood_for_ = Eigen::Vector2d::Zero();  // the goal for which it stopped
  bool stepping_ = false;                                // of `direct`: the last command was one to step
};

}  // namespace duet
