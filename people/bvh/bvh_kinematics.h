// Poses of a BVH skeleton, in the file's axes and units. Thread-safe.
#pragma once

#include <vector>

#include "duet/core/pose.h"
#include "duet/people/bvh/bvh.h"

namespace duet {

// Pose of each joint in its parent at a frame. Rotation channels multiply in
// file order; a position channel replaces that component of the OFFSET (as
// Blender and MotionBuilder read it), unless the joint keeps it.
std::vector<Pose> local_poses(const Bvh& bvh, int frame);

// The same at a time between two frames: slerp of rotations, linear positions. `index` counts frames and may be
// fractional; exact where it is whole.
std::vector<Pose> local_poses_at(const Bvh& bvh, double index);

// The posture of the hierarchy itself: offsets only.
std::vector<Pose> zero_local_poses(const Bvh& bvh);

// Poses in the world from poses in the parents.
std::vector<Pose> global_poses(const Bvh& bvh, const std::vector<Pose>& local);

}  // namespace duet
