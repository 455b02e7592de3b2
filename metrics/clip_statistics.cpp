#include "duet/metrics/clip_statistics.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "duet/core/order_statistics.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using JointFrame = PointTracks::ConstFrame;

// A segment from one joint to another: its share of the body's mass, and where its centre lies on the way.
struct Segment {
  SmplJoint from, to;
  double mass, centre;
};
// Trunk and head from the pelvis to the neck and on to the head; a hand and a foot from wrist and ankle to their ends.
constexpr std::array<Segment, 14> kSegments = {{{kPelvis, kNeck, 0.4302, 0.5682},
                                                {kNeck, kHead, 0.0681, 1.0},
                                                {kLeftShoulder, kLeftElbow, 0.0263, 0.5763},
                                                {kRightShoulder, kRightElbow, 0.0263, 0.5763},
                                                {kLeftElbow, kLeftWrist, 0.0150, 0.4567},
                                                {kRightElbow, kRightWrist, 0.0150, 0.4567},
                                                {kLeftWrist, kLeftHand, 0.0059, 0.77},
                                                {kRightWrist, kRightHand, 0.0059, 0.77},
                                                {kLeftHip, kLeftKnee, 0.1447, 0.3854},
                                                {kRightHip, kRightKnee, 0.1447, 0.3854},
                                                {kLeftKnee, kLeftAnkle, 0.0457, 0.4438},
                                                {kRightKnee, kRightAnkle, 0.0457, 0.4438},
                                                {kLeftAnkle, kLeftToe, 0.0133, 0.4215},
                                                {kRightAnkle, kRightToe, 0.0133, 0.4215}}};

double nearest_distance(const JointFrame& a, const JointFrame& b) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int j = 0; j < kSmplJoints; ++j)
    nearest = std::min(nearest, (b.colwise() - a.col(j)).colwise().squaredNorm().minCoeff());
  return std::sqrt(nearest);
}

double overlap_iou(const JointFrame& a, const JointFrame& b) {
  const Eigen::Vector3d low_a = a.rowwise().minCoeff(), high_a = a.rowwise().maxCoeff();
  const Eigen::Vector3d low_b = b.rowwise().minCoeff(), high_b = b.rowwise().maxCoeff();
  const double shared = (high_a.cwiseMin(high_b) - low_a.cwiseMax(low_b)).cwiseMax(0.0).prod();
  const double both = (high_a - low_a).prod() + (high_b - low_b).prod() - shared;
  return both > 0.0 ? shared / both : 0.0;
}

bool outside_support(const JointFrame& p) {
  Eigen::Vector2d low = p.col(kLeftAnkle).head<2>(), high = low;
  for (const int j : {kLeftToe, kRightAnkle, kRightToe}) {
    low = low.cwiseMin(p.col(j).head<2>());
    high = high.cwiseMax(p.col(j).head<2>());
  }
  const Eigen::Vector2d com = centre_of_mass(p).head<2>();
  return (com.array() < low.array()).any() || (com.array() > high.array()).any();
}

// Sizes of the joints' first and second differences, of both people. [m/s], [m/s^2]
struct Dynamics {
  std::vector<double> speed, acceleration;
};

void add_dynamics(const HumanMotion& motion, Dynamics& dynamics) {
  const double rate = motion.rate_hz;
  for (int t = 1; t < motion.frames(); ++t) {
    const Eigen::Matrix3Xd step = motion.joints.frame(t) - motion.joints.frame(t - 1);
    for (int j = 0; j < kSmplJoints; ++j) dynamics.speed.push_back(rate * step.col(j).norm());
    if (t + 1 == motion.frames()) continue;
    const Eigen::Matrix3Xd bend = motion.joints.frame(t + 1) - motion.joints.frame(t) - step;
    for (int j = 0; j < kSmplJoints; ++j) dynamics.acceleration.push_back(rate * rate * bend.col(j).norm());
  }
}

}  // namespace

Eigen::Vector3d centre_of_mass(const PointTracks::ConstFrame& joints) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double mass = 0.0;
  for (const Segment& segment : kSegments) {
    sum += segment.mass *
           (joints.col(segment.from) + segment.centre * (joints.col(segment.to) - joints.col(segment.from)));
    mass += segment.mass;
  }
  return sum / mass;
}

ClipStatistics clip_statistics(const InteractionClip& clip) {
  const int frames = clip.frames();
  require(frames >= 3, "statistics of clip '{}': expected at least 3 frames, found {}", clip.id, frames);
  ClipStatistics result{.seconds = frames / clip.rate_hz()};
  int events = 0, contacts = 0, outside = 0;
  bool touched = false;
  for (int t = 0; t < frames; ++t) {
    const JointFrame a = clip.a.joints.frame(t), b = clip.b.joints.frame(t);
    const double nearest = nearest_distance(a, b);
    const bool touch = nearest < kContactDistance;
    events += touch && !touched;
    contacts += touch;
    touched = touch;
    result.nearest_joint_distance += nearest / frames;
    result.aabb_overlap_iou += overlap_iou(a, b) / frames;
    outside += outside_support(a) + outside_support(b);
  }
  result.contact_events_per_s = events / result.seconds;
  result.contact_ratio = static_cast<double>(contacts) / frames;
  result.com_outside_support = 0.5 * outside / frames;
  Dynamics dynamics;
  add_dynamics(clip.a, dynamics);
  add_dynamics(clip.b, dynamics);
  result.joint_speed_p95 = quantile(std::move(dynamics.speed), 0.95);
  result.joint_acceleration_p95 = quantile(std::move(dynamics.acceleration), 0.95);
  return result;
}

std::span<const StatisticInfo> clip_statistic_catalogue() {
  static constexpr std::array<StatisticInfo, 7> catalogue = {
      {{"contact_events_per_s", "Contact events", "1/s", &ClipStatistics::contact_events_per_s},
       {"contact_ratio", "Contact ratio", "1", &ClipStatistics::contact_ratio},
       {"nearest_joint_distance", "Mean nearest-joint distance", "m", &ClipStatistics::nearest_joint_distance},
       {"aabb_overlap_iou", "AABB overlap IoU", "1", &ClipStatistics::aabb_overlap_iou},
       {"joint_speed_p95", "Joint speed p95", "m/s", &ClipStatistics::joint_speed_p95},
       {"joint_acceleration_p95", "Joint acceleration p95", "m/s^2", &ClipStatistics::joint_acceleration_p95},
       {"com_outside_support", "COM outside support AABB", "1", &ClipStatistics::com_outside_support}}};
  return catalogue;
}

ClipStatistics pooled(std::span<const ClipStatistics> clips) {
  ClipStatistics result;
  for (const ClipStatistics& clip : clips) result.seconds += clip.seconds;
  for (const ClipStatistics& clip : clips)
    for (const StatisticInfo& info : clip_statistic_catalogue())
      result.*info.value += clip.*info.value * clip.seconds / result.seconds;
  return result;
}

}  // namespace duet
