#include "duet/rollout/yielding_partner.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "duet/core/recording.h"
#include "duet/core/require.h"

namespace duet {
namespace {

enum Part : int { kTrunk, kHeadPart, kLeftUpper, kRightUpper, kLeftLower, kRightLower, kParts };

int part_of(int joint) {
  switch (joint) {
    case kHead:
      return kHeadPart;
    case kLeftElbow:
      return kLeftUpper;
    case kRightElbow:
      return kRightUpper;
    case kLeftWrist:
    case kLeftHand:
      return kLeftLower;
    case kRightWrist:
    case kRightHand:
      return kRightLower;
    default:
      return kTrunk;
  }
}

struct PartLaw {
  double mass, stiffness, damping;  // against the trunk, the trunk's own against the floor
};

double damped(double stiffness, double mass) { return 2.0 * kYieldingArmDamping * std::sqrt(stiffness * mass); }

const std::array<PartLaw, kParts>& laws() {
  static const PartLaw upper{kYieldingForearmMass, kYieldingArmStiffness,
                             damped(kYieldingArmStiffness, kYieldingForearmMass)};
  static const PartLaw lower{kYieldingHandMass, kYieldingArmStiffness,
                             damped(kYieldingArmStiffness, kYieldingHandMass)};
  static const std::array<PartLaw, kParts> all = {
      {{kYieldingTrunkMass, kYieldingTrunkStiffness, kYieldingTrunkDamping},
       {kYieldingHeadMass, kYieldingHeadStiffness, damped(kYieldingHeadStiffness, kYieldingHeadMass)},
       upper,
       upper,
       lower,
       lower}};
  return all;
}

struct Bone {
  int from, to;  // SMPL joints
};
// Those whose ends may shift apart.
constexpr std::array<Bone, 5> kBones = {{{kNeck, kHead},
                                         {kLeftShoulder, kLeftElbow},
                                         {kRightShoulder, kRightElbow},
                                         {kLeftElbow, kLeftWrist},
                                         {kRightElbow, kRightWrist}}};
constexpr int kBoneCount = static_cast<int>(kBones.size());
constexpr double kNoBone = 1e-6, kBoneTolerance = 1e-12;  // [m], [m^2]
constexpr int kMostTurns = 20;

// A part lighter than its skin asks for at this step would be thrown about: a mass of resistance / kResolved is stable.
constexpr double kResolved = 1.5;

}  // namespace

YieldingPartner::YieldingPartner(const HumanBody& human, double dt) : human_(human), dt_(dt) {
  require(dt <= kYieldingLongestStep, "a yielding partner needs a physics step of at most {} s, found {} s",
          kYieldingLongestStep, dt);
}

void YieldingPartner::reset() {
  shift_.setZero();
  velocity_.setZero();
  force_.setZero();
  resistance_.fill(0.0);
  touched_ = false;
}

void YieldingPartner::lead(const HumanJoints& joints, const HumanJoints& velocities) {
  wanted_ = joints;
  wanted_velocities_ = velocities;
}

HumanJoints YieldingPartner::spread(const Parts& parts) {
  HumanJoints joints;
  for (int j = 0; j < kSmplJoints; ++j) joints.col(j) = parts.col(part_of(j));
  return joints;
}

// The force acts where the capsule's axis is nearest; its shares on the two ends do the work that it does there.
void YieldingPartner::feel(const Contact& contact) {
  const HumanCapsule& capsule = human_.capsules[static_cast<std::size_t>(contact.other)];
  const HumanJoints now = joints();
  const Eigen::Vector3d a = now.col(capsule.joint_a), bone = now.col(capsule.joint_b) - a;
  const double square = bone.squaredNorm();
  const double along = square > 0.0 ? (contact.p_WC - a).dot(bone) / square : 0.0;
  const double share = std::clamp(along, capsule.begin, capsule.end);
  Eigen::Matrix<double, kParts, 1> shares = Eigen::Matrix<double, kParts, 1>::Zero();
  shares[part_of(capsule.joint_a)] += 1.0 - share;
  shares[part_of(capsule.joint_b)] += share;
  const double skin = dt_ * capsule.skin.damping + dt_ * dt_ * capsule.skin.stiffness;
  for (int i = 0; i < kParts; ++i) {
    force_.col(i) -= shares[i] * contact.f_W;
    resistance_[i] += shares[i] * shares[i] * skin;
  }
}

void YieldingPartner::step(std::span<const Contact> contacts) {
  wanted_ += dt_ * wanted_velocities_;
  shift_ += dt_ * velocity_;
  force_.setZero();
  resistance_.fill(0.0);
  for (const Contact& contact : contacts) {
    if (contact.side != ContactSide::kHuman || contact.f_W.isZero(0.0)) continue;
    feel(contact);
    touched_ = true;
  }
}

// Implicit in springs and dampers, so that nothing but the skin adds energy; then the nearest place, by the same
// weights, in which the bones have their lengths.
bool YieldingPartner::plan() {
  if (!touched_) return false;
  Weights mass = Weights::Zero(), spring = Weights::Zero(), damper = Weights::Zero();
  for (int i = 0; i < kParts; ++i) {
    const PartLaw& law = laws()[static_cast<std::size_t>(i)];
    mass(i, i) = std::max(law.mass, resistance_[static_cast<std::size_t>(i)] / kResolved);
    spring(i, i) += law.stiffness;
    damper(i, i) += law.damping;
    if (i == kTrunk) continue;
    spring(kTrunk, kTrunk) += law.stiffness;
    damper(kTrunk, kTrunk) += law.damping;
    spring(i, kTrunk) = spring(kTrunk, i) = -law.stiffness;
    damper(i, kTrunk) = damper(kTrunk, i) = -law.damping;
  }
  const Weights whole = mass + dt_ * damper + dt_ * dt_ * spring;
  const Weights level = whole.inverse();
  Weights upright = Weights::Zero();  // the floor holds the trunk
  upright.bottomRightCorner<kParts - 1, kParts - 1>() =
      whole.bottomRightCorner<kParts - 1, kParts - 1>().inverse().eval();
  const Parts impulse = velocity_ * mass + dt_ * (force_ - shift_ * spring);
  Parts next = shift_;
  next.topRows<2>() += dt_ * (impulse.topRows<2>() * level);
  next.row(2) += dt_ * (impulse.row(2) * upright);
  keep_bones(level, upright, next);
  const Eigen::Vector2d trunk = next.col(kTrunk).head<2>();
  if (const double far = trunk.norm(); far > kYieldingMostShift)
    next.topRows<2>().colwise() += (kYieldingMostShift / far - 1.0) * trunk;
  velocity_ = (next - shift_) / dt_;
  return true;
}

void YieldingPartner::keep_bones(const Weights& level, const Weights& upright, Parts& shift) const {
  using Gaps = Eigen::Matrix<double, kBoneCount, 1>;
  const HumanJoints wanted = wanted_ + dt_ * wanted_velocities_;
  for (int turn = 0; turn < kMostTurns; ++turn) {
    Eigen::Matrix<double, 3, kBoneCount> bones;
    Eigen::Matrix<double, kParts, kBoneCount> ends = Eigen::Matrix<double, kParts, kBoneCount>::Zero();
    Gaps gaps = Gaps::Zero();
    for (int i = 0; i < kBoneCount; ++i) {
      const int from = part_of(kBones[i].from), to = part_of(kBones[i].to);
      const Eigen::Vector3d straight = wanted.col(kBones[i].to) - wanted.col(kBones[i].from);
      bones.col(i) = straight + shift.col(to) - shift.col(from);
      if (straight.norm() < kNoBone) continue;
      ends(to, i) = 1.0;
      ends(from, i) = -1.0;
      gaps[i] = 0.5 * (bones.col(i).squaredNorm() - straight.squaredNorm());
    }
    if (gaps.cwiseAbs().maxCoeff() < kBoneTolerance) return;
    Eigen::Matrix<double, kBoneCount, kBoneCount> system = Eigen::Matrix<double, kBoneCount, kBoneCount>::Identity();
    const auto level_ends = (ends.transpose() * level * ends).eval(),
               upright_ends = (ends.transpose() * upright * ends).eval();
    for (int i = 0; i < kBoneCount; ++i)
      for (int j = 0; j < kBoneCount; ++j)
        if (!ends.col(i).isZero(0.0) && !ends.col(j).isZero(0.0))
          system(i, j) = level_ends(i, j) * bones.col(i).head<2>().dot(bones.col(j).head<2>()) +
                         upright_ends(i, j) * bones(2, i) * bones(2, j);
    const Gaps pulls = system.fullPivLu().solve(gaps);
    const Parts moves = bones * pulls.asDiagonal() * ends.transpose();
    shift.topRows<2>() -= moves.topRows<2>() * level;
    shift.row(2) -= moves.row(2) * upright;
  }
}

double YieldingPartner::energy() const {
  double sum = 0.0;
  for (int i = 0; i < kParts; ++i) {
    const PartLaw& law = laws()[static_cast<std::size_t>(i)];
    const Eigen::Vector3d from = i == kTrunk ? Eigen::Vector3d::Zero() : Eigen::Vector3d(shift_.col(kTrunk));
    sum += 0.5 * law.mass * velocity_.col(i).squaredNorm() + 0.5 * law.stiffness * (shift_.col(i) - from).squaredNorm();
  }
  return sum;
}

Eigen::Vector3d YieldingPartner::momentum() const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < kParts; ++i) sum += laws()[static_cast<std::size_t>(i)].mass * velocity_.col(i);
  return sum;
}

}  // namespace duet
