#include "duet/controllers/wbc_sim/observation.h"

#include <algorithm>

namespace duet {
namespace {

class Writer {
 public:
  explicit Writer(std::span<float> out) : to_(out.data()) {}
  template <typename Vector>
  void operator()(const Vector& values) {
    for (Eigen::Index i = 0; i < values.size(); ++i) *to_++ = static_cast<float>(values[i]);
  }

 private:
  float* to_;
};

Eigen::Matrix<double, 6, 1> two_columns(const Eigen::Matrix3d& R) {
  Eigen::Matrix<double, 6, 1> columns;
  columns << R.col(0), R.col(1);
  return columns;
}

void write_frame(const WbcSensors& sensors, const Eigen::VectorXf& action, Writer& write) {
  write(sensors.q);
  write(sensors.v);
  write(sensors.w);
  write(sensors.gravity);
  write(action);
}

void write_reference(const WbcSensors& sensors, Writer& write) {
  write(sensors.q_ref);
  write(sensors.v_ref);
  write(sensors.root_error);
  write(sensors.root_turn);
}

}  // namespace

std::vector<ChannelSpan> WbcLayout::oracle_channels() const {
  return {{"joint_position", n_},
          {"joint_velocity", n_},
          {"base_angular_velocity", 3},
          {"base_linear_velocity", 3},
          {"gravity", 3},
          {"previous_action", n_},
          {"reference_joint_position", n_},
          {"reference_joint_velocity", n_},
          {"root_position_error", 3},
          {"root_orientation_error", 6}};
}

std::vector<ChannelSpan> WbcLayout::student_channels() const {
  return {{"joint_position", n_},           {"joint_velocity", n_},
          {"base_angular_velocity", 3},     {"gravity", 3},
          {"previous_action", n_},          {"reference_joint_position", n_},
          {"reference_joint_velocity", n_}, {"root_position_error", 3},
          {"root_orientation_error", 6},    {"history", kWbcHistory * frame()}};
}

void read_sensors(const RobotState& state, const WbcTracker& tracker, WbcSensors& sensors) {
  const Eigen::VectorXd& neutral = tracker.robot().neutral;
  const Eigen::Matrix3d R_BW = state.X_WB.R.toRotationMatrix().transpose();
  sensors.q = state.q - neutral;
  sensors.v = state.v;
  sensors.w = state.w_WB_B;
  sensors.velocity_B = R_BW * state.v_WB;
  sensors.gravity = -R_BW.col(2);
  sensors.q_ref = tracker.q() - neutral;
  sensors.v_ref = tracker.v();
  sensors.root_error = R_BW * (tracker.root().p - state.X_WB.p);
  const double distance = sensors.root_error.norm();
  if (distance > 1.0) sensors.root_error /= distance;
  sensors.root_turn = two_columns(R_BW * tracker.root().R.toRotationMatrix());
}

void write_oracle(const WbcSensors& sensors, const Eigen::VectorXf& action, std::span<float> out) {
  Writer write(out);
  write(sensors.q);
  write(sensors.v);
  write(sensors.w);
  write(sensors.velocity_B);
  write(sensors.gravity);
  write(action);
  write_reference(sensors, write);
}

void WbcHistory::fill(const WbcSensors& sensors, const Eigen::VectorXf& action) {
  for (int i = 0; i < kWbcHistory; ++i) add(sensors, action);
}

void WbcHistory::add(const WbcSensors& sensors, const Eigen::VectorXf& action) {
  std::copy(frames_.begin() + size_, frames_.end(), frames_.begin());
  Writer write({frames_.data() + frames_.size() - size_, static_cast<size_t>(size_)});
  write_frame(sensors, action, write);
}

void write_student(const WbcSensors& sensors, const Eigen::VectorXf& action, const WbcHistory& history,
                   std::span<float> out) {
  Writer write(out);
  write_frame(sensors, action, write);
  write_reference(sensors, write);
  std::copy(history.values().begin(), history.values().end(), out.end() - history.values().size());
}

void write_bodies(const Kinematics& actual, const Pose& X_WRef, const std::vector<int>& links, std::span<float> out) {
  const Eigen::Matrix3d R_RefW = X_WRef.R.toRotationMatrix().transpose();
  Writer write(out);
  for (const int link : links) {
    write(Eigen::Vector3d(R_RefW * (actual.p_WL(link) - X_WRef.p)));
    write(two_columns(R_RefW * actual.R_WL(link)));
  }
}

}  // namespace duet
