#include "duet/motion/interaction_clip.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/motion/npz_fields.h"
#include "duet/tasks/task_definition.h"

namespace duet {
namespace {

constexpr const char* kSchema = "duet.interaction_clip";
constexpr std::int64_t kSchemaVersion = 1;

void check_contact(const InteractionClip& clip, const ContactWindow& window, std::size_t index) {
  require(0 <= window.begin && window.begin < window.end && window.end <= clip.frames(),
          "clip '{}': contact window {}: expected 0 <= begin < end <= {} frames, found [{}, {})", clip.id, index,
          clip.frames(), window.begin, window.end);
  for (const int joint : {window.joint_a, window.joint_b})
    require(0 <= joint && joint < kSmplJoints, "clip '{}': contact window {}: expected joints 0..{}, found {}", clip.id,
            index, kSmplJoints - 1, joint);
}

void put_contacts(Npz& npz, const std::vector<ContactWindow>& contacts) {
  std::vector<std::int64_t> values;
  for (const ContactWindow& window : contacts)
    values.insert(values.end(), {window.begin, window.end, window.joint_a, window.joint_b});
  npz.set("contacts", std::move(values), {contacts.size(), 4});
}

// The joint numbers of the file count its own columns.
std::vector<ContactWindow> get_contacts(const Npz& npz, const std::vector<int>& columns) {
  std::vector<ContactWindow> contacts;
  if (!npz.contains("contacts")) return contacts;
  std::vector<int> joint_of_column(kSmplJoints);
  for (int joint = 0; joint < kSmplJoints; ++joint) joint_of_column[columns[joint]] = joint;
  const std::vector<std::int64_t> values = npz.integers("contacts", {-1, 4});
  for (std::size_t i = 0; i + 3 < values.size(); i += 4) {
    for (std::size_t k = 0; k < 4; ++k)
      if (values[i + k] < 0 || values[i + k] >= (k < 2 ? std::int64_t{1} << 30 : kSmplJoints))
        throw InputError(fmt::format("'{}': key 'contacts': row {}, column {}: {} is out of range", npz.name(), i / 4,
                                     k, values[i + k]));
    contacts.push_back({.begin = static_cast<int>(values[i]),
                        .end = static_cast<int>(values[i + 1]),
                        .joint_a = joint_of_column[values[i + 2]],
                        .joint_b = joint_of_column[values[i + 3]]});
  }
  return contacts;
}

// Takes the file's phases, or a proposal, which is said in `source`. Two lengths are left to validate().
void take_phases(const Npz& npz, InteractionClip& clip) {
  if (npz.contains("phases")) {
    clip.phases = get_phases(npz);
  } else if (clip.a.frames() == clip.b.frames()) {
    clip.phases = propose_phases(clip.a, clip.b, clip.task);
    clip.source["phases"] = "proposed";
  }
}

HumanMotion mirrored(const HumanMotion& motion) {
  HumanMotion result = motion;
  for (int t = 0; t < motion.frames(); ++t) {
    for (int j = 0; j < kSmplJoints; ++j) {
      result.joints.at(t, j) = motion.joints.at(t, kSmplMirror[j]);
      result.joints.at(t, j).y() *= -1.0;
    }
    for (int j = 0; j < (motion.rotations.empty() ? 0 : kSmplJoints); ++j) {
      const std::size_t row = static_cast<std::size_t>(t) * kSmplJoints;
      const Eigen::Quaterniond& R = motion.rotations[row + kSmplMirror[j]];
      result.rotations[row + j] = Eigen::Quaterniond(R.w(), -R.x(), R.y(), -R.z());  // S R S, S = diag(1, -1, 1)
    }
  }
  return result;
}

}  // namespace

void validate(const InteractionClip& clip) {
  validate(clip.a, fmt::format("clip '{}', person A", clip.id));
  validate(clip.b, fmt::format("clip '{}', person B", clip.id));
  require(clip.a.frames() == clip.b.frames(),
          "clip '{}': expected two people of the same length, found {} and {} frames", clip.id, clip.a.frames(),
          clip.b.frames());
  require(clip.a.rate_hz == clip.b.rate_hz, "clip '{}': expected two people at the same rate, found {} and {} Hz",
          clip.id, clip.a.rate_hz, clip.b.rate_hz);
  require(0 <= clip.phases.act_begin && clip.phases.act_begin <= clip.phases.act_end &&
              clip.phases.act_end <= clip.frames(),
          "clip '{}': expected phases with 0 <= act_begin <= act_end <= {} frames, found [{}, {})", clip.id,
          clip.frames(), clip.phases.act_begin, clip.phases.act_end);
  for (std::size_t i = 0; i < clip.contacts.size(); ++i) check_contact(clip, clip.contacts[i], i);
  validate(clip.object, clip.frames(), fmt::format("clip '{}', object", clip.id));
}

InteractionClip read_clip(const Npz& npz) {
  check_schema(npz, kSchema, kSchemaVersion,
               {"id", "task", "reactor", "phases", "rate_hz", "human_joint_names", "a_joints", "a_rotations_wxyz",
                "b_joints", "b_rotations_wxyz", "contacts", "source_names", "source_values", "object_position",
                "object_quat_wxyz", "object_keypoints"},
               {});
  const double rate_hz = get_rate(npz);
  const std::vector<int> columns = get_joint_columns(npz);
  InteractionClip clip{.id = get_id(npz, "id"),
                       .task = get_task(npz),
                       .a = get_motion(npz, "a", rate_hz, columns),
                       .b = get_motion(npz, "b", rate_hz, columns),
                       .phases = {},
                       .reactor = get_reactor(npz),
                       .contacts = get_contacts(npz, columns),
                       .source = get_texts(npz, "source"),
                       .object = get_object(npz)};
  take_phases(npz, clip);
  check_archive(npz, [&] { validate(clip); });
  return clip;
}

std::string clip_bytes(const InteractionClip& clip, ZipMethod method) {
  validate(clip);
  Npz npz;
  put_schema(npz, kSchema, kSchemaVersion);
  npz.set_text("id", clip.id);
  put_task(npz, clip.task, clip.reactor, clip.phases, clip.rate_hz());
  put_joint_names(npz);
  put_motion(npz, "a", clip.a);
  put_motion(npz, "b", clip.b);
  put_contacts(npz, clip.contacts);
  put_texts(npz, "source", clip.source);
  put_object(npz, clip.object);
  return npz.bytes(method);
}

InteractionClip parse_clip(std::string_view bytes, const std::string& name) {
  return read_clip(Npz::parse(bytes, name));
}

void save_clip(const InteractionClip& clip, const std::string& path) { write_file(path, clip_bytes(clip)); }

InteractionClip load_clip(const std::string& path) { return read_clip(Npz::load(path)); }

void set_reactor(InteractionClip& clip, Person reactor) {
  if (clip.reactor == reactor) return;
  clip.id = id_in_other_role(clip.id, clip.reactor == Person::kA ? 'A' : 'B');
  clip.reactor = reactor;
}

namespace {

// `before` copies of the first frame, the frames, `after` copies of the last.
HumanMotion held(const HumanMotion& motion, int before, int after) {
  const int frames = motion.frames();
  const std::size_t per_frame = motion.rotations.size() / static_cast<std::size_t>(frames);
  HumanMotion result{.rate_hz = motion.rate_hz,
                     .joints = PointTracks(before + frames + after, motion.joints.points()),
                     .rotations = {}};
  for (int t = 0; t < result.frames(); ++t) {
    const int source = std::clamp(t - before, 0, frames - 1);
    result.joints.frame(t) = motion.joints.frame(source);
    const auto first = motion.rotations.begin() + static_cast<std::ptrdiff_t>(source * per_frame);
    result.rotations.insert(result.rotations.end(), first, first + static_cast<std::ptrdiff_t>(per_frame));
  }
  return result;
}

}  // namespace

InteractionClip padded(const InteractionClip& clip, double before, double after) {
  for (const double time : {before, after})
    require(std::isfinite(time) && time >= 0.0, "padding: expected seconds, found {}", time);
  const int first = static_cast<int>(std::lround(before * clip.rate_hz()));
  const int last = static_cast<int>(std::lround(after * clip.rate_hz()));
  InteractionClip result = clip;
  result.a = held(clip.a, first, last);
  result.b = held(clip.b, first, last);
  result.object = held(clip.object, first, last);
  result.phases.act_begin += first;
  result.phases.act_end += first;
  for (ContactWindow& window : result.contacts) {
    window.begin += first;
    window.end += first;
  }
  return result;
}

InteractionClip mirrored(const InteractionClip& clip) {
  InteractionClip result = clip;
  result.a = mirrored(clip.a);
  result.b = mirrored(clip.b);
  result.object = mirrored(clip.object);
  for (ContactWindow& window : result.contacts) {
    window.joint_a = kSmplMirror[window.joint_a];
    window.joint_b = kSmplMirror[window.joint_b];
  }
  return result;
}

// The task's signal says how far the act is under way (larger = more); the act is the stretch around its peak above a
// threshold. docs/conventions.md describes signals and thresholds.

namespace {

using Signal = std::vector<double>;

constexpr double kReach = 0.20;          // hands this much farther apart than at their nearest are still in the act [m]
constexpr double kRaisedShare = 0.35;    // of the way from rest to peak: the hand is on its way up
constexpr double kLoweredShare = 0.75;   // ... and on its way down again
constexpr double kCoveredShare = 0.50;   // of the gap between the people that reaching hands cover at most
constexpr double kLeanShare = 0.15;      // of the deepest bow
constexpr double kLeastHandRise = 0.10;  // a smaller rise of the hands is no gesture [m]
constexpr double kLeastLean = 0.10;      // a smaller bow is no gesture [rad]
constexpr double kClaspGap = 1.5;        // shorter interruptions of a contact belong to the act (a second clap) [s]
constexpr double kGestureGap = 5.0;      // ... of a gesture (the other's reply) [s]
constexpr double kOnsetGap = 0.1;        // ... of the reach for a contact [s]
constexpr double kRestQuantile = 0.10;

Eigen::Vector3d chest(const HumanMotion& motion, int t) {
  return 0.5 * (motion.joints.at(t, kSpine3) + motion.joints.at(t, kNeck));
}

// Distance of the nearest hands of the two people. [m]
double hand_distance(const HumanMotion& a, const HumanMotion& b, int t) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const int hand_a : {kLeftHand, kRightHand})
    for (const int hand_b : {kLeftHand, kRightHand})
      nearest = std::min(nearest, (a.joints.at(t, hand_a) - b.joints.at(t, hand_b)).norm());
  return nearest;
}

// Distance of the nearer hand of `who` from the other's chest. [m]
double hand_to_chest(const HumanMotion& who, const HumanMotion& other, int t) {
  const Eigen::Vector3d target = chest(other, t);
  return std::min((who.joints.at(t, kLeftHand) - target).norm(), (who.joints.at(t, kRightHand) - target).norm());
}

// How much of the way between the two pelvises the nearest hands cover. [m]
double covered_gap(const HumanMotion& a, const HumanMotion& b, int t) {
  return (a.joints.at(t, kPelvis) - b.joints.at(t, kPelvis)).norm() - hand_distance(a, b, t);
}

// Height of the higher hand above the pelvis. [m]
double hand_rise(const HumanMotion& who, int t) {
  return std::max(who.joints.at(t, kLeftHand).z(), who.joints.at(t, kRightHand).z()) - who.joints.at(t, kPelvis).z();
}

// Angle of the trunk from vertical. [rad]
double lean(const HumanMotion& who, int t) {
  const Eigen::Vector3d trunk = who.joints.at(t, kNeck) - who.joints.at(t, kPelvis);
  return std::atan2(trunk.head<2>().norm(), trunk.z());
}

template <typename F>
Signal over_time(int frames, F&& value) {
  Signal signal(frames);
  for (int t = 0; t < frames; ++t) signal[t] = value(t);
  return signal;
}

double rest_level(Signal signal) {
  const auto rest = signal.begin() + static_cast<std::ptrdiff_t>(kRestQuantile * (signal.size() - 1));
  std::nth_element(signal.begin(), rest, signal.end());
  return *rest;
}

// The act is where `signal` is above the thresholds around its peak; it begins earlier where `onset` says so.
struct Activity {
  Signal signal;
  double begin_threshold = 0.0;
  double end_threshold = 0.0;
  double gap = 0.0;  // [s]
  Signal onset;
  double onset_threshold = 0.0;
  bool found = false;  // the signal moves enough to call its peak an act
};

// From 0 at rest to 1 at the peak; all 0 where the range is smaller than `least`.
Signal share(const Signal& signal, double least) {
  const double rest = rest_level(signal);
  const double range = *std::max_element(signal.begin(), signal.end()) - rest;
  Signal result(signal.size(), 0.0);
  if (range >= least)
    std::transform(signal.begin(), signal.end(), result.begin(), [&](double x) { return (x - rest) / range; });
  return result;
}

// The larger signal of the two people, each measured by the own peak.
Signal either(const Signal& a, const Signal& b, double least) {
  Signal result = share(a, least);
  const Signal other = share(b, least);
  std::transform(result.begin(), result.end(), other.begin(), result.begin(),
                 [](double x, double y) { return std::max(x, y); });
  return result;
}

Signal hands_up(const HumanMotion& a, const HumanMotion& b) {
  return either(over_time(a.frames(), [&](int t) { return hand_rise(a, t); }),
                over_time(b.frames(), [&](int t) { return hand_rise(b, t); }), kLeastHandRise);
}

Activity contact(Signal distance, Signal onset, double onset_threshold) {
  for (double& value : distance) value = -value;
  const double edge = *std::max_element(distance.begin(), distance.end()) - kReach;
  return {.signal = std::move(distance),
          .begin_threshold = edge,
          .end_threshold = edge,
          .gap = kClaspGap,
          .onset = std::move(onset),
          .onset_threshold = onset_threshold,
          .found = true};
}

Activity gesture(Signal signal, double begin_share, double end_share) {
  const bool found = *std::max_element(signal.begin(), signal.end()) > 0.0;
  return {.signal = std::move(signal),
          .begin_threshold = begin_share,
          .end_threshold = end_share,
          .gap = kGestureGap,
          .onset = {},
          .onset_threshold = 0.0,
          .found = found};
}

// The onset of a contact, where the task reaches for it: its signal and threshold.
std::pair<Signal, double> onset_of(const HumanMotion& a, const HumanMotion& b, OnsetSignal onset) {
  switch (onset) {
    case OnsetSignal::kHandsCoverTheGap:
      return {share(over_time(a.frames(), [&](int t) { return covered_gap(a, b, t); }), kReach), kCoveredShare};
    case OnsetSignal::kHandsUp:
      return {hands_up(a, b), kRaisedShare};
    case OnsetSignal::kNone:
      break;
  }
  return {{}, 0.0};
}

Activity activity_of(const HumanMotion& a, const HumanMotion& b, const PhaseSignal& signal) {
  const auto over = [&](auto&& value) { return over_time(a.frames(), value); };
  auto [onset, threshold] = onset_of(a, b, signal.onset);
  switch (signal.act) {
    case ActSignal::kHandsTogether:
      return contact(over([&](int t) { return hand_distance(a, b, t); }), std::move(onset), threshold);
    case ActSignal::kHandAtChest:
      return contact(over([&](int t) { return std::min(hand_to_chest(a, b, t), hand_to_chest(b, a, t)); }),
                     std::move(onset), threshold);
    case ActSignal::kHandsUp:
      return gesture(hands_up(a, b), kRaisedShare, kLoweredShare);
    case ActSignal::kTrunksLean:
      return gesture(
          either(over([&](int t) { return lean(a, t); }), over([&](int t) { return lean(b, t); }), kLeastLean),
          kLeanShare, kLeanShare);
  }
  return {};
}

// The last frame from `from` in direction `step` (-1 or 1) at or above the threshold, without a gap of more than `gap`
// frames.
int reach(const Signal& signal, int from, int step, double threshold, int gap) {
  int edge = from;
  for (int t = from; t >= 0 && t < static_cast<int>(signal.size()) && std::abs(t - edge) <= gap + 1; t += step)
    if (signal[t] >= threshold) edge = t;
  return edge;
}

Phases stretch(const Activity& activity, double rate_hz) {
  const auto frames = [&](double seconds) { return static_cast<int>(seconds * rate_hz); };
  const Signal& signal = activity.signal;
  const int peak = static_cast<int>(std::max_element(signal.begin(), signal.end()) - signal.begin());
  const int begin = reach(signal, peak, -1, activity.begin_threshold, frames(activity.gap));
  const int end = reach(signal, peak, 1, activity.end_threshold, frames(activity.gap));
  return {.act_begin = reach(activity.onset, begin, -1, activity.onset_threshold, frames(kOnsetGap)),
          .act_end = end + 1};
}

}  // namespace

Phases propose_phases(const HumanMotion& a, const HumanMotion& b, Task task) {
  require(a.joints.points() == kSmplJoints && b.joints.points() == kSmplJoints,
          "phase proposal: expected {} joints, found {} and {}", kSmplJoints, a.joints.points(), b.joints.points());
  require(a.frames() == b.frames() && a.frames() >= 1,
          "phase proposal: expected two motions of the same length, found {} and {} frames", a.frames(), b.frames());
  const Activity activity = activity_of(a, b, definition_of(task).phases);
  if (!activity.found) return {.act_begin = a.frames() / 3, .act_end = std::max(a.frames() - a.frames() / 3, 1)};
  return stretch(activity, a.rate_hz);
}

}  // namespace duet
