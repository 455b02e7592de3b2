#include "duet/motion/plausibility.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "duet/archives/npy/npz.h"
#include "duet/core/require.h"

namespace duet {
namespace {

// In 282 recordings of two people (SBU) the mean upright lies within 8.6 degrees of vertical in nine of ten once the
// camera's tilt is removed, and 9.5 degrees off on average before.
constexpr double kOddTilt = 10.0 * std::numbers::pi / 180.0;  // [rad] of both people's mean upright
constexpr double kOddFloor = 0.15;                            // [m]
constexpr double kWrongFloor = 0.5;                           // [m] no shoe, step or noise explains it
constexpr double kBackwards = -0.3;      // mean cosine of the toes with the heading; people's are above 0.8
constexpr double kLeastToe = 0.02;       // a toe that is level with its ankle says nothing [m]
constexpr double kOnePlace = 0.1;        // of two pelvises: no two people stand so, not even in a hug [m]
constexpr double kContactApart = 1.0;    // of two joints that are said to touch: more than a body is between them [m]
constexpr double kContactMissing = 3.0;  // the same: no reach, pose or step explains it [m]
constexpr double kFarApart = 6.0;        // of two people who act together [m]
constexpr double kAverted = -0.5;        // mean cosine of the heading with the way to the partner, in the act

using Person3 = PointTracks::ConstFrame;

// Horizontal, unit; none where hips and shoulders have no horizontal line.
std::optional<Eigen::Vector2d> forward(const Person3& p) {
  const Eigen::Vector2d left =
      (p.col(kLeftHip) - p.col(kRightHip) + p.col(kLeftShoulder) - p.col(kRightShoulder)).head<2>();
  if (left.norm() < 1e-3) return std::nullopt;
  return Eigen::Vector2d(left.y(), -left.x()) / left.norm();
}

// Mean over frames of what is known in a frame.
template <typename Value>
std::optional<double> mean(int begin, int end, Value&& value) {
  double sum = 0.0;
  int count = 0;
  for (int t = begin; t < end; ++t) {
    const std::optional<double> known = value(t);
    if (!known) continue;
    sum += *known;
    ++count;
  }
  return count > 0 ? std::optional(sum / count) : std::nullopt;
}

// Cosine of the feet's direction with the heading.
std::optional<double> toes_ahead(const HumanMotion& person, int t) {
  const Person3 p = person.joints.frame(t);
  const std::optional<Eigen::Vector2d> ahead = forward(p);
  const Eigen::Vector2d foot = (p.col(kLeftToe) - p.col(kLeftAnkle) + p.col(kRightToe) - p.col(kRightAnkle)).head<2>();
  if (!ahead || foot.norm() < kLeastToe) return std::nullopt;
  return foot.dot(*ahead) / foot.norm();
}

// Cosine of the heading with the way to the partner.
std::optional<double> faces(const HumanMotion& person, const HumanMotion& partner, int t) {
  const std::optional<Eigen::Vector2d> ahead = forward(person.joints.frame(t));
  const Eigen::Vector2d way = (partner.joints.at(t, kPelvis) - person.joints.at(t, kPelvis)).head<2>();
  if (!ahead || way.norm() < 1e-3) return std::nullopt;
  return way.dot(*ahead) / way.norm();
}

Eigen::Vector3d mean_upright(const HumanMotion& person) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int t = 0; t < person.frames(); ++t) {
    const Person3 p = person.joints.frame(t);
    sum += (p.col(kHead) - 0.5 * (p.col(kLeftAnkle) + p.col(kRightAnkle))).normalized();
  }
  return sum / person.frames();
}

// Median over frames of the lowest toe or ankle. [m]
double floor_height(const HumanMotion& person) {
  std::vector<double> lowest(person.frames());
  for (int t = 0; t < person.frames(); ++t) {
    const Person3 p = person.joints.frame(t);
    lowest[t] = std::min({p(2, kLeftToe), p(2, kRightToe), p(2, kLeftAnkle), p(2, kRightAnkle)});
  }
  const auto middle = lowest.begin() + person.frames() / 2;
  std::nth_element(lowest.begin(), middle, lowest.end());
  return *middle;
}

void judge_stature(const char* who, const HumanMotion& person, Plausibility& found) {
  const double length = stature(person);
  if (kShortestPerson <= length && length <= kTallestPerson) return;
  std::string unit;
  for (const LengthUnit& candidate : kLengthUnits)
    if (kShortestPerson <= length * candidate.metres && length * candidate.metres <= kTallestPerson)
      unit = fmt::format("; the unit may be the {}", candidate.name);
  found.faults.push_back(fmt::format("person {} measures {:.4g} m from head to ankle, expected {} to {} m{}", who,
                                     length, kShortestPerson, kTallestPerson, unit));
}

void judge_up_axis(const InteractionClip& clip, Plausibility& found) {
  const Eigen::Vector3d up = 0.5 * (mean_upright(clip.a) + mean_upright(clip.b));
  const std::string along =
      fmt::format("heads are above ankles along ({:.2f}, {:.2f}, {:.2f})", up.x(), up.y(), up.z());
  if (up.z() < kUprightCosine) {
    found.faults.push_back(fmt::format("{}, expected z up{}", along, up.y() >= kUprightCosine ? ", found y up" : ""));
    return;
  }
  const double tilt = std::atan2(up.head<2>().norm(), up.z());
  if (tilt > kOddTilt)
    found.oddities.push_back(fmt::format("{}, {:.0f} degrees from vertical; a camera's tilt may be left in it", along,
                                         tilt * 180.0 / std::numbers::pi));
}

void judge_floor(const char* who, const HumanMotion& person, Plausibility& found) {
  const double height = floor_height(person);
  if (std::abs(height) <= kOddFloor) return;
  const std::string sentence = fmt::format("the feet of person {} are {:.2f} m {} the floor at z = 0", who,
                                           std::abs(height), height < 0.0 ? "under" : "above");
  (std::abs(height) > kWrongFloor ? found.faults : found.oddities).push_back(sentence);
}

void judge_sides(const char* who, const HumanMotion& person, Plausibility& found) {
  const auto ahead = mean(0, person.frames(), [&](int t) { return toes_ahead(person, t); });
  if (ahead && *ahead < kBackwards)
    found.faults.push_back(fmt::format(
        "the toes of person {} point backwards: left and right are exchanged, or the motion is a mirror image", who));
}

void judge_facing(const InteractionClip& clip, Plausibility& found) {
  const auto during_act = [&](const HumanMotion& person, const HumanMotion& partner) {
    return mean(clip.phases.act_begin, clip.phases.act_end, [&](int t) { return faces(person, partner, t); });
  };
  const auto a = during_act(clip.a, clip.b), b = during_act(clip.b, clip.a);
  if (a && b && *a < kAverted && *b < kAverted)
    found.oddities.push_back("the two turn their backs on one another during the act: left and right may be exchanged");
}

// Share of the frames in which both pelvises are at one place.
double share_at_one_place(const InteractionClip& clip) {
  int together = 0;
  for (int t = 0; t < clip.frames(); ++t)
    together += (clip.a.joints.at(t, kPelvis) - clip.b.joints.at(t, kPelvis)).norm() < kOnePlace ? 1 : 0;
  return static_cast<double>(together) / clip.frames();
}

// How near the joints of an annotated contact come. [m]
double nearest(const InteractionClip& clip, const ContactWindow& window) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int t = window.begin; t < window.end; ++t)
    nearest = std::min(nearest, (clip.a.joints.at(t, window.joint_a) - clip.b.joints.at(t, window.joint_b)).norm());
  return nearest;
}

void judge_distance(const InteractionClip& clip, Plausibility& found) {
  if (share_at_one_place(clip) > 0.5)
    found.faults.push_back(fmt::format(
        "the two people are at one place: their pelvises are within {} m of one another in {:.0f} % of the frames",
        kOnePlace, 100.0 * share_at_one_place(clip)));
  for (const ContactWindow& window : clip.contacts) {
    const double gap = nearest(clip, window);
    if (gap < kContactApart) continue;
    (gap < kContactMissing ? found.oddities : found.faults)
        .push_back(fmt::format("{} of A and {} of B are said to touch in frames [{}, {}) and stay {:.4g} m apart",
                               kSmplNames[window.joint_a], kSmplNames[window.joint_b], window.begin, window.end, gap));
    return;
  }
  double apart = std::numeric_limits<double>::infinity();
  for (int t = 0; t < clip.frames(); ++t)
    apart = std::min(apart, (clip.a.joints.at(t, kPelvis) - clip.b.joints.at(t, kPelvis)).norm());
  if (apart > kFarApart)
    found.oddities.push_back(fmt::format("the two people never come nearer to one another than {:.4g} m", apart));
}

}  // namespace

double stature(const HumanMotion& person) {
  const std::array<double, kSmplJoints> bones = bone_lengths(person);
  double length = 0.0;
  for (int joint = kHead; joint != kPelvis; joint = kSmplParents[joint]) length += bones[joint];
  for (const int ankle : {kLeftAnkle, kRightAnkle})
    for (int joint = ankle; joint != kPelvis; joint = kSmplParents[joint]) length += 0.5 * bones[joint];
  return length;
}

Plausibility judge_people(const InteractionClip& clip) {
  Plausibility found;
  judge_up_axis(clip, found);
  judge_stature("A", clip.a, found);
  judge_stature("B", clip.b, found);
  if (!found.faults.empty()) return found;  // heights and sides mean nothing in another frame or unit
  judge_floor("A", clip.a, found);
  judge_floor("B", clip.b, found);
  judge_sides("A", clip.a, found);
  judge_sides("B", clip.b, found);
  judge_distance(clip, found);
  if (found.faults.empty()) judge_facing(clip, found);
  return found;
}

ImportedClip read_foreign_clip(const Npz& npz, Implausible implausible) {
  ImportedClip read{read_clip(npz), {}};
  const InteractionClip& clip = read.clip;
  const Plausibility found = judge_people(clip);
  const auto note = [&](const std::string& sentence) {
    read.notes.push_back(fmt::format("'{}': {}", npz.name(), sentence));
  };
  if (!found.faults.empty() && implausible == Implausible::kRefused)
    throw InputError(fmt::format("'{}': {} (--as-is of `duet retarget` and `duet score` takes the clip nevertheless)",
                                 npz.name(), found.faults.front()));
  if (!npz.contains("phases"))
    note(fmt::format("phases: act [{}, {}) of {} frames (proposed)", clip.phases.act_begin, clip.phases.act_end,
                     clip.frames()));
  for (const std::string& sentence : found.faults) note(sentence);
  for (const std::string& sentence : found.oddities) note(sentence);
  return read;
}

}  // namespace duet
