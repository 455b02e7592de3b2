// Observations of WBC-Sim (supplement A.3.2, Table S1), as the printed totals decode: oracle actor 163, student actor
// 1090, critic 361. Written as float, unscaled (a normaliser follows). docs/deviations.md says what Table S1's marks
// contradict.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "duet/controllers/wbc_sim/tracker.h"
#include "duet/robots/kinematics.h"

namespace duet {

struct ChannelSpan {
  std::string name;
  int size = 0;
};

inline constexpr int kWbcHistory = 10;

// Sizes for a robot of n joints, and what is where. n = 29: frame 93, oracle 163, student 1090, critic 361.
class WbcLayout {
 public:
  explicit WbcLayout(int joints) : n_(joints) {}
  [[nodiscard]] int joints() const { return n_; }
  [[nodiscard]] int frame() const { return 3 * n_ + 6; }      // q, v, w, g, a: what the history keeps
  [[nodiscard]] int reference() const { return 2 * n_ + 9; }  // q_ref, v_ref, root position 3, orientation 6
  [[nodiscard]] int oracle() const { return frame() + 3 + reference(); }
  [[nodiscard]] int student() const { return frame() + reference() + kWbcHistory * frame(); }
  [[nodiscard]] int critic(int bodies) const { return oracle() + 9 * bodies; }
  [[nodiscard]] std::vector<ChannelSpan> oracle_channels() const;
  [[nodiscard]] std::vector<ChannelSpan> student_channels() const;

 private:
  int n_;
};

// What is read from sensors and from u_t; noise is added here (Table S3) before it is written.
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

// Order: q, v, w, velocity_B, gravity, action, q_ref, v_ref, root_error, root_turn.
void write_oracle(const WbcSensors& sensors, const Eigen::VectorXf& action, std::span<float> out);

// The last ten frames (q, v, w, gravity, action), oldest first, without the current one.
class WbcHistory {
 public:
  explicit WbcHistory(const WbcLayout& layout) : size_(layout.frame()), frames_(kWbcHistory * layout.frame(), 0.0F) {}
  void fill(const WbcSensors& sensors, const Eigen::VectorXf& action);  // an episode begins: this stands for all ten
  void add(const WbcSensors& sensors, const Eigen::VectorXf& action);
  [[nodiscard]] std::span<const float> values() const { return frames_; }

 private:
  int size_;  // of a frame
  std::vector<float> frames_;
};

// Order: q, v, w, gravity, action, q_ref, v_ref, root_error, root_turn, history.
void write_student(const WbcSensors& sensors, const Eigen::VectorXf& action, const WbcHistory& history,
                   std::span<float> out);

// Position and orientation (first two columns) of the links that the critic sees, the card's bodies (of the G1: 22),
// from the root's reference, in its frame. Appended to the oracle's observation.
void write_bodies(const Kinematics& actual, const Pose& X_WRef, const std::vector<int>& links, std::span<float> out);

}  // namespace duet
