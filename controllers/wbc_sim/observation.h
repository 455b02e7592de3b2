// Observations of WBC-Sim (supplement A.3.2, Table S1), as the printed totals decode: oracle actor 163, student actor
// 1090, critic 361. Written as float, unscaled (a normaliser follows). docs/deviations.md says what Table S1's marks
// contradict.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "duet/controllers/wbc_sim/tracker.h"
#include "duet/io/observation.h"
#include "duet/robots/kinematics.h"

namespace duet {

inline constexpr int kWbcHistory = 10;

enum class WbcKind { kOracle, kStudent };  // 163-D with base velocity; 1090-D with history

// Sizes for a robot of n joints, and what is where. n = 29: frame 93, oracle 163, student 1090, critic 361.
class WbcLayout {
 public:
  explicit WbcLayout(int joints) : n_(joints) {}
  [[nodiscard]] int joints() const { return n_; }
  [[nodiscard]] ChannelWidths widths() const { return {.joints = n_, .actions = n_}; }
  [[nodiscard]] int size(WbcKind kind) const;
  [[nodiscard]] int oracle() const { return size(WbcKind::kOracle); }
  [[nodiscard]] int student() const { return size(WbcKind::kStudent); }
  [[nodiscard]] int critic(int bodies) const { return oracle() + 9 * bodies; }
  // The channels as a network's header has them; all that the student is shown of the past is one entry, "history".
  [[nodiscard]] std::vector<LayoutEntry> channels(WbcKind kind) const;

 private:
  int n_;
};

// One input. The oracle's: joint position and velocity, base angular and linear velocity, gravity, action, then the
// reference's joint position and velocity, root position error, root orientation error. The student's: a frame (joint
// position and velocity, base angular velocity, gravity, action), the same of the reference, and the ten frames before,
// oldest first, the first of an episode standing for those before it.
const ObservationLayout& wbc_observation(WbcKind kind);

// The values read from sensors and from u_t; noise is added here (Table S3) before it is written.
struct WbcSensors {
  Eigen::VectorXd q, v;                                  // relative to neutral; [rad], [rad/s]
  Eigen::Vector3d w = Eigen::Vector3d::Zero();           // gyro [rad/s]
  Eigen::Vector3d velocity_B = Eigen::Vector3d::Zero();  // of the base, in B (privileged) [m/s]
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();     // unit, in B
  Eigen::VectorXd q_ref, v_ref;                          // relative to neutral
  Eigen::Vector3d root_error = Eigen::Vector3d::Zero();  // of the reference from the base, in B, at most 1 m
  Eigen::Matrix<double, 6, 1> root_turn = Eigen::Matrix<double, 6, 1>::Zero();  // first two columns of R_B,Ref
};

// No allocation after the first call.
void read_sensors(const RobotState& state, const WbcTracker& tracker, WbcSensors& sensors);

// Writes the input of a network, tick by tick. No allocation after construction.
class WbcObserver {
 public:
  WbcObserver(WbcKind kind, int joints) : writer_(wbc_observation(kind), WbcLayout(joints).widths()) {}
  void reset() { writer_.reset(); }
  // Valid until the next update.
  std::span<const float> update(const WbcSensors& sensors, const Eigen::VectorXf& action);

 private:
  ObservationWriter writer_;
};

// The oracle's, which has no past.
void write_oracle(const WbcSensors& sensors, const Eigen::VectorXf& action, std::span<float> out);

// Position and orientation (first two columns) of the links that the critic sees, the card's bodies (of the G1: 22),
// from the root's reference, in its frame. Appended to the oracle's observation.
void write_bodies(const Kinematics& actual, const Pose& X_WRef, const std::vector<int>& links, std::span<float> out);

}  // namespace duet
