// The sources of odometry, one behind the other's back: the maker's topic (or a twin's), a tracker in the room over a
// local socket, the robot's own legs (hardware/leg_odometry.h). docs/hardware.md, "Odometry". One owner, one thread.
#pragma once

#include <functional>

#include "duet/core/awake_time.h"
#include "duet/hardware/datagram_socket.h"
#include "duet/hardware/low_level_frame.h"
#include "duet/hardware/odometry.h"
#include "duet/hardware/robot_wire.h"
#include "duet/hardware/stream_order.h"

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
  std::uint64_t sequence = 0;  // rises (hardware/stream_order.h)
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

}  // namespace duet
