// Inter-X as SMPL-X parameters: motions/<clip>/P1.npz and P2.npz, one world, y up, 120 Hz. The clip's name says the
// action (A018), annots/interaction_order.pkl who begins.
#pragma once

#include "duet/motion/people/people_format.h"

namespace duet {

const PeopleFormat& inter_x_format();

}  // namespace duet
