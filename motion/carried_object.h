// A rigid object that people handle: where it is over time, and the points of it that distances are measured to
// (supplement D, Fig. S3: human-object data such as CORE4D). Nothing moves or bends it here.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/core/recording.h"
#include "duet/core/robot_state.h"

namespace duet {

inline constexpr int kMostObjectKeypoints = 16;

struct CarriedObject {
  std::vector<Pose> poses = {};                         // X_WO, one a frame; empty: no object
  Eigen::Matrix3Xd keypoints = Eigen::Matrix3Xd(3, 0);  // p_OK [m], 1 to 16 where there is an object

  [[nodiscard]] bool empty() const { return poses.empty(); }
};

// Throws std::invalid_argument, `what` ("clip 'x', object") first: another number of poses than `frames`, no keypoint
// or more than 16, a rotation that is not unit, a number that is not finite. No object is fine.
void validate(const CarriedObject& object, int frames, const std::string& what);

// The keypoints in W: (T, O, 3) [m]; empty without an object.
PointTracks keypoint_tracks(const CarriedObject& object);

// The same functions as for people: another rate, standing still before and after, the mirror image in y = 0.
CarriedObject resample(const CarriedObject& object, double rate_hz, double new_rate_hz);
CarriedObject held(const CarriedObject& object, int before, int after);
CarriedObject mirrored(const CarriedObject& object);

// "object_position" (T, 3), "object_quat_wxyz" (T, 4), "object_keypoints" (O, 3); none of them without an object.
void put_object(Npz& npz, const CarriedObject& object);
CarriedObject get_object(const Npz& npz);

// Which points of a carried object stand for it, from a file of the user: the object's mesh, a box, or points.

// Points of the object in its own frame [m], at most kMostObjectKeypoints: of a mesh (Wavefront .obj, its vertices), or
// of JSON: {"points": [[x, y, z], ...]}, or {"box": [x, y, z]} with its full lengths and, where it is not about the
// object's origin, "centre": its eight corners and its centre. More points than that are thinned to the ones that lie
// farthest from each other, the one farthest from their mean first. Throws InputError naming file, place, expected and
// found.
Eigen::Matrix3Xd read_object_keypoints(const std::string& path);

// The `count` points that lie farthest from each other, in the order in which they are found; all where there are no
// more. Ties go to the first.
Eigen::Matrix3Xd farthest_points(const Eigen::Matrix3Xd& points, int count);

}  // namespace duet
