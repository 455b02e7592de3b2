// The clock and the feet of WBC-Sim's reference: when the root's reference moves, or the robot has been pushed away
// from it, the feet step in time; else they stand. It gives the legs what u_t cannot (a retargeted human's leg angles
// are no steps of a robot): where each foot is wanted relative to the root's reference. Value type; no allocation.
#pragma once

#include <Eigen/Core>
#include <array>

#include "duet/core/pose.h"

namespace duet {

struct GaitOptions {
  double frequency = 1.4;        // full cycles [Hz]
  double swing_height = 0.08;    // of the ankle over its height in stance [m]
  double half_width = 0.1185;    // of the stance [m]; WbcTracker takes the card's
  double max_speed = 0.6;        // of the root's reference that feet are placed for [m/s]
  double max_turn = 0.8;         // [rad/s]
  double still_speed = 0.04;     // below this the root is at rest [m/s]
  double still_turn = 0.10;      // [rad/s]
  double start_distance = 0.12;  // of the root from its reference at which feet step though the reference rests [m]
  double start_angle = 0.35;     // likewise of the heading [rad]
  double lead_time = 0.0;        // by which the reference that the network sees is ahead, at its velocity [s]
  double capture_time = 0.0;     // of the robot's velocity that counts as distance: sqrt(height / g), or none [s]
};

// A foot's place relative to the root's reference, in its heading frame on the ground: x forward, y left.
struct FootPlace {
  double x = 0.0, y = 0.0, lift = 0.0;  // [m]
  double yaw = 0.0;                     // [rad]
};

class Gait {
 public:
  explicit Gait(const GaitOptions& options = {}) : options_(options) {}

  void reset();
  // One tick of 0.02 s. `velocity`: of the reference's root in its heading frame, vx, vy [m/s], yaw rate [rad/s];
  // `deviation`: of the robot's root, carried on by its velocity for `capture_time`, from the reference, x, y [m]
  // in that frame and heading [rad].
  void update(const Eigen::Vector3d& velocity, const Eigen::Vector3d& deviation);

  [[nodiscard]] bool stepping() const { return stepping_; }
  // In [0, 1): the left foot swings in [0, 0.5), the right one in [0.5, 1).
  [[nodiscard]] double phase() const { return phase_; }
  [[nodiscard]] int swing_foot() const { return phase_ < 0.5 ? 0 : 1; }                                 // 0: left
  [[nodiscard]] double swing_progress() const { return (phase_ < 0.5 ? phase_ : phase_ - 0.5) * 2.0; }  // [0, 1)
  [[nodiscard]] double half_period() const { return 0.5 / options_.frequency; }                         // [s]
  [[nodiscard]] const Eigen::Vector3d& velocity() const { return velocity_; }  // filtered and bounded
  [[nodiscard]] std::array<FootPlace, 2> feet() const;                         // left, right
  [[nodiscard]] const GaitOptions& options() const { return options_; }

 private:
  void start(const Eigen::Vector3d& deviation);
  [[nodiscard]] FootPlace foot(int side) const;

  GaitOptions options_;
  Eigen::Vector3d velocity_ = Eigen::Vector3d::Zero();
  double phase_ = 0.0;
  double share_ = 0.0;  // of the full lift: grows over the first half cycle
  int resting_ = 0;     // half cycles since the root came to rest
  bool stepping_ = false;
};

}  // namespace duet
