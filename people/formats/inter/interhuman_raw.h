// InterHuman as its authors' raw SMPL-H parameters: motions/<n>.pkl, a dict of person1 and person2, one world, z up.
#pragma once

#include "duet/people/people_format.h"

namespace duet {

const PeopleFormat& interhuman_raw_format();

}  // namespace duet
