#include "duet/metrics/motion_windows.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "duet/core/numbers.h"

namespace duet {
namespace {

constexpr std::array<SmplJoint, 14> kSeen = {kHead,          kNeck,       kLeftShoulder, kLeftElbow, kLeftHand,
                                             kRightShoulder, kRightElbow, kRightHand,    kLeftHip,   kLeftKnee,
                                             kLeftAnkle,     kRightHip,   kRightKnee,    kRightAnkle};
constexpr std::array<SmplJoint, 5> kMoving = {kHead, kLeftElbow, kLeftHand, kRightElbow, kRightHand};

// A person's joints at kWindowRate.
std::vector<Eigen::Matrix3Xd> seen(const HumanMotion& person) {
  std::vector<Eigen::Matrix3Xd> frames;
  for (double t = 0.0; t <= person.frames() - 1; t += person.rate_hz / kWindowRate) {
    const FrameBetween at = frame_between(t, person.frames());
    const int next = std::min(at.frame + 1, person.frames() - 1);
    frames.emplace_back((1.0 - at.part) * person.joints.frame(at.frame) + at.part * person.joints.frame(next));
  }
  return frames;
}

bool is_picture(const HumanMotion& person) {
  for (int t = 1; t < person.frames(); ++t)
    if ((person.joints.frame(t) - person.joints.frame(0)).cwiseAbs().maxCoeff() > 1e-6) return false;
  return true;
}

std::vector<double> window_at(const std::vector<Eigen::Matrix3Xd>& one, const std::vector<Eigen::Matrix3Xd>& other,
                              int begin, int frames) {
  const int middle = begin + frames / 2, last = begin + frames - 1;
  const Eigen::Matrix3Xd& now = one[middle];
  const Eigen::Vector3d left = now.col(kLeftShoulder) - now.col(kRightShoulder);
  const double yaw = std::atan2(-left.x(), left.y());
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d pelvis = now.col(kPelvis);
  std::vector<double> features;
  const auto add = [&](const Eigen::Vector3d& v) { features.insert(features.end(), {v.x(), v.y(), v.z()}); };
  for (const SmplJoint joint : kSeen) add(turn * (now.col(joint) - pelvis));
  for (const SmplJoint joint : kMoving) add(turn * (one[last].col(joint) - one[begin].col(joint)));
  for (const SmplJoint joint : kMoving) {
    double residual = 0.0;
    for (int t = begin + 1; t < last; ++t)
      residual += (one[t].col(joint) - 0.5 * (one[t - 1].col(joint) + one[t + 1].col(joint))).norm();
    features.push_back(residual / (frames - 2));
  }
  const Eigen::Vector3d away = turn * (other[middle].col(kPelvis) - pelvis);
  features.insert(features.end(), {away.head<2>().norm(), std::atan2(away.y(), away.x())});
  return features;
}

}  // namespace

const std::vector<std::string>& window_feature_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const SmplJoint joint : kSeen)
      for (const char axis : {'x', 'y', 'z'}) list.push_back(fmt::format("{} {}", kSmplNames[joint], axis));
    for (const SmplJoint joint : kMoving)
      for (const char axis : {'x', 'y', 'z'}) list.push_back(fmt::format("way of {} {}", kSmplNames[joint], axis));
    for (const SmplJoint joint : kMoving) list.push_back(fmt::format("unsteadiness of {}", kSmplNames[joint]));
    list.emplace_back("distance of the other");
    list.emplace_back("direction of the other");
    return list;
  }();
  return names;
}

std::vector<std::vector<double>> motion_windows(const InteractionClip& clip) {
  const int frames = static_cast<int>(std::lround(kWindowSeconds * kWindowRate));
  const int step = std::max(1, static_cast<int>(std::lround(kWindowStep * kWindowRate)));
  const std::array<std::vector<Eigen::Matrix3Xd>, 2> people = {seen(clip.a), seen(clip.b)};
  std::vector<std::vector<double>> windows;
  for (const int k : {0, 1}) {
    if (is_picture(k == 0 ? clip.a : clip.b)) continue;
    for (int begin = 0; begin + frames <= static_cast<int>(people[k].size()); begin += step)
      windows.push_back(window_at(people[k], people[1 - k], begin, frames));
  }
  return windows;
}

}  // namespace duet
