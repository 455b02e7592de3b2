#include "policies/policy.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/names.h"
#include "core/require.h"
#include "policies/dstar/dstar_policy.h"
#include "policies/external/external_policy.h"
#include "policies/null_policy.h"
#include "policies/replay_policy.h"
#include "policies/retrieval.h"
#include "policies/scheduler.h"

namespace duet {
namespace {

using Robot = std::shared_ptr<const RobotModel>;

// A policy by name: what is said of it, and how it is made once its options are known to be its own.
struct Entry {
  const char* name;
  PolicyInfo (*info)(const std::string& name);
  PolicyMaker (*maker)(const std::string& name, Robot robot, const PolicyOptions& options);
  LoadedFiles (*files)(const std::string& name, const PolicyOptions& options);
};

template <typename T>
PolicyMaker of(const std::string& name, Robot robot, const PolicyOptions&) {
  require(robot != nullptr, fmt::format("policy '{}' needs a robot", name));
  return [robot] { return std::make_unique<T>(robot); };
}

PolicyInfo replay_info(const std::string& name) {
  return {name, "The retargeted motion with hindsight, as anchors", {}};
}
LoadedFiles no_files(const std::string&, const PolicyOptions&) { return {}; }
PolicyInfo dense_info(const std::string& name) { return {name, "The same at 50 Hz, past the anchors", {}}; }
PolicyInfo null_info(const std::string& name) { return {name, "Holds the neutral pose where it stands", {}}; }

constexpr Entry kPolicies[] = {{"replay", replay_info, of<ReplayPolicy>, no_files},
                               {"replay_dense", dense_info, of<DenseReplayPolicy>, no_files},
                               {"null", null_info, of<NullPolicy>, no_files},
                               {"dstar", dstar_info, dstar_maker, dstar_files},
                               {"dp", dstar_info, dstar_maker, dstar_files},
                               {"retrieval", retrieval_info, retrieval_maker, retrieval_files}};

// A name that is the path of a policy descriptor.
constexpr Entry kDescriptor = {"", external_info, external_maker, external_files};

const Entry& find_entry(const std::string& name) {
  if (name.ends_with(".yaml")) return kDescriptor;
  for (const Entry& entry : kPolicies)
    if (name == entry.name) return entry;
  throw std::invalid_argument(unknown_name_message("policy", name, policy_names()));
}

bool is_finite(const ObservationFrame& frame) {
  const RobotState& robot = frame.robot;
  return frame.partner.allFinite() && robot.X_WB.p.allFinite() && robot.X_WB.R.coeffs().allFinite() &&
         robot.v_WB.allFinite() && robot.w_WB_B.allFinite() && robot.q.allFinite() && robot.v.allFinite();
}

}  // namespace

std::vector<Reference> PolicyFaults::leave_out(std::string_view policy, int tick, std::string_view problem) {
  ++invalid;
  if (message.empty()) message = fmt::format("policy '{}': tick {}: {}", policy, tick, problem);
  return {};
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

std::vector<PolicyInfo> policies() {
  std::vector<PolicyInfo> infos;
  for (const Entry& entry : kPolicies) infos.push_back(entry.info(entry.name));
  return infos;
}

std::vector<std::string> policy_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kPolicies) names.emplace_back(entry.name);
  return names;
}

PolicyInfo policy_info(const std::string& name) { return find_entry(name).info(name); }

LoadedFiles policy_files(const std::string& name, const PolicyOptions& options) {
  return find_entry(name).files(name, options);
}

PolicyMaker policy_maker(const std::string& name, Robot robot, const PolicyOptions& options) {
  const Entry& entry = find_entry(name);
  const PolicyInfo info = entry.info(name);
  std::vector<std::string> known;
  for (const PolicyOption& option : info.options) known.push_back(option.name);
  check_options("policy", name, options, known);
  return entry.maker(name, std::move(robot), options);
}

std::unique_ptr<Policy> make_policy(const std::string& name, Robot robot, const PolicyOptions& options) {
  return policy_maker(name, std::move(robot), options)();
}

}  // namespace duet
