// The output of GVHMR for a video: hmr4d_results.pt, one person, SMPL-X parameters in a world of its own, y up, 30 Hz.
#pragma once

#include "duet/people/people_format.h"

namespace duet {

const PeopleFormat& gvhmr_format();

}  // namespace duet
