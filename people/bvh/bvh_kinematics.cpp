#include "duet/people/bvh/bvh_kinematics.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace duet {
namespace {

constexpr double kSameFrame = 1e-9;  // of a frame

std::size_t channel_count(const Bvh& bvh) {
  std::size_t count = 0;
  for (const BvhJoint& joint : bvh.joints) count += joint.channels.size();
  return count;
}

Pose local_pose(const BvhJoint& joint, const double* values) {
  Pose X{.R = Eigen::Quaterniond::Identity(), .p = joint.offset};
  for (const int channel : joint.channels) {
    const double value = *values++;
    if (channel < 3) {
      if (!joint.keeps_offset) X.p[channel] = value;
    } else {
      const double angle = value * (std::numbers::pi / 180.0);
      X.R = X.R * Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(channel - 3)));
    }
  }
  X.R.normalize();
  return X;
}

}  // namespace

std::vector<Pose> local_poses(const Bvh& bvh, int frame) {
  std::vector<Pose> poses;
  poses.reserve(bvh.joints.size());
  const double* values = bvh.values.data() + static_cast<std::size_t>(frame) * channel_count(bvh);
  for (const BvhJoint& joint : bvh.joints) {
    poses.push_back(local_pose(joint, values));
    values += joint.channels.size();
  }
  return poses;
}

std::vector<Pose> local_poses_at(const Bvh& bvh, double index) {
  const double nearest = std::round(index);
  if (std::abs(index - nearest) <= kSameFrame * std::max(1.0, nearest))
    return local_poses(bvh, static_cast<int>(nearest));
  const int frame = static_cast<int>(index);
  std::vector<Pose> poses = local_poses(bvh, frame);
  const std::vector<Pose> next = local_poses(bvh, frame + 1);
  for (std::size_t j = 0; j < poses.size(); ++j) {
    poses[j] = interpolate(poses[j], next[j], index - frame);
    poses[j].R.normalize();
  }
  return poses;
}

std::vector<Pose> zero_local_poses(const Bvh& bvh) {
  std::vector<Pose> poses;
  poses.reserve(bvh.joints.size());
  for (const BvhJoint& joint : bvh.joints) poses.push_back({.R = Eigen::Quaterniond::Identity(), .p = joint.offset});
  return poses;
}

std::vector<Pose> global_poses(const Bvh& bvh, const std::vector<Pose>& local) {
  std::vector<Pose> poses;
  poses.reserve(local.size());
  for (std::size_t j = 0; j < local.size(); ++j) {
    const int parent = bvh.joints[j].parent;  // parents come first
    poses.push_back(parent < 0 ? local[j] : poses[parent] * local[j]);
    poses.back().R.normalize();
  }
  return poses;
}

}  // namespace duet
