// Inter-X as its own preparation stores it: train.h5, val.h5 and test.h5, one array a clip, (T, 56, 6) at 30 Hz, y up.
#pragma once

#include "duet/people/people_format.h"

namespace duet {

const PeopleFormat& inter_x_h5_format();

}  // namespace duet
