#include "duet/motion/people/tracked_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "duet/core/names.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/motion/people/source_clip.h"

namespace duet {
namespace {

// The columns of "kinect-15" and the joints that stand for them.
constexpr std::array<SmplJoint, 15> kColumns = {kHead,     kNeck,          kSpine2,     kLeftShoulder, kLeftElbow,
                                                kLeftHand, kRightShoulder, kRightElbow, kRightHand,    kLeftHip,
                                                kLeftKnee, kLeftAnkle,     kRightHip,   kRightKnee,    kRightAnkle};

constexpr bool is_arm(SmplJoint joint) {
  return joint == kLeftElbow || joint == kRightElbow || joint == kLeftHand || joint == kRightHand;
}
constexpr bool is_limb(SmplJoint joint) {
  return is_arm(joint) || joint == kLeftKnee || joint == kRightKnee || joint == kLeftAnkle || joint == kRightAnkle;
}
constexpr bool is_left(SmplJoint joint) { return joint == kLeftElbow || joint == kLeftHand; }

Eigen::Vector3d normal3(Random& random) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return {x, y, z};
}

// The distance of a hand from the other person's nearest joint.
double to_person(const Eigen::Vector3d& hand, const HumanMotion& other, int frame) {
  return (other.joints.frame(frame).colwise() - hand).colwise().norm().minCoeff();
}

// Whether an arm is lost, frame by frame: a quarter of a second on end in the mean, and as long in a wrong place.
class LostArm {
 public:
  bool at(bool hidden, const TrackerModel& tracker, Random& random) {
    const double rate_hz = tracker.rate_hz, share = tracker.lost_share;
    const Eigen::Vector3d elbow = normal3(random), hand = normal3(random);
    const double length = random.uniform(0.1, 0.4);
    const bool begins = random.chance(std::min(1.0, share / std::max(1.0, 0.25 * rate_hz)));
    if (frames_ == 0 && hidden && begins) {
      frames_ = std::max(1, static_cast<int>(std::lround(length * rate_hz)));
      elbow_ = tracker.lost_noise * elbow;
      hand_ = tracker.lost_noise * hand;
    }
    if (frames_ == 0) return false;
    --frames_;
    return true;
  }

  [[nodiscard]] const Eigen::Vector3d& error(SmplJoint joint) const {
    return joint == kLeftElbow || joint == kRightElbow ? elbow_ : hand_;
  }

 private:
  int frames_ = 0;
  Eigen::Vector3d elbow_ = Eigen::Vector3d::Zero(), hand_ = Eigen::Vector3d::Zero();
};

using Errors = std::array<Eigen::Vector3d, kColumns.size()>;

// The errors that stay over a clip: a foot that is taken for another place is no lower than the floor.
Errors misplaced(const TrackerModel& tracker, Random random) {
  Errors errors;
  errors.fill(Eigen::Vector3d::Zero());
  std::array<Eigen::Vector3d, 2> feet;
  for (Eigen::Vector3d& foot : feet) {
    foot = tracker.feet * normal3(random);
    foot.z() = 0.4 * std::abs(foot.z());
  }
  for (std::size_t i = 0; i < kColumns.size(); ++i) {
    const SmplJoint joint = kColumns[i];
    if (joint == kNeck) errors[i].z() = -tracker.low_neck;
    if (joint == kHead) errors[i].z() = tracker.high_head;
    if (joint == kLeftShoulder || joint == kRightShoulder) errors[i].z() = -tracker.low_shoulders;
    if (joint == kLeftKnee || joint == kRightKnee) errors[i] = 0.5 * feet[joint == kLeftKnee ? 0 : 1];
    if (joint == kLeftAnkle || joint == kRightAnkle) errors[i] = feet[joint == kLeftAnkle ? 0 : 1];
  }
  return errors;
}

// Where the skeleton that it fits has another joint than a body model, from there. [m]
Eigen::Vector3d skeleton_offset(const PointTracks::ConstFrame& joints, SmplJoint joint, const TrackerModel& tracker) {
  const auto towards = [&](SmplJoint other, double share) -> Eigen::Vector3d {
    return share * (joints.col(other) - joints.col(joint));
  };
  if (joint == kLeftShoulder) return towards(kRightShoulder, tracker.narrow_shoulders);
  if (joint == kRightShoulder) return towards(kLeftShoulder, tracker.narrow_shoulders);
  if (joint == kLeftHip) return towards(kRightHip, tracker.narrow_hips);
  if (joint == kRightHip) return towards(kLeftHip, tracker.narrow_hips);
  if (joint == kLeftElbow) return towards(kLeftHand, tracker.low_elbows);
  if (joint == kRightElbow) return towards(kRightHand, tracker.low_elbows);
  return Eigen::Vector3d::Zero();
}

PointTracks seen(const HumanMotion& person, const HumanMotion& other, const TrackerModel& tracker, int frames,
                 Random random, const Errors& staying) {
  const double ratio = person.rate_hz / tracker.rate_hz;
  const double keep = std::exp(-1.0 / (tracker.drift_time * tracker.rate_hz)), add = std::sqrt(1.0 - keep * keep);
  PointTracks result(frames, static_cast<int>(kColumns.size()));
  Errors drift;
  for (Eigen::Vector3d& value : drift) value = tracker.drift * normal3(random);
  std::array<LostArm, 2> arms;
  for (int t = 0; t < frames; ++t) {
    const FrameBetween at = frame_between(t * ratio, person.frames());
    const int next = std::min(at.frame + 1, person.frames() - 1);
    std::array<bool, 2> lost = {false, false};
    for (const int side : {0, 1}) {
      const Eigen::Vector3d hand = person.joints.at(at.frame, side == 0 ? kLeftHand : kRightHand);
      lost[side] = arms[side].at(to_person(hand, other, at.frame) < tracker.hidden_within, tracker, random);
    }
    const Eigen::Vector3d apart = person.joints.at(at.frame, kPelvis) - other.joints.at(at.frame, kPelvis);
    const double noise = tracker.noise * (apart.head<2>().norm() < kCrowded ? tracker.crowded : 1.0);
    for (std::size_t i = 0; i < kColumns.size(); ++i) {
      const SmplJoint joint = kColumns[i];
      const Eigen::Vector3d here = person.joints.at(at.frame, joint), there = person.joints.at(next, joint);
      drift[i] = keep * drift[i] + add * tracker.drift * normal3(random);
      Eigen::Vector3d error = staying[i] + drift[i] + noise * normal3(random);
      error += skeleton_offset(person.joints.frame(at.frame), joint, tracker);
      if (is_limb(joint)) error += tracker.limb_noise * normal3(random);
      if (is_arm(joint)) {
        const int side = is_left(joint) ? 0 : 1;
        if (lost[side]) error += arms[side].error(joint);
      }
      result.at(t, static_cast<int>(i)) = here + at.part * (there - here) + error;
    }
  }
  return result;
}

void check_tracker(const TrackerModel& tracker) {
  require(tracker.rate_hz >= 5.0 && tracker.rate_hz <= 120.0, "tracked clip: expected a rate of 5 to 120 Hz, found {}",
          tracker.rate_hz);
  for (const double value :
       {tracker.noise, tracker.crowded, tracker.drift, tracker.limb_noise, tracker.feet, tracker.low_neck,
        tracker.low_shoulders, tracker.high_head, tracker.hidden_within, tracker.lost_share, tracker.lost_noise})
    require(value >= 0.0, "tracked clip: expected figures of 0 or more, found {}", value);
  require(tracker.drift_time > 0.0, "tracked clip: expected a positive drift_time, found {}", tracker.drift_time);
}

}  // namespace

TrackerModel tracker_of(const InteractionClip& clip, std::uint64_t seed) {
  TrackerModel tracker;
  const auto like = clip.source.find("like");
  if (like == clip.source.end() || like->second != "varied") return tracker;
  Random random(seed, stream_key({"tracker", clip.id}));
  tracker.rate_hz = random.chance(0.5) ? 15.0 : 30.0;
  tracker.noise = random.uniform(0.001, 0.003);
  tracker.limb_noise = random.uniform(0.002, 0.012);
  tracker.feet = random.uniform(0.02, 0.22);
  tracker.low_neck = random.uniform(0.06, 0.14);
  tracker.low_shoulders = random.uniform(0.03, 0.08);
  tracker.high_head = random.uniform(0.0, 0.10);
  tracker.narrow_shoulders = random.uniform(-0.04, 0.14);
  tracker.narrow_hips = random.uniform(-0.14, 0.11);
  tracker.low_elbows = random.uniform(0.0, 0.22);
  tracker.lost_share = random.uniform(0.06, 0.3);
  return tracker;
}

InteractionClip add_tracker_noise(const InteractionClip& clip, const TrackerModel& tracker, std::uint64_t seed) {
  check_tracker(tracker);
  const int frames = resampled_frames(clip.frames(), clip.rate_hz(), tracker.rate_hz);
  const auto person = [&](const char* who, const HumanMotion& one, const HumanMotion& other) {
    return seen(one, other, tracker, frames, {seed, stream_key({"tracked", clip.id, who})},
                misplaced(tracker, {seed, stream_key({"misplaced", clip.id, who})}));
  };
  RawPeople raw{.id = tracked_clip_id(clip.id),
                .name = clip.id,
                .layout = &joint_layout("kinect-15"),
                .joints = {person("a", clip.a, clip.b), person("b", clip.b, clip.a)},
                .rate_hz = tracker.rate_hz,
                .up = Axis::kPlusZ,
                .metres_per_unit = 1.0,
                .task = clip.task};
  const PeopleOptions options{.mirrored = false,
                              .level = false,
                              .floor = 0.0,
                              .drop_t_pose = false,
                              .reactor = clip.reactor,
                              .output_rate_hz = clip.rate_hz()};
  InteractionClip result = clip_of(raw, options).clip;
  const std::map<std::string, std::string> found = std::move(result.source);
  result.source = clip.source;
  for (const char* key : {"skeleton", "source_rate_hz"}) result.source[key] = found.at(key);
  result.source["tracked"] = fmt::format("{}", seed);
  result.phases.act_begin = std::min(clip.phases.act_begin, result.frames() - 1);
  result.phases.act_end = std::clamp(clip.phases.act_end, result.phases.act_begin + 1, result.frames());
  for (ContactWindow window : clip.contacts) {
    window.end = std::min(window.end, result.frames());
    if (window.begin < window.end) result.contacts.push_back(window);
  }
  return result;
}

}  // namespace duet
