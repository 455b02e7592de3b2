// The joints of a body model of the SMPL family (SMPL, SMPL-H, SMPL-X) at rest, as functions of shape. Such models are
// licensed: the user's own file is read, what is derived from it is kept beside it, and nothing of it is in duet.
// Without a file an average person of duet's own proportions stands in.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "duet/people/bodies/body_kinematics.h"

namespace duet {

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

// A person of 1.70 m with the proportions of duet's synthesis (tasks/synthesis/body.h). Its pelvis rests at the origin,
// since where a model's pelvis lies is known from its file alone: people of one file are all moved by the same
// 0.2 to 0.4 m along the file's axes.
BodyModel average_body();

// Parameters beyond those the model has are left out, as are those that the file lacks.
RestJoints rest_joints(const BodyModel& model, std::span<const double> betas);

}  // namespace duet
