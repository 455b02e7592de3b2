// Facts that a pair of BVH files does not state: up axis, rate, an added T pose, the unit of length. Each finding is a
// value and a sentence for the user; a fact that cannot be told is refused with the option that settles it.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "duet/people/bvh/bvh_skeleton.h"

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
// The frame times' rate, taken as a whole number of Hz where it is within 0.05
// % of one. Throws InputError where the two people have different ones.
BvhFinding<double> find_rate(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options);
// The first frame of each: 1 where frame 0 is an added T pose (straight, horizontal arms, and frame
// 1 is far off). For two people of one length frame 0 goes from both, as their frames belong
// together.
BvhFinding<std::array<int, 2>> find_first_frames(const BvhPerson& a, const BvhPerson& b, UpAxis up,
                                                 const BvhOptions& options);
// The unit in which the two people's mean bone length from head to ankle is
// that of a person. Throws InputError where none is.
BvhFinding<double> find_metres_per_unit(const BvhPerson& a, const BvhPerson& b, const BvhOptions& options);

}  // namespace duet
