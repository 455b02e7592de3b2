// The partner as engines see it: joints that move on at constant velocity between two calls of set_partner, and the
// pose and the velocity of each capsule. No allocation.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/robots/human_body.h"

namespace duet {

struct MovingPartner {
  bool present = false;  // false until set: engines keep its capsules where they touch nothing
  HumanJoints joints = HumanJoints::Zero();
  HumanJoints velocities = HumanJoints::Zero();

  void set(const HumanJoints& new_joints, const HumanJoints& new_velocities);
  void advance(double dt) { joints += dt * velocities; }

  // For snapshots: kValues numbers, appended or read back.
  static constexpr int kValues = 1 + 2 * 3 * 24;
  void append_to(std::vector<double>& values) const;
  void read_from(std::span<const double> values);
};

// The axis of a capsule along z of its frame, as RobotShape has it.
struct CapsulePose {
  Pose X_WC;
  double half_length = 0.0;  // [m], without caps
};
CapsulePose capsule_pose(const HumanCapsule& capsule, const HumanJoints& joints);

// Velocity of the point of the capsule nearest to p_W: linear between the velocities of its ends (a spin about its own
// axis is not known from joints). [m/s], frame W.
Eigen::Vector3d capsule_velocity(const HumanCapsule& capsule, const MovingPartner& partner, const Eigen::Vector3d& p_W);

}  // namespace duet
