#include "duet/hardware/guard/guard_message.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace duet {
namespace {

constexpr std::uint32_t kVersion = 0x44475533;  // "DGU3"

struct GuardHead {
  std::uint32_t version, kind;
  std::uint64_t sequence;
};

struct PlannerBody {
  GuardHead head;
  double stamp, forward, lateral, yaw_rate, height;
  double q[kG1Motors];
  std::uint64_t acting, has_goal;
  double goal[7];  // position, quaternion x, y, z, w
};

struct PersonBody {
  GuardHead head;
  double latency;
  double joints[3 * kSmplJoints];  // x, y, z of each
};

static_assert(sizeof(GuardHead) == 16 && sizeof(PlannerBody) == 16 + 8 * (5 + kG1Motors + 9));
static_assert(sizeof(PersonBody) == 16 + 8 * 73 && sizeof(PersonBody) <= kMostGuardBytes);
static_assert(sizeof(PlannerBody) != sizeof(PersonBody) && std::endian::native == std::endian::little);

GuardHead head_of(GuardMessageKind kind, std::uint64_t sequence) {
  return {kVersion, static_cast<std::uint32_t>(kind), sequence};
}

template <typename Body>
std::size_t put(const Body& body, GuardBuffer& buffer) {
  std::memcpy(buffer.data(), &body, sizeof(body));
  return sizeof(body);
}

template <typename Body>
bool get(std::span<const std::byte> datagram, Body& body) {
  if (datagram.size() != sizeof(body)) return false;
  std::memcpy(&body, datagram.data(), sizeof(body));
  return true;
}

bool read_planner(std::span<const std::byte> datagram, PlannerMessage& message) {
  PlannerBody body;
  if (!get(datagram, body)) return false;
  message.sequence = body.head.sequence;
  message.command.stamp = body.stamp;
  message.command.root = {body.forward, body.lateral, body.yaw_rate, body.height};
  for (int j = 0; j < kG1Motors; ++j) message.command.q[j] = body.q[j];
  message.acting = body.acting != 0;
  message.goal.reset();
  if (body.has_goal == 0) return true;
  message.goal.emplace();
  std::memcpy(message.goal->p.data(), body.goal, 3 * sizeof(double));
  std::memcpy(message.goal->R.coeffs().data(), body.goal + 3, 4 * sizeof(double));
  return true;
}

bool read_person(std::span<const std::byte> datagram, PersonMessage& message) {
  PersonBody body;
  if (!get(datagram, body)) return false;
  message.sequence = body.head.sequence;
  message.latency = body.latency;
  std::memcpy(message.joints.data(), body.joints, sizeof(body.joints));
  return true;
}

}  // namespace

std::size_t encode(const PlannerMessage& message, GuardBuffer& buffer) {
  const VelocityCommand& root = message.command.root;
  PlannerBody body{head_of(GuardMessageKind::kPlanner, message.sequence),
                   message.command.stamp,
                   root.forward,
                   root.lateral,
                   root.yaw_rate,
                   root.height,
                   {},
                   message.acting ? 1u : 0u,
                   message.goal ? 1u : 0u,
                   {}};
  const Pose goal = message.goal.value_or(Pose{});
  std::memcpy(body.goal, goal.p.data(), 3 * sizeof(double));
  std::memcpy(body.goal + 3, goal.R.coeffs().data(), 4 * sizeof(double));
  for (int j = 0; j < kG1Motors; ++j) body.q[j] = message.command.q[j];
  return put(body, buffer);
}

std::size_t encode(const PersonMessage& message, GuardBuffer& buffer) {
  PersonBody body{head_of(GuardMessageKind::kPerson, message.sequence), message.latency, {}};
  std::memcpy(body.joints, message.joints.data(), sizeof(body.joints));
  return put(body, buffer);
}

std::size_t encode_stop(GuardBuffer& buffer) { return put(head_of(GuardMessageKind::kStop, 0), buffer); }

GuardMessageKind decode(std::span<const std::byte> datagram, GuardMessage& message) {
  GuardHead head;
  if (datagram.size() < sizeof(head)) return GuardMessageKind::kRefused;
  std::memcpy(&head, datagram.data(), sizeof(head));
  if (head.version != kVersion) return GuardMessageKind::kRefused;
  switch (static_cast<GuardMessageKind>(head.kind)) {
    case GuardMessageKind::kPlanner:
      return read_planner(datagram, message.planner) ? GuardMessageKind::kPlanner : GuardMessageKind::kRefused;
    case GuardMessageKind::kPerson:
      return read_person(datagram, message.person) ? GuardMessageKind::kPerson : GuardMessageKind::kRefused;
    case GuardMessageKind::kStop:
      return datagram.size() == sizeof(head) ? GuardMessageKind::kStop : GuardMessageKind::kRefused;
    default:
      return GuardMessageKind::kRefused;
  }
}

namespace {

constexpr std::uint64_t kReportVersion = 0x3252475544;  // "DUGR2"

struct ReportBody {
  std::uint64_t version, tick, planner_sequence, state, cause, odometry, old_messages;
  double now, odometry_at;
  std::uint64_t tracked, reserved[2];
  double root_pose[7], root_velocity[3], root_gyro[3];  // position, quaternion x, y, z, w
  double q[kG1Motors], v[kG1Motors], tau[kG1Motors], q_target[kG1Motors];
  double root[4];
  double person[3 * kSmplJoints];
  std::int64_t clamps[kClampReasons];
};
static_assert(sizeof(ReportBody) == kReportBytes && std::endian::native == std::endian::little);

void put_vector(const Eigen::VectorXd& from, double (&to)[kG1Motors]) {
  for (int j = 0; j < kG1Motors; ++j) to[j] = from[j];
}

bool get_vector(const double (&from)[kG1Motors], Eigen::VectorXd& to) {
  for (int j = 0; j < kG1Motors; ++j) to[j] = from[j];
  return to.allFinite();
}

void get_root(const ReportBody& body, GuardReport& report) {
  std::memcpy(report.robot.X_WB.p.data(), body.root_pose, 3 * sizeof(double));
  std::memcpy(report.robot.X_WB.R.coeffs().data(), body.root_pose + 3, 4 * sizeof(double));
  std::memcpy(report.robot.v_WB.data(), body.root_velocity, sizeof(body.root_velocity));
  std::memcpy(report.robot.w_WB_B.data(), body.root_gyro, sizeof(body.root_gyro));
  report.root = {body.root[0], body.root[1], body.root[2], body.root[3]};
}

bool root_is_sane(const GuardReport& report) {
  const VelocityCommand& root = report.root;
  return report.robot.X_WB.p.allFinite() && std::abs(report.robot.X_WB.R.norm() - 1.0) < 1e-3 &&
         report.robot.v_WB.allFinite() && report.robot.w_WB_B.allFinite() && std::isfinite(root.forward) &&
         std::isfinite(root.lateral) && std::isfinite(root.yaw_rate) && std::isfinite(root.height);
}

}  // namespace

GuardReport::GuardReport() {
  for (Eigen::VectorXd* values : {&robot.q, &robot.v, &tau, &q_target}) values->setZero(kG1Motors);
}

void fill_report(const RobotGuard& guard, GuardReport& report) {
  const GuardStatus& status = guard.status();
  report.tick = static_cast<std::uint64_t>(status.ticks);
  report.now = status.input.now;
  report.planner_sequence = guard.planner().sequence;
  report.state = status.safety.state;
  report.cause = status.safety.cause;
  report.odometry = guard.limiter_input().odometry;
  report.odometry_at = guard.odometry().at;
  report.old_messages = status.old_messages;
  report.robot = guard.measured();
  report.tau = guard.reading().tau;
  report.q_target = guard.joints().q_target;
  report.root = status.limited.root;
  report.clamps = status.clamps;
  report.tracked = guard.tracked(report.person);
}

GuardReport report_of(const RobotGuard& guard) {
  GuardReport report;
  fill_report(guard, report);
  return report;
}

void encode(const GuardReport& report, ReportBuffer& buffer) {
  ReportBody body{};
  body.version = kReportVersion;
  body.tick = report.tick;
  body.planner_sequence = report.planner_sequence;
  body.state = static_cast<std::uint64_t>(report.state);
  body.cause = static_cast<std::uint64_t>(report.cause);
  body.odometry = report.odometry ? 1 : 0;
  body.old_messages = static_cast<std::uint64_t>(report.old_messages);
  body.now = report.now;
  body.odometry_at = report.odometry_at;
  const RobotState& robot = report.robot;
  std::memcpy(body.root_pose, robot.X_WB.p.data(), 3 * sizeof(double));
  std::memcpy(body.root_pose + 3, robot.X_WB.R.coeffs().data(), 4 * sizeof(double));
  std::memcpy(body.root_velocity, robot.v_WB.data(), sizeof(body.root_velocity));
  std::memcpy(body.root_gyro, robot.w_WB_B.data(), sizeof(body.root_gyro));
  put_vector(robot.q, body.q);
  put_vector(robot.v, body.v);
  put_vector(report.tau, body.tau);
  put_vector(report.q_target, body.q_target);
  const double root[4] = {report.root.forward, report.root.lateral, report.root.yaw_rate, report.root.height};
  std::memcpy(body.root, root, sizeof(root));
  for (std::size_t k = 0; k < kClampReasons; ++k) body.clamps[k] = report.clamps[k];
  body.tracked = report.tracked ? 1 : 0;
  std::memcpy(body.person, report.person.data(), sizeof(body.person));
  std::memcpy(buffer.data(), &body, sizeof(body));
}

bool decode(std::span<const std::byte> datagram, GuardReport& report) {
  ReportBody body;
  if (datagram.size() != sizeof(body)) return false;
  std::memcpy(&body, datagram.data(), sizeof(body));
  if (body.version != kReportVersion || body.state >= kSafetyStates || body.cause >= kStopCauses) return false;
  report.tick = body.tick;
  report.now = body.now;
  report.planner_sequence = body.planner_sequence;
  report.state = static_cast<SafetyState>(body.state);
  report.cause = static_cast<StopCause>(body.cause);
  report.odometry = body.odometry != 0;
  report.odometry_at = body.odometry_at;
  report.old_messages = static_cast<long>(body.old_messages);
  for (std::size_t k = 0; k < kClampReasons; ++k) report.clamps[k] = body.clamps[k];
  report.tracked = body.tracked != 0;
  std::memcpy(report.person.data(), body.person, sizeof(body.person));
  get_root(body, report);
  const bool joints = get_vector(body.q, report.robot.q) && get_vector(body.v, report.robot.v) &&
                      get_vector(body.tau, report.tau) && get_vector(body.q_target, report.q_target);
  return joints && root_is_sane(report) && std::isfinite(body.now) && report.person.allFinite();
}

std::string report_path(const std::string& socket) { return socket + ".report"; }

std::string status_path(const std::string& socket) { return socket + ".status"; }

}  // namespace duet
