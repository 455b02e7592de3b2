// Two people in one BVH file: two ROOTs, or two branches of one hierarchy
// ("character_A_left_hip"). Thread-safe.
#pragma once

#include <array>
#include <string>

#include "duet/people/bvh/bvh.h"

namespace duet {

// Person A and person B in the order of the file, each a Bvh of its own with
// the joints above it. `names` as find_smpl_joints() takes it. Throws
// InputError naming the file where it does not hold two people.
std::array<Bvh, 2> two_people_in(const Bvh& bvh, const std::string& names = "");

}  // namespace duet
