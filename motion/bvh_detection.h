// What a pair of BVH files does not say of itself: up axis, rate, an added T pose, the unit of length. Each finding is
// a value and a sentence for the user; what cannot be told is refused with the option that settles it.
#pragma once

#include <string>
#include <vector>

#include "duet/motion/bvh_skeleton.h"

namespace duet {

struct BvhPerson {
  Bvh bvh;
  BvhSkeleton skeleton;
};

template <typename T>
struct BvhFinding {
  T value;
  std::string sentence;
};

// From the mean direction head above ankles. Throws InputError where it lies along neither y nor z.
BvhFinding<UpAxis> find_up_axis(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options);
// The frame time's rate, taken as a whole number of Hz where it is within 0.05 % of one.
BvhFinding<double> find_rate(const BvhPerson& a, const BvhOptions& options);
// Frame 0 has straight, horizontal arms and frame 1 is far off. Throws InputError where only one person has it.
BvhFinding<bool> find_t_pose(const BvhPerson& a, const BvhPerson& b, UpAxis up, const BvhOptions& options);
// The unit in which the two people's mean bone length from head to ankle is that of a person. Throws InputError where
// none is.
BvhFinding<double> find_metres_per_unit(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options);

}  // namespace duet
