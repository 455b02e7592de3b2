#include "duet/hardware/guard_message.h"

#include <bit>
#include <cstdint>
#include <cstring>

namespace duet {
namespace {

constexpr std::uint32_t kVersion = 0x44475532;  // "DGU2"

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
  double joints[3 * 24];  // x, y, z of each
};

static_assert(sizeof(GuardHead) == 16 && sizeof(PlannerBody) == 16 + 8 * (5 + kG1Motors + 9));
static_assert(sizeof(PersonBody) == 16 + 8 * 72 && sizeof(PersonBody) <= kMostGuardBytes);
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
  PersonBody body{head_of(GuardMessageKind::kPerson, message.sequence), {}};
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

}  // namespace duet
