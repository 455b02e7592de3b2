// Forward kinematics of the SMPL family's joints. A file's joint rotations are turns against the parent's, from the
// rest pose (T pose; x to the left, y up, z forward); the root turns about the pelvis at rest, not about the origin:
// p_pelvis = rest + translation, p_child = p_parent + R_parent (rest_child - rest_parent). Pure functions.
#pragma once

#include <Eigen/Geometry>
#include <span>

#include "duet/core/point_tracks.h"
#include "duet/core/skeleton.h"

namespace duet {

using RestJoints = Eigen::Matrix<double, 3, kSmplJoints>;  // [m], of the model's own axes

// The rotation of an axis-angle vector [rad], unit to 1e-15 for any angle.
Eigen::Quaterniond rotation_of_vector(const Eigen::Vector3d& axis_angle);

// `rotations`: 24 of one frame, each against its parent's; they become global, R_FJ. `joints` (3, 24) are filled [m].
void pose_body(const RestJoints& rest, const Eigen::Vector3d& translation, std::span<Eigen::Quaterniond> rotations,
               PointTracks::Frame joints);

}  // namespace duet
