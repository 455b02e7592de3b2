#include "duet/policies/policy.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/core/require.h"

namespace duet {
namespace {

bool is_finite(const ObservationFrame& frame) {
  const RobotState& robot = frame.robot;
  return frame.partner.allFinite() && robot.X_WB.p.allFinite() && robot.X_WB.R.coeffs().allFinite() &&
         robot.v_WB.allFinite() && robot.w_WB_B.allFinite() && robot.q.allFinite() && robot.v.allFinite();
}

}  // namespace

std::vector<Reference> leave_out(PolicyFaults& faults, std::string_view policy, int tick, std::string_view problem) {
  ++faults.invalid;
  if (faults.message.empty()) faults.message = fmt::format("policy '{}': tick {}: {}", policy, tick, problem);
  return {};
}

void require_known_task(std::string_view policy, std::span<const Task> known, Task task) {
  if (std::ranges::find(known, task) != known.end()) return;
  throw MissingError(fmt::format("policy '{}' was not made for the task '{}': it knows {}", policy, to_string(task),
                                 fmt::join(task_names(known), ", ")));
}

bool is_finite(const Observation& observation) {
  return std::ranges::all_of(observation.history, [](const ObservationFrame& frame) { return is_finite(frame); });
}

Eigen::Vector4d wxyz_of(const Eigen::Quaterniond& R) {
  const double sign = R.w() < 0.0 ? -1.0 : 1.0;
  return sign * Eigen::Vector4d(R.w(), R.x(), R.y(), R.z());
}

Eigen::VectorXd to_vector(const ObservationFrame& frame, const Eigen::Vector3d& start_position) {
  const RobotState& robot = frame.robot;
  const Eigen::Matrix3d R_BW = robot.X_WB.R.conjugate().toRotationMatrix();
  Eigen::VectorXd vector(3 + frame.partner.size() + 9 + robot.q.size() + robot.v.size() + 7);
  vector << frame.partner.col(0), frame.partner.reshaped(), R_BW * robot.v_WB, robot.w_WB_B,
      R_BW * -Eigen::Vector3d::UnitZ(), robot.q, robot.v, robot.X_WB.p - start_position, wxyz_of(robot.X_WB.R);
  return vector;
}

std::vector<Reference> Policy::plan(const Observation& observation) { return densify(act(observation)); }

}  // namespace duet
