#include "duet/metrics/clip_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/tasks/task_definition.h"

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

namespace {

using People = std::array<const HumanMotion*, 2>;

constexpr std::array<SmplJoint, 2> kHandJoints = {kLeftHand, kRightHand};
constexpr std::array<SmplJoint, 7> kTrunk = {kPelvis, kNeck, kHead, kLeftShoulder, kRightShoulder, kLeftHip, kRightHip};

Eigen::Vector3d joint(const HumanMotion& person, int t, int j) { return person.joints.at(t, j); }

double to_segment(const Eigen::Vector3d& point, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d way = to - from;
  const double share = std::clamp((point - from).dot(way) / std::max(way.squaredNorm(), 1e-12), 0.0, 1.0);
  return (point - from - share * way).norm();
}

double root_distance(const People& people, int t) {
  return (joint(*people[0], t, kPelvis) - joint(*people[1], t, kPelvis)).head<2>().norm();
}

// Where the hips face, level. [rad]
double facing(const HumanMotion& person, int t) {
  const Eigen::Vector3d to_left = joint(person, t, kLeftHip) - joint(person, t, kRightHip);
  return std::atan2(-to_left.x(), to_left.y());
}

double turned(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi) * 180.0 / std::numbers::pi; }

// The direction to the other, to the right of where this one faces. [deg]
double bearing_of_other(const HumanMotion& person, const HumanMotion& other, int t) {
  const Eigen::Vector3d way = joint(other, t, kPelvis) - joint(person, t, kPelvis);
  return turned(facing(person, t) - std::atan2(way.y(), way.x()));
}

// The hands that are nearest to touching, left 0, right 1; in an embrace only one of them is a hand (side of it twice).
struct Nearest {
  double distance = std::numeric_limits<double>::infinity();
  std::array<int, 2> side = {0, 0};
  double height = 0.0;  // of the touching hand, or of the middle of both [m]
};

Nearest nearest_hands(const People& people, int t) {
  Nearest nearest;
  for (const int a : {0, 1}) {
    for (const int b : {0, 1}) {
      const Eigen::Vector3d p = joint(*people[0], t, kHandJoints[a]), q = joint(*people[1], t, kHandJoints[b]);
      if ((p - q).norm() < nearest.distance) nearest = {(p - q).norm(), {a, b}, 0.5 * (p.z() + q.z())};
    }
  }
  return nearest;
}

Nearest nearest_embrace(const People& people, int t) {
  Nearest nearest;
  for (const int k : {0, 1}) {
    const HumanMotion& other = *people[1 - k];
    for (const int side : {0, 1}) {
      const Eigen::Vector3d hand = joint(*people[k], t, kHandJoints[side]);
      const double distance = to_segment(hand, joint(other, t, kPelvis), joint(other, t, kNeck));
      if (distance < nearest.distance) nearest = {distance, {side, side}, hand.z()};
    }
  }
  return nearest;
}

double lowest_of(const HumanMotion& person, int t) { return person.joints.frame(t).row(2).minCoeff(); }

// How far from facing the other hips and ankles are.
void add_sides(const People& people, int t, InteractionStatistics& result) {
  result.hips_aside = result.ankles_aside = 0.0;
  for (const int k : {0, 1}) {
    const HumanMotion &one = *people[k], &other = *people[1 - k];
    result.hips_aside = std::max(result.hips_aside, std::abs(bearing_of_other(one, other, t)));
    const Eigen::Vector3d across = joint(one, t, kLeftAnkle) - joint(one, t, kRightAnkle);
    const Eigen::Vector3d way = joint(other, t, kPelvis) - joint(one, t, kPelvis);
    const double aside = turned(std::atan2(-across.x(), across.y()) - std::atan2(way.y(), way.x()));
    result.ankles_aside = std::max(result.ankles_aside, std::abs(aside));
  }
}

void add_posture(const People& people, InteractionStatistics& result) {
  result.lean = 0.0;
  result.raised = -std::numeric_limits<double>::infinity();
  for (const HumanMotion* person : people) {
    std::vector<double> lean, raised;
    for (int t = 0; t < person->frames(); ++t) {
      const Eigen::Vector3d up = joint(*person, t, kNeck) - joint(*person, t, kPelvis);
      lean.push_back(std::atan2(up.head<2>().norm(), up.z()) * 180.0 / std::numbers::pi);
      raised.push_back(std::max(joint(*person, t, kLeftHand).z(), joint(*person, t, kRightHand).z()) -
                       joint(*person, t, kPelvis).z());
    }
    result.lean = std::max(result.lean, quantile(std::move(lean), 0.95));
    result.raised = std::max(result.raised, quantile(std::move(raised), 0.95));
  }
}

void add_touch(const InteractionClip& clip, const People& people, InteractionStatistics& result) {
  const ActSignal signal = definition_of(clip.task).phases.act;
  const bool hands = signal == ActSignal::kHandsTogether, embrace = signal == ActSignal::kHandAtChest;
  int first = -1, last = -1, count = 0, right = 0;
  double height = 0.0;
  for (int t = 0; t < clip.frames(); ++t) {
    const Nearest nearest = embrace ? nearest_embrace(people, t) : nearest_hands(people, t);
    const bool in_act = t >= clip.phases.act_begin && t < clip.phases.act_end;
    const bool touch = hands ? nearest.distance < kHandsTouch : embrace ? nearest.distance < kEmbrace : in_act;
    if (!touch) continue;
    if (first < 0) first = t;
    last = t;
    ++count;
    right += nearest.side[0] + nearest.side[1];
    height += nearest.height - std::min(lowest_of(*people[0], t), lowest_of(*people[1], t));
  }
  result.touches = count > 0 ? 1.0 : 0.0;
  if (count == 0) return;
  const double rate = clip.rate_hz();
  result.touch_s = count / rate;
  result.before_s = first / rate;
  result.after_s = (clip.frames() - 1 - last) / rate;
  result.touch_distance = root_distance(people, first);
  result.touch_bearing =
      0.5 * (bearing_of_other(*people[0], *people[1], first) + bearing_of_other(*people[1], *people[0], first));
  result.turned_hips = 0.0;
  for (const HumanMotion* person : people)
    result.turned_hips += 0.5 * turned(facing(*person, (first + last) / 2) - facing(*person, 0));
  result.touch_turn = std::abs(turned(facing(*people[0], first) - facing(*people[1], first) + std::numbers::pi));
  add_sides(people, first, result);
  if (!hands && !embrace) return;
  result.touch_height = height / count;
  result.right_hands = 0.5 * right / count;
}

// How far each root gets in the window that ends at frame t, both and the gap between them. [m/s]
void add_approach(const InteractionClip& clip, const People& people, InteractionStatistics& result) {
  const int frames = clip.frames();
  const int window = std::clamp(static_cast<int>(std::lround(kApproachWindow * clip.rate_hz())), 1, frames - 1);
  const double seconds = window / clip.rate_hz();
  std::array<std::vector<double>, 2> speeds;
  result.largest_distance = root_distance(people, 0);
  result.approach_speed = 0.0;
  for (int t = 0; t < frames; ++t) {
    result.largest_distance = std::max(result.largest_distance, root_distance(people, t));
    if (t < window) continue;
    result.approach_speed =
        std::max(result.approach_speed, (root_distance(people, t - window) - root_distance(people, t)) / seconds);
    for (const int k : {0, 1}) {
      const Eigen::Vector3d way = joint(*people[k], t, kPelvis) - joint(*people[k], t - window, kPelvis);
      speeds[k].push_back(way.head<2>().norm() / seconds);
    }
  }
  result.root_speed_p95 = 0.5 * (quantile(speeds[0], 0.95) + quantile(speeds[1], 0.95));
  result.standing = 0.0;
  for (const HumanMotion* person : people) {
    double farthest = 0.0;
    const Eigen::Vector3d begin = joint(*person, 0, kPelvis);
    for (int t = 1; t < frames; ++t)
      farthest = std::max(farthest, (joint(*person, t, kPelvis) - begin).head<2>().norm());
    result.standing += farthest < kStanding ? 0.5 : 0.0;
  }
}

double hand_speed(const HumanMotion& person) {
  std::vector<double> faster;
  for (int t = 1; t < person.frames(); ++t) {
    double speed = 0.0;
    for (const int hand : kHandJoints)
      speed = std::max(speed, person.rate_hz * (joint(person, t, hand) - joint(person, t - 1, hand)).norm());
    faster.push_back(speed);
  }
  return quantile(std::move(faster), 0.95);
}

// When a hand first is kSetOut from where it was in the first frame, seen from the root; none where it never is. [s]
std::optional<double> set_out(const HumanMotion& person) {
  for (int t = 1; t < person.frames(); ++t)
    for (const int hand : kHandJoints) {
      const Eigen::Vector3d now = joint(person, t, hand) - joint(person, t, kPelvis);
      const Eigen::Vector3d before = joint(person, 0, hand) - joint(person, 0, kPelvis);
      if ((now - before).norm() > kSetOut) return t / person.rate_hz;
    }
  return {};
}

double noise_of(const InteractionClip& clip, const People& people) {
  const int step = std::max(1, static_cast<int>(std::lround(kNoiseStep * clip.rate_hz())));
  std::vector<double> residuals;
  for (const HumanMotion* person : people)
    for (int t = step; t + step < clip.frames(); ++t)
      for (const int j : kTrunk)
        residuals.push_back(
            (joint(*person, t, j) - 0.5 * (joint(*person, t - step, j) + joint(*person, t + step, j))).norm());
  return quantile(std::move(residuals), 0.5);
}

// The median of what is measured in each frame of a person.
template <typename Measure>
double median_over_frames(const HumanMotion& person, const Measure& measure) {
  std::vector<double> values;
  values.reserve(static_cast<std::size_t>(person.frames()));
  for (int t = 0; t < person.frames(); ++t) values.push_back(measure(t));
  return quantile(std::move(values), 0.5);
}

void add_bodies(const People& people, InteractionStatistics& result) {
  std::vector<double> changes;
  int occluded = 0, arms = 0;
  result.stature = result.arm_length = result.feet_aside = result.neck_height = 0.0;
  for (const HumanMotion* person : people) {
    const auto between = [&](int t, int to, int from) -> Eigen::Vector3d {
      return joint(*person, t, to) - joint(*person, t, from);
    };
    result.stature +=
        0.5 * median_over_frames(*person, [&](int t) { return joint(*person, t, kHead).z() - lowest_of(*person, t); });
    result.neck_height += 0.5 * median_over_frames(*person, [&](int t) { return between(t, kNeck, kPelvis).z(); });
    for (const auto& [ankle, hip] : {std::pair(kLeftAnkle, kLeftHip), std::pair(kRightAnkle, kRightHip)})
      result.feet_aside += 0.25 * median_over_frames(*person, [&, ankle = ankle, hip = hip](int t) {
                             return between(t, ankle, hip).head<2>().norm();
                           });
    for (const auto& [shoulder, elbow, wrist] :
         {std::array{kLeftShoulder, kLeftElbow, kLeftWrist}, std::array{kRightShoulder, kRightElbow, kRightWrist}}) {
      std::array<std::vector<double>, 2> bones;
      for (std::vector<double>& lengths : bones) lengths.reserve(static_cast<std::size_t>(person->frames()));
      for (int t = 0; t < person->frames(); ++t) {
        bones[0].push_back((joint(*person, t, elbow) - joint(*person, t, shoulder)).norm());
        bones[1].push_back((joint(*person, t, wrist) - joint(*person, t, elbow)).norm());
      }
      const std::array<double, 2> usual = {quantile(bones[0], 0.5), quantile(bones[1], 0.5)};
      result.arm_length += 0.25 * (usual[0] + usual[1]);
      for (int t = 0; t < person->frames(); ++t) {
        const double upper = std::abs(bones[0][t] / usual[0] - 1.0), lower = std::abs(bones[1][t] / usual[1] - 1.0);
        changes.insert(changes.end(), {upper, lower});
        occluded += std::max(upper, lower) > kOccluded;
        ++arms;
      }
    }
  }
  result.arm_change_p95 = quantile(std::move(changes), 0.95);
  result.arm_occluded = static_cast<double>(occluded) / arms;
}

double source_rate(const InteractionClip& clip) {
  const auto told = clip.source.find("source_rate_hz");
  if (told == clip.source.end()) return clip.rate_hz();
  const std::optional<double> rate = parse_number(told->second);
  return rate && *rate > 0.0 ? *rate : clip.rate_hz();
}

}  // namespace

InteractionStatistics interaction_statistics(const InteractionClip& clip) {
  const int frames = clip.frames();
  require(frames >= 3, "interaction statistics of clip '{}': expected at least 3 frames, found {}", clip.id, frames);
  const People people = {&clip.a, &clip.b};
  InteractionStatistics result{.seconds = frames / clip.rate_hz()};
  add_touch(clip, people, result);
  add_approach(clip, people, result);
  result.hand_speed_p95 = 0.5 * (hand_speed(clip.a) + hand_speed(clip.b));
  result.joint_speed_p95 = clip_statistics(clip).joint_speed_p95;
  const std::optional<double> a = set_out(clip.a), b = set_out(clip.b);
  if (a && b) result.reaction_s = std::abs(*a - *b);
  result.source_rate_hz = source_rate(clip);
  result.noise = noise_of(clip, people);
  add_bodies(people, result);
  add_posture(people, result);
  return result;
}

std::span<const InteractionStatisticInfo> interaction_statistic_catalogue() {
  using S = InteractionStatistics;
  static constexpr auto catalogue = std::to_array<InteractionStatisticInfo>({
      {"seconds", "Length of the clip", "s", &S::seconds, false},
      {"touches", "Clips with a touch or gesture", "1", &S::touches, true},
      {"touch_s", "Time in touch", "s", &S::touch_s, false},
      {"before_s", "Before the touch", "s", &S::before_s, false},
      {"after_s", "After the touch", "s", &S::after_s, false},
      {"touch_distance", "Distance of the roots at the touch", "m", &S::touch_distance, false},
      {"touch_bearing", "The other is to the right by", "deg", &S::touch_bearing, false},
      {"turned_hips", "Turned to the left until mid-touch", "deg", &S::turned_hips, false},
      {"touch_turn", "Turned from facing each other", "deg", &S::touch_turn, false},
      {"hips_aside", "Hips from facing the other", "deg", &S::hips_aside, false},
      {"ankles_aside", "Ankles from facing the other", "deg", &S::ankles_aside, false},
      {"lean", "Lean of the trunk p95", "deg", &S::lean, false},
      {"raised", "Hand over the pelvis p95", "m", &S::raised, false},
      {"largest_distance", "Largest distance of the roots", "m", &S::largest_distance, false},
      {"touch_height", "Height of the touch", "m", &S::touch_height, false},
      {"approach_speed", "Closing speed of the roots", "m/s", &S::approach_speed, false},
      {"root_speed_p95", "Root speed p95", "m/s", &S::root_speed_p95, false},
      {"hand_speed_p95", "Hand speed p95", "m/s", &S::hand_speed_p95, false},
      {"joint_speed_p95", "Joint speed p95", "m/s", &S::joint_speed_p95, false},
      {"reaction_s", "Between the two setting out", "s", &S::reaction_s, false},
      {"right_hands", "Right hands", "1", &S::right_hands, true},
      {"standing", "People who stand", "1", &S::standing, true},
      {"source_rate_hz", "Rate of the recording", "Hz", &S::source_rate_hz, false},
      {"noise", "Residual of the trunk", "m", &S::noise, false},
      {"arm_change_p95", "Change of the arms' bones p95", "1", &S::arm_change_p95, false},
      {"arm_occluded", "Arms lost", "1", &S::arm_occluded, true},
      {"feet_aside", "Ankles from below the hips", "m", &S::feet_aside, false},
      {"neck_height", "Neck over the pelvis", "m", &S::neck_height, false},
      {"stature", "Head over the feet", "m", &S::stature, false},
      {"arm_length", "Shoulder to wrist", "m", &S::arm_length, false},
  });
  return catalogue;
}

StatisticSpread spread_of(std::span<const InteractionStatistics> clips, const InteractionStatisticInfo& info) {
  std::vector<double> values;
  values.reserve(clips.size());
  double sum = 0.0;
  for (const InteractionStatistics& clip : clips) {
    const double value = clip.*info.value;
    if (!std::isfinite(value)) continue;
    values.push_back(value);
    sum += value;
  }
  if (values.empty()) return {0, kUnknownStatistic, kUnknownStatistic, kUnknownStatistic};
  const int count = static_cast<int>(values.size());
  if (info.is_share) return {count, sum / count, sum / count, sum / count};
  std::ranges::sort(values);
  return {count, quantile_of_sorted(values, 0.05), quantile_of_sorted(values, 0.5), quantile_of_sorted(values, 0.95)};
}

bool agree(const StatisticSpread& one, const StatisticSpread& other, const InteractionStatisticInfo& info) {
  const double allowed = kAgreement * (info.is_share ? 1.0 : std::abs(other.middle));
  return std::abs(one.middle - other.middle) <= (info.unit == "deg" ? std::max(allowed, kAngleAgreement) : allowed);
}

}  // namespace duet
