// Which points of a carried object stand for it, from a file of the user: the object's mesh, a box, or points.
#pragma once

#include <Eigen/Core>
#include <string>

namespace duet {

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
