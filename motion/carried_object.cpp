#include "duet/motion/carried_object.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/motion/human_motion.h"
#include "duet/motion/npz_fields.h"

namespace duet {
namespace {

constexpr double kUnitRotation = 1e-6;  // |R| - 1, as for the robot's root

}  // namespace

void validate(const CarriedObject& object, int frames, const std::string& what) {
  if (object.empty()) return;
  require(static_cast<int>(object.poses.size()) == frames, "{}: expected {} poses, one a frame, found {}", what, frames,
          object.poses.size());
  require(object.keypoints.cols() >= 1 && object.keypoints.cols() <= kMostObjectKeypoints,
          "{}: expected 1 to {} keypoints, found {}", what, kMostObjectKeypoints, object.keypoints.cols());
  require(object.keypoints.allFinite(), "{}: a keypoint is not finite", what);
  for (std::size_t t = 0; t < object.poses.size(); ++t) {
    const Pose& X_WO = object.poses[t];
    require(X_WO.p.allFinite(), "{}: frame {}: the position is not finite", what, t);
    require(std::abs(X_WO.R.norm() - 1.0) <= kUnitRotation,
            "{}: frame {}: expected a unit quaternion, found one of norm {}", what, t, X_WO.R.norm());
  }
}

PointTracks keypoint_tracks(const CarriedObject& object) {
  if (object.empty()) return {};
  PointTracks tracks(static_cast<int>(object.poses.size()), static_cast<int>(object.keypoints.cols()));
  for (int t = 0; t < tracks.frames(); ++t) {
    const Pose& X_WO = object.poses[static_cast<std::size_t>(t)];
    tracks.frame(t) = (X_WO.R.toRotationMatrix() * object.keypoints).colwise() + X_WO.p;
  }
  return tracks;
}

CarriedObject resample(const CarriedObject& object, double rate_hz, double new_rate_hz) {
  if (object.empty() || rate_hz == new_rate_hz) return object;
  const int frames = static_cast<int>(object.poses.size());
  const int new_frames = resampled_frames(frames, rate_hz, new_rate_hz);
  CarriedObject result{.poses = {}, .keypoints = object.keypoints};
  result.poses.reserve(static_cast<std::size_t>(new_frames));
  for (int t = 0; t < new_frames; ++t) {
    const FrameBetween at = frame_between(t * (rate_hz / new_rate_hz), frames);
    const Pose& before = object.poses[static_cast<std::size_t>(at.frame)];
    result.poses.push_back(
        at.part > 0.0 ? interpolate(before, object.poses[static_cast<std::size_t>(at.frame) + 1], at.part) : before);
  }
  return result;
}

CarriedObject held(const CarriedObject& object, int before, int after) {
  if (object.empty()) return object;
  CarriedObject result = object;
  result.poses.insert(result.poses.begin(), static_cast<std::size_t>(before), object.poses.front());
  result.poses.insert(result.poses.end(), static_cast<std::size_t>(after), object.poses.back());
  return result;
}

CarriedObject mirrored(const CarriedObject& object) {
  if (object.empty()) return object;
  CarriedObject result = object;
  result.keypoints.row(1) *= -1.0;
  for (Pose& X_WO : result.poses) {
    X_WO.p.y() *= -1.0;
    X_WO.R = Eigen::Quaterniond(X_WO.R.w(), -X_WO.R.x(), X_WO.R.y(), -X_WO.R.z());  // S R S, S = diag(1, -1, 1)
  }
  return result;
}

void put_object(Npz& npz, const CarriedObject& object) {
  if (object.empty()) return;
  const std::size_t frames = object.poses.size();
  std::vector<double> positions;
  std::vector<Eigen::Quaterniond> rotations;
  positions.reserve(3 * frames);
  rotations.reserve(frames);
  for (const Pose& X_WO : object.poses) {
    positions.insert(positions.end(), {X_WO.p.x(), X_WO.p.y(), X_WO.p.z()});
    rotations.push_back(X_WO.R);
  }
  npz.set("object_position", std::move(positions), {frames, 3});
  put_quaternions(npz, "object_quat_wxyz", rotations, {frames, 4});
  // Column-major (3, O) has the bytes of row-major (O, 3).
  npz.set("object_keypoints",
          std::vector<double>(object.keypoints.data(), object.keypoints.data() + object.keypoints.size()),
          {static_cast<std::size_t>(object.keypoints.cols()), 3});
}

CarriedObject get_object(const Npz& npz) {
  CarriedObject object;
  if (!npz.contains("object_position") && !npz.contains("object_quat_wxyz") && !npz.contains("object_keypoints"))
    return object;
  const std::vector<double> positions = npz.numbers("object_position", {-1, 3});
  const std::size_t frames = positions.size() / 3;
  const std::vector<Eigen::Quaterniond> rotations =
      get_quaternions(npz, "object_quat_wxyz", {static_cast<long>(frames), 4});
  object.poses.reserve(frames);
  for (std::size_t t = 0; t < frames; ++t)
    object.poses.push_back({.R = rotations[t], .p = Eigen::Map<const Eigen::Vector3d>(&positions[3 * t])});
  const std::vector<double> keypoints = npz.numbers("object_keypoints", {-1, 3});
  object.keypoints = Eigen::Map<const Eigen::Matrix3Xd>(keypoints.data(), 3, static_cast<long>(keypoints.size() / 3));
  if (object.empty())
    throw InputError(fmt::format("'{}': key 'object_position': expected poses, found none", npz.name()));
  return object;
}

}  // namespace duet
