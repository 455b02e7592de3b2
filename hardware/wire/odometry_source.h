// The sources of odometry, one behind the other's back: the maker's topic (or a twin's), a tracker in the room over a
// local socket, the robot's own legs (hardware/wire/odometry_source.h). docs/hardware.md, "Odometry". One owner, one
// thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "duet/core/machine.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "duet/hardware/wire/robot_wire.h"
#include "duet/hardware/wire/sender_clock.h"
#include "duet/robots/kinematics.h"

namespace duet {

class OdometryReader {
 public:
  virtual ~OdometryReader() = default;
  // A state of the robot as it came, whole or not.
  virtual void see(const LowStateFrame&) {}
  // The newest sample; false where none has come since. `at` is left to who takes it.
  virtual bool take(OdometrySample& sample) = 0;
};

class WireOdometry final : public OdometryReader {
 public:
  explicit WireOdometry(RobotWire& wire) : wire_(wire) {}
  bool take(OdometrySample& sample) override { return wire_.take(sample); }

 private:
  RobotWire& wire_;
};

// A tracker's message: the pose of the base in the frame that it measures in, and its velocity in that frame.
struct ExternalPose {
  std::uint64_t sequence = 0;  // rises (hardware/wire/datagram_socket.h)
  Pose X_WB;
  Eigen::Vector3d v_WB = Eigen::Vector3d::Zero();  // [m/s]
  bool valid = false;                              // it sees the robot
};
inline constexpr std::size_t kExternalPoseBytes = 104;
using ExternalPoseBuffer = std::array<std::byte, kExternalPoseBytes>;
void encode(const ExternalPose& pose, ExternalPoseBuffer& buffer);
// False for anything else than such a message with finite numbers and a unit quaternion (to 1 %).
bool decode(std::span<const std::byte> datagram, ExternalPose& pose);

class ExternalOdometry final : public OdometryReader {
 public:
  // `clock` [s]: of reception.
  explicit ExternalOdometry(DatagramSocket socket, std::function<double()> clock = monotonic_seconds)
      : socket_(std::move(socket)), clock_(std::move(clock)) {}
  bool take(OdometrySample& sample) override;
  [[nodiscard]] long refused() const { return refused_; }
  [[nodiscard]] long old() const { return order_.old(); }

 private:
  DatagramSocket socket_;
  std::function<double()> clock_;
  StreamOrder order_;
  long refused_ = 0;
};

// Where the root is by the robot's own legs and IMU: between two states the accelerometer carries the speed on, and the
// soles that stand pull it to what the chain of joints says. A sole that would have the base jump - it slips, or swings
// low over the floor - hardly pulls. The floor is level. It drifts; how much: docs/hardware.md, "Odometry". No
// allocation after construction. One owner, one thread.
class LegOdometry final : public OdometryReader {
 public:
  // `period` of the robot's states [s]. Throws std::invalid_argument for a robot without soles and a period that is not
  // above 0.
  explicit LegOdometry(std::shared_ptr<const RobotModel> robot, double period = 0.002);

  // A whole and newer state moves it on by as many periods as the robot's own count says: states that were not read
  // count, too, and a count rises from one to the next by the least that it ever rose. Any other state is left out.
  void see(const LowStateFrame& frame) override;
  bool take(OdometrySample& sample) override;

  // From joints and IMU: X_WB.R, w_WB_B, q and v of the state, and what the accelerometer reads, as if it sat at the
  // base's origin [m/s^2]. The first one begins at the origin, with the heading of the IMU. `periods`: since the last.
  void update(const RobotState& state, const Eigen::Vector3d& specific_force_B, double periods = 1.0);
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
  StateCount count_;
  std::vector<Sole> soles_;
  double lowest_ = 0.0;  // of the soles [m]
  Eigen::MatrixXd jacobian_;
  Eigen::VectorXd velocity_;
  OdometrySample sample_;
  bool any_ = false, new_ = false;
};

}  // namespace duet
