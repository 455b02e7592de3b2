#include "duet/backends/partner.h"

#include <algorithm>

namespace duet {
namespace {

constexpr double kShortest = 1e-9;  // [m]

}  // namespace

void MovingPartner::set(const HumanJoints& new_joints, const HumanJoints& new_velocities) {
  present = true;
  joints = new_joints;
  velocities = new_velocities;
}

void MovingPartner::append_to(std::vector<double>& values) const {
  values.push_back(present ? 1.0 : 0.0);
  values.insert(values.end(), joints.data(), joints.data() + joints.size());
  values.insert(values.end(), velocities.data(), velocities.data() + velocities.size());
}

void MovingPartner::read_from(std::span<const double> values) {
  present = values[0] != 0.0;
  std::copy_n(values.data() + 1, joints.size(), joints.data());
  std::copy_n(values.data() + 1 + joints.size(), velocities.size(), velocities.data());
}

CapsulePose capsule_pose(const HumanCapsule& capsule, const HumanJoints& joints) {
  const std::array<Eigen::Vector3d, 2> ends = capsule.ends(joints);
  const Eigen::Vector3d axis = ends[1] - ends[0];
  const double length = axis.norm();
  const Eigen::Vector3d p_WC = 0.5 * (ends[0] + ends[1]);
  if (length < kShortest) return {{Eigen::Quaterniond::Identity(), p_WC}, 0.0};  // two joints in one place: a sphere
  return {{Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), axis), p_WC}, 0.5 * length};
}

Eigen::Vector3d capsule_velocity(const HumanCapsule& capsule, const MovingPartner& partner,
                                 const Eigen::Vector3d& p_W) {
  const std::array<Eigen::Vector3d, 2> ends = capsule.ends(partner.joints);
  const std::array<Eigen::Vector3d, 2> end_velocities = capsule.ends(partner.velocities);
  const Eigen::Vector3d axis = ends[1] - ends[0];
  const double length_squared = axis.squaredNorm();
  const double along = length_squared > 0.0 ? axis.dot(p_W - ends[0]) / length_squared : 0.0;
  return end_velocities[0] + std::clamp(along, 0.0, 1.0) * (end_velocities[1] - end_velocities[0]);
}

}  // namespace duet
