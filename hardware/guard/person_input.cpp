#include "duet/hardware/guard/person_input.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "duet/core/recording.h"

namespace duet {
namespace {

constexpr std::uint32_t kFirstPersonVersion = 0x314A5044, kPersonVersion = 0x324A5044;  // "DPJ1", "DPJ2"
constexpr double kFarthestJoint = 20.0, kLongestBone = 1.0;                             // [m]
constexpr int kMostEstimates = 16;                                                      // of a tick
constexpr double kJitter = 0.03;  // of the way of a message, less than a picture; no latency [s]

struct PersonWire {
  std::uint32_t version, seen;
  std::uint64_t sequence;
  double stamp;
  double joints[3 * kSmplJoints];  // x, y, z of each
  double latency;                  // not in the first form
};
static_assert(sizeof(PersonWire) == kPersonBytes && std::endian::native == std::endian::little);
static_assert(offsetof(PersonWire, latency) == kFirstPersonBytes);

PersonFault fault_of_joints(const HumanJoints& joints) {
  if (!joints.allFinite()) return PersonFault::kFinite;
  if (joints.colwise().norm().maxCoeff() > kFarthestJoint) return PersonFault::kFar;
  for (int j = 1; j < kSmplJoints; ++j)
    if ((joints.col(j) - joints.col(kSmplParents[static_cast<std::size_t>(j)])).norm() > kLongestBone)
      return PersonFault::kBody;
  return PersonFault::kNone;
}

PersonFault fault_of_latency(double latency) {
  if (!std::isfinite(latency)) return PersonFault::kFinite;
  if (latency < 0.0) return PersonFault::kForm;
  return latency > SafetyRules{}.person.hold ? PersonFault::kLate : PersonFault::kNone;
}

}  // namespace

void encode(const PersonEstimate& estimate, PersonBuffer& buffer) {
  PersonWire wire{kPersonVersion, estimate.seen ? 1u : 0u, estimate.sequence, estimate.stamp, {}, estimate.latency};
  std::memcpy(wire.joints, estimate.joints.data(), sizeof(wire.joints));
  std::memcpy(buffer.data(), &wire, sizeof(wire));
}

PersonFault decode(std::span<const std::byte> datagram, PersonEstimate& estimate) {
  PersonWire wire{};
  if (datagram.size() != kPersonBytes && datagram.size() != kFirstPersonBytes) return PersonFault::kForm;
  std::memcpy(&wire, datagram.data(), datagram.size());
  const std::uint32_t version = datagram.size() == kPersonBytes ? kPersonVersion : kFirstPersonVersion;
  if (wire.version != version || wire.seen > 1) return PersonFault::kForm;
  if (const PersonFault fault = fault_of_latency(wire.latency); fault != PersonFault::kNone) return fault;
  HumanJoints joints;
  std::memcpy(joints.data(), wire.joints, sizeof(wire.joints));
  if (wire.seen == 1)
    if (const PersonFault fault = fault_of_joints(joints); fault != PersonFault::kNone) return fault;
  estimate = {wire.sequence, wire.stamp, wire.seen == 1, joints, wire.latency};
  return PersonFault::kNone;
}

void PersonPlacer::base(const Pose& X_WB, double now) {
  newest_ = (newest_ + 1) % kBases;
  bases_[newest_] = {now, X_WB};
}

// Between the two poses around that time; the oldest or newest beyond them.
Pose PersonPlacer::base_at(double time) const {
  const Base* after = &bases_[newest_];
  for (std::size_t back = 1; back < kBases && after->at > time; ++back) {
    const Base& before = bases_[(newest_ + kBases - back) % kBases];
    if (before.at == kNever) break;
    if (before.at <= time) {
      const double part = (time - before.at) / (after->at - before.at);
      return {before.X_WB.R.slerp(part, after->X_WB.R), before.X_WB.p + part * (after->X_WB.p - before.X_WB.p)};
    }
    after = &before;
  }
  return after->X_WB;
}

PersonFault PersonPlacer::place(const PersonEstimate& estimate, double now, PersonMessage& message) {
  if (!order_.takes(estimate.sequence, now)) return PersonFault::kOld;
  if (!estimate.seen) return PersonFault::kUnseen;
  const double late = way_.see(estimate.stamp, now);
  const double latency = estimate.latency + camera_.latency + (late > kJitter ? late : 0.0);
  if (const PersonFault fault = fault_of_latency(latency); fault != PersonFault::kNone) return fault;
  const Pose X_WC = base_at(now - latency) * camera_.X_BC;
  message.sequence = ++sequence_;
  message.latency = latency;
  message.sender_restarts = order_.restarts();
  message.joints = X_WC.R.toRotationMatrix() * estimate.joints;
  message.joints.colwise() += X_WC.p;
  return PersonFault::kNone;
}

void PersonInput::poll(double now, RobotGuard& guard) {
  placer_.base(guard.measured().X_WB, now);
  std::array<std::byte, kPersonBytes + 1> buffer;  // a longer one is refused
  for (int k = 0; k < kMostEstimates; ++k) {
    const std::size_t size = socket_.receive(buffer);
    if (size == 0) return;
    PersonFault fault = decode(std::span<const std::byte>(buffer).first(size), estimate_);
    if (fault == PersonFault::kNone) fault = placer_.place(estimate_, now, message_);
    if (fault == PersonFault::kNone)
      guard.receive(message_, now);
    else
      guard.note_estimate(fault);
  }
}

}  // namespace duet
