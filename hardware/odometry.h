// Where the robot's root is and how fast, as somebody measured it. HOMIE measures neither: without a source here the
// law of supplement A.4.3 cannot run, and is refused.
#pragma once

#include <array>
#include <string_view>

#include "duet/core/pose.h"
#include "duet/hardware/safety_signal.h"

namespace duet {

enum class OdometrySource {
  kNone,
  kLegs,      // of IMU, kinematics and the standing foot
  kExternal,  // a tracker in the room
  kVendor,    // the maker's topic, which is there only while the maker's own walking runs
  kTwin,
};
inline constexpr std::array<std::string_view, 5> kOdometryNames = {"none", "legs", "external", "vendor", "twin"};

struct OdometrySample {
  Pose X_WB;                                       // of the base in the frame of odometry
  Eigen::Vector3d v_WB = Eigen::Vector3d::Zero();  // measured, not differenced here [m/s]
  double at = kNever;                              // reception, by this program's clock [s]
  bool valid = false;                              // the source says so
  long sender_restarts = 0;                        // of the source, by its sequence numbers
};

}  // namespace duet
