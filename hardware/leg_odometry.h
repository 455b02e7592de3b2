// Where the root is by the robot's own legs and IMU: between two states the accelerometer carries the speed on, and the
// soles that stand pull it to what the chain of joints says. A sole that would have the base jump - it slips, or swings
// low over the floor - hardly pulls. The floor is level. It drifts; how much: docs/hardware.md, "Odometry". No
// allocation after construction. One owner, one thread.
#pragma once

#include <memory>
#include <vector>

#include "duet/hardware/odometry_source.h"
#include "duet/robots/kinematics.h"

namespace duet {

class LegOdometry final : public OdometryReader {
 public:
  // `period` of the robot's states [s]. Throws std::invalid_argument for a robot without soles and a period that is not
  // above 0.
  explicit LegOdometry(std::shared_ptr<const RobotModel> robot, double period = 0.002);

  // A whole and newer state moves it on by one period; any other is left out.
  void see(const LowStateFrame& frame) override;
  bool take(OdometrySample& sample) override;

  // From joints and IMU: X_WB.R, w_WB_B, q and v of the state, and what the accelerometer reads, as if it sat at the
  // base's origin [m/s^2]. The first one begins at the origin, with the heading of the IMU.
  void update(const RobotState& state, const Eigen::Vector3d& specific_force_B);
  [[nodiscard]] const OdometrySample& sample() const { return sample_; }

 private:
  struct Sole {
    Eigen::Vector3d p_BS_W = Eigen::Vector3d::Zero();  // its lowest point from the base's origin [m]
    Eigen::Vector3d v_WB = Eigen::Vector3d::Zero();    // of the base, if it stands still [m/s]
  };

  void place_soles(const RobotState& state);
  void pull(double gain, bool robust);

  std::shared_ptr<const RobotModel> robot_;
  double period_;
  Kinematics kinematics_;
  RobotReading reading_;
  std::vector<Sole> soles_;
  double lowest_ = 0.0;  // of the soles [m]
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd velocity_;
  OdometrySample sample_;
  bool any_ = false, new_ = false;
};

}  // namespace duet
