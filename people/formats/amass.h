// AMASS and what is stored like it: one person a file, z up; "_poses.npz" (SMPL-H: poses, trans, betas,
// mocap_framerate) and "_stageii.npz" (SMPL-X: root_orient, pose_body, trans, mocap_frame_rate). Both spellings of the
// rate are read.
#pragma once

#include "duet/people/people_format.h"

namespace duet {

const PeopleFormat& amass_format();

}  // namespace duet
