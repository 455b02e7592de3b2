// Two people who were recorded apart, put into one world. Person A stays; person B is turned about the vertical and
// moved as a rigid body, the same in every frame. The result is an estimate, and its source says so.
//
// floor: both stand on one floor (the 5th percentile of each one's lower toe). Level, they stay where the files have
// them if their pelvises come within 0.2 to 2.5 m of one another; else B faces A at 0.8 m in the middle frame.
// contact: the same floor; then of all frames and pairs of hands the one is taken where both reach furthest forward at
// the same height. There B faces A, and is moved so that these two hands meet (mean of 0.1 s before and after). Meant
// for handshakes and high fives; hands more than 0.3 m apart in height are refused.
#pragma once

#include "duet/motion/people/raw_people.h"

namespace duet {

// `raw` has SMPL-24 joints. Adds evidence, and source["provenance"] = "estimated shared frame". The vertical is
// options.up, else raw.up, else the axis along which heads lie above ankles. Throws InputError naming the file.
void align_people(RawPeople& raw, const PeopleOptions& options);

}  // namespace duet
