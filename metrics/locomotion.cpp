#include "duet/metrics/locomotion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

// A swing is from where the foot rises above 1.5 cm until it is below 1 cm again.
constexpr double kLifted = 0.015, kDownward = 0.01;

void add_speeds(const Recording& recording, std::map<std::string, double>& metrics) {
  const int first = static_cast<int>(std::lround(kWalkSettles * recording.rate_hz));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int t = first; t < recording.frames(); ++t) {
    const RobotState& state = recording.robot[t];
    const Eigen::Vector3d v_heading = yaw_rotation(-yaw_of(state.X_WB.R)) * state.v_WB;
    sum += Eigen::Vector3d(v_heading.x(), v_heading.y(), (state.X_WB.R * state.w_WB_B).z());
  }
  if (recording.frames() <= first) return;
  sum /= recording.frames() - first;
  metrics["speed_forward"] = sum.x();
  metrics["speed_sideways"] = sum.y();
  metrics["turn_rate"] = sum.z();
}

// The highest rise of one foot's link over where it stood at the start, swing by swing.
class SwingMeter {
 public:
  void add(double height) {
    if (height > kLifted) top_ = std::max(top_, height);
    if (height > kDownward || top_ == 0.0) return;
    sum_ += top_;
    ++swings_;
    top_ = 0.0;
  }
  [[nodiscard]] double sum() const { return sum_; }
  [[nodiscard]] int swings() const { return swings_; }

 private:
  double top_ = 0.0, sum_ = 0.0;
  int swings_ = 0;
};

void add_feet(const Recording& recording, const RobotModel& robot, std::map<std::string, double>& metrics) {
  const std::vector<std::vector<int>> soles = soles_of_feet(robot);
  if (soles.size() != 2 || recording.frames() == 0) return;
  const std::array<int, 2> links = {robot.shapes[soles[0].front()].link, robot.shapes[soles[1].front()].link};
  Kinematics kinematics(robot);
  std::array<SwingMeter, 2> swings;
  std::array<double, 2> stance{};
  double closest = std::numeric_limits<double>::infinity();
  for (int t = 0; t < recording.frames(); ++t) {
    kinematics.update(recording.robot[t].X_WB, recording.robot[t].q);
    for (int side = 0; side < 2; ++side) {
      const double height = kinematics.p_WL(links[side]).z();
      if (t == 0) stance[side] = height;
      swings[side].add(height - stance[side]);
    }
    closest = std::min(closest, (kinematics.p_WL(links[0]) - kinematics.p_WL(links[1])).head<2>().norm());
  }
  metrics["closest_feet"] = closest;
  const int count = swings[0].swings() + swings[1].swings();
  if (count > 0) metrics["swing_height"] = (swings[0].sum() + swings[1].sum()) / count;
}

void add_upper_body(const Recording& recording, const RobotModel& robot, std::map<std::string, double>& metrics) {
  const std::vector<int> legs = leg_joints(robot);
  double angle = 0.0, rate = 0.0;
  long count = 0;
  for (int t = 1; t + 1 < recording.frames(); ++t) {
    const RobotState& state = recording.robot[t];
    const Eigen::VectorXd& q = recording.reference[t].q;
    for (int joint = 0; joint < robot.dof(); ++joint) {
      if (std::ranges::binary_search(legs, joint)) continue;
      const double wanted =
          (recording.reference[t + 1].q[joint] - recording.reference[t - 1].q[joint]) * recording.rate_hz / 2.0;
      angle += std::abs(state.q[joint] - q[joint]);
      rate += std::abs(state.v[joint] - wanted);
      ++count;
    }
  }
  if (count == 0) return;
  metrics["upper_body_error"] = angle / static_cast<double>(count);
  metrics["upper_body_rate_error"] = rate / static_cast<double>(count);
}

}  // namespace

std::map<std::string, double> locomotion_metrics(const Recording& recording, const RobotModel& robot) {
  std::map<std::string, double> metrics;
  add_speeds(recording, metrics);
  add_feet(recording, robot, metrics);
  add_upper_body(recording, robot, metrics);
  if (recording.frames() > 0)
    metrics["drift"] = (recording.robot.back().X_WB.p - recording.robot.front().X_WB.p).head<2>().norm();
  return metrics;
}

}  // namespace duet
