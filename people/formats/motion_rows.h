// One person a file as one row of numbers a frame, NPY: Motion-X (T, 322) and the human motions of PHUMA (T, 69).
#pragma once

#include "duet/people/people_format.h"

namespace duet {

const PeopleFormat& motion_x_format();
const PeopleFormat& phuma_human_format();

}  // namespace duet
