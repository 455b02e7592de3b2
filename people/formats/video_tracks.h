// People whom a tracker followed through one video, in one joblib file: WHAM (wham_output.pkl, a world of his own for
// each, y up) and 4D-Humans with PHALP (one camera's frame, y down, depth unreliable). Tracks begin and end with what
// the camera sees: of all pairs the one with the longest unbroken stretch in common is taken, and that stretch.
#pragma once

#include "duet/people/people_format.h"

namespace duet {

const PeopleFormat& wham_format();
const PeopleFormat& four_d_humans_format();

}  // namespace duet
