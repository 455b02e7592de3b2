// One function a format: its row of the table (people_formats.cpp). The file of the same name says what its files hold,
// and by whose word.
#pragma once

#include "duet/people/people_format.h"

namespace duet {

PeopleFormat inter_x_skeleton_format();
PeopleFormat interhuman_processed_format();
PeopleFormat core4d_format();
PeopleFormat harmony4d_format();
PeopleFormat hi4d_format();
PeopleFormat chi3d_format();
PeopleFormat bvh_format();
PeopleFormat ntu_format();
PeopleFormat clip_format();
PeopleFormat positions_format();

}  // namespace duet
