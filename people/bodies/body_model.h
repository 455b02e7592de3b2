// The joints of a body model of the SMPL family (SMPL, SMPL-H, SMPL-X) at rest, as functions of shape. Such models are
// licensed: the user's own file is read, what is derived from it is kept beside it, and nothing of it is in duet.
// Without a file an average person of duet's own proportions stands in.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "duet/core/recording.h"

namespace duet {

// Forward kinematics of the SMPL family's joints. A file's joint rotations are turns against the parent's, from the
// rest pose (T pose; x to the left, y up, z forward); the root turns about the pelvis at rest, not about the origin:
// p_pelvis = rest + translation, p_child = p_parent + R_parent (rest_child - rest_parent). Pure functions.

using RestJoints = Eigen::Matrix<double, 3, kSmplJoints>;  // [m], of the model's own axes

// The rotation of an axis-angle vector [rad], unit to 1e-15 for any angle.
Eigen::Quaterniond rotation_of_vector(const Eigen::Vector3d& axis_angle);

// `rotations`: 24 of one frame, each against its parent's; they become global, R_FJ. `joints` (3, 24) are filled [m].
void pose_body(const RestJoints& rest, const Eigen::Vector3d& translation, std::span<Eigen::Quaterniond> rotations,
               PointTracks::Frame joints);

struct BodyModel {
  std::string kind;                   // "SMPL", "SMPL-H", "SMPL-X"; empty: the average person
  RestJoints joints;                  // of the mean shape [m]. Hands: SMPL's, else the knuckle of the middle finger
  std::vector<RestJoints> dirs = {};  // by which one unit of each shape parameter moves them [m]; 10 at most
  std::string note = {};              // one sentence for the user: which file, derived or kept
};

// J_regressor v_template and J_regressor shapedirs of an NPZ or a pickle (dense, or SciPy's CSC and CSR), or the
// J_template and J_shapedirs that retargeting reads (retarget/reshape.h). The first time `path`.duet-joints.npz is
// written with the two; where that folder takes no file the note says so. Throws InputError naming file, key, expected
// and found.
BodyModel load_body_model(const std::string& path);

// A person of 1.70 m with the proportions of duet's synthesis (tasks/synthesis/posed_body.h). Its pelvis rests at the
// origin, since where a model's pelvis lies is known from its file alone: people of one file are all moved by the same
// 0.2 to 0.4 m along the file's axes.
BodyModel average_body();

// Parameters beyond those the model has are left out, as are those that the file lacks.
RestJoints rest_joints(const BodyModel& model, std::span<const double> betas);

}  // namespace duet
