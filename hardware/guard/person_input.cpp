#include "duet/hardware/guard/person_input.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "duet/core/recording.h"

namespace duet {
namespace {

constexpr std::uint32_t kPersonVersion = 0x314A5044;         // "DPJ1"
constexpr double kFarthestJoint = 20.0, kLongestBone = 1.0;  // [m]
constexpr int kMostEstimates = 16;                           // of a tick

struct PersonWire {
  std::uint32_t version, seen;
  std::uint64_t sequence;
  double stamp;
  double joints[3 * kSmplJoints];  // x, y, z of each
};
static_assert(sizeof(PersonWire) == kPersonBytes && std::endian::native == std::endian::little);

PersonFault fault_of_joints(const HumanJoints& joints) {
  if (!joints.allFinite()) return PersonFault::kFinite;
  if (joints.colwise().norm().maxCoeff() > kFarthestJoint) return PersonFault::kFar;
  for (int j = 1; j < kSmplJoints; ++j)
    if ((joints.col(j) - joints.col(kSmplParents[static_cast<std::size_t>(j)])).norm() > kLongestBone)
      return PersonFault::kBody;
  return PersonFault::kNone;
}

}  // namespace

void encode(const PersonEstimate& estimate, PersonBuffer& buffer) {
  PersonWire wire{kPersonVersion, estimate.seen ? 1u : 0u, estimate.sequence, estimate.stamp, {}};
  std::memcpy(wire.joints, estimate.joints.data(), sizeof(wire.joints));
  std::memcpy(buffer.data(), &wire, sizeof(wire));
}

PersonFault decode(std::span<const std::byte> datagram, PersonEstimate& estimate) {
  PersonWire wire;
  if (datagram.size() != sizeof(wire)) return PersonFault::kForm;
  std::memcpy(&wire, datagram.data(), sizeof(wire));
  if (wire.version != kPersonVersion || wire.seen > 1) return PersonFault::kForm;
  HumanJoints joints;
  std::memcpy(joints.data(), wire.joints, sizeof(wire.joints));
  if (wire.seen == 1)
    if (const PersonFault fault = fault_of_joints(joints); fault != PersonFault::kNone) return fault;
  estimate = {wire.sequence, wire.stamp, wire.seen == 1, joints};
  return PersonFault::kNone;
}

PersonFault PersonTrack::receive(const PersonEstimate& estimate, const Pose& X_WB, double now) {
  if (!order_.takes(estimate.sequence, now)) return PersonFault::kOld;
  if (!estimate.seen) return PersonFault::kUnseen;
  const Pose X_WC = X_WB * X_BC_;
  newest_ = (newest_ + 1) % kKept;
  Kept& kept = kept_[newest_];
  kept.at = now;
  kept.joints = X_WC.R.toRotationMatrix() * estimate.joints;
  kept.joints.colwise() += X_WC.p;
  return PersonFault::kNone;
}

const HumanJoints* PersonTrack::at(double now, double most_age) {
  if (!(now - newest_at() <= most_age)) return nullptr;
  const double wanted = now - delay_;
  const Kept* after = &kept_[newest_];
  for (std::size_t back = 1; back < kKept && after->at > wanted; ++back) {
    const Kept& before = kept_[(newest_ + kKept - back) % kKept];
    if (before.at == kNever) break;
    if (before.at <= wanted) {
      const double part = (wanted - before.at) / (after->at - before.at);
      between_ = before.joints + part * (after->joints - before.joints);
      return &between_;
    }
    after = &before;
  }
  between_ = after->joints;
  return &between_;
}

void PersonInput::poll(double now, RobotGuard& guard) {
  std::array<std::byte, kPersonBytes + 1> buffer;  // a longer one is refused
  for (int k = 0; k < kMostEstimates; ++k) {
    const std::size_t size = socket_.receive(buffer);
    if (size == 0) return;
    PersonFault fault = decode(std::span<const std::byte>(buffer).first(size), estimate_);
    if (fault == PersonFault::kNone) fault = track_.receive(estimate_, guard.limiter_input().state.X_WB, now);
    ++faults_[static_cast<std::size_t>(fault)];
    if (fault != PersonFault::kNone) continue;
    ++used_;
    ++message_.sequence;
    message_.joints = track_.newest();
    message_.sender_restarts = track_.restarts();
    guard.receive(message_, now);
  }
}

}  // namespace duet
