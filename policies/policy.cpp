#include "policies/policy.h"

#include <array>
#include <utility>

#include "core/names.h"
#include "core/require.h"
#include "policies/null_policy.h"
#include "policies/replay_policy.h"
#include "policies/scheduler.h"

namespace duet {
namespace {

using Robot = std::shared_ptr<const RobotModel>;

template <typename T>
std::unique_ptr<Policy> make(Robot robot) {
  return std::make_unique<T>(std::move(robot));
}

struct PolicyEntry {
  std::string_view name;
  std::unique_ptr<Policy> (*make)(Robot robot);
};

constexpr std::array<PolicyEntry, 3> kPolicies = {
    {{"replay", make<ReplayPolicy>}, {"replay_dense", make<DenseReplayPolicy>}, {"null", make<NullPolicy>}}};

}  // namespace

Eigen::VectorXd to_vector(const ObservationFrame& frame, const Eigen::Vector3d& start_position) {
  const RobotState& robot = frame.robot;
  const Eigen::Matrix3d R_BW = robot.X_WB.R.conjugate().toRotationMatrix();
  // q and -q are one orientation: the one with w >= 0 stands for both.
  const double sign = robot.X_WB.R.w() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector4d wxyz(robot.X_WB.R.w(), robot.X_WB.R.x(), robot.X_WB.R.y(), robot.X_WB.R.z());
  Eigen::VectorXd vector(3 + frame.partner.size() + 9 + robot.q.size() + robot.v.size() + 7);
  vector << frame.partner.col(0), frame.partner.reshaped(), R_BW * robot.v_WB, robot.w_WB_B,
      R_BW * -Eigen::Vector3d::UnitZ(), robot.q, robot.v, robot.X_WB.p - start_position, sign * wxyz;
  return vector;
}

std::vector<Reference> Policy::plan(const Observation& observation) { return densify(act(observation)); }

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  names.reserve(kPolicies.size());
  for (const PolicyEntry& entry : kPolicies) names.emplace_back(entry.name);
  return names;
}

std::unique_ptr<Policy> make_policy(const std::string& name, std::shared_ptr<const RobotModel> robot) {
  for (const PolicyEntry& entry : kPolicies)
    if (entry.name == name) return entry.make(std::move(robot));
  throw std::invalid_argument(unknown_name_message("policy", name, policy_names()));
}

}  // namespace duet
