#include "duet/people/body_people.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <utility>

#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/motion/human_motion.h"
#include "duet/people/bodies/body_model.h"

namespace duet {
namespace {

void check_clock(const std::array<BodyMotion, 2>& people) {
  const auto& [a, b] = people;
  if (a.frames() != b.frames())
    throw InputError(fmt::format("'{}' has {} frames and '{}' {}: expected two people of the same length",
                                 excerpt(a.file), a.frames(), excerpt(b.file), b.frames()));
  if (a.frames() < 2)
    throw InputError(fmt::format("'{}': expected at least 2 frames, found {}", excerpt(a.file), a.frames()));
}

void pose(RawPeople& raw, std::size_t who, BodyMotion motion, const BodyModel& model) {
  raw.joints[who] = pose_motion(motion, model);
  raw.rotations[who] = std::move(motion.local);
}

std::string name_of(const std::string& path) { return std::filesystem::path(path).filename().string(); }

}  // namespace

BodyMotion body_motion(const std::string& file, const NumberTable& root, const NumberTable& body,
                       const NumberTable& translation) {
  const int frames = checked_rows(root, {3}, "(T, 3)").rows();
  checked_rows(body, {63, 69}, "(T, 63), (T, 21, 3), (T, 69) or (T, 23, 3)", frames);
  checked_rows(translation, {3}, "(T, 3)", frames);
  const std::size_t joints = body.values.size() / static_cast<std::size_t>(frames) / 3;
  BodyMotion motion{.file = file};
  motion.local.assign(static_cast<std::size_t>(frames) * kSmplJoints, Eigen::Quaterniond::Identity());
  motion.translation.resize(static_cast<std::size_t>(frames));
  for (std::size_t t = 0; t < motion.translation.size(); ++t) {
    motion.translation[t] = Eigen::Map<const Eigen::Vector3d>(&translation.values[3 * t]);
    Eigen::Quaterniond* local = &motion.local[t * kSmplJoints];
    local[kPelvis] = rotation_of_vector(Eigen::Map<const Eigen::Vector3d>(&root.values[3 * t]));
    const double* turns = &body.values[3 * joints * t];
    for (std::size_t j = 0; j < joints; ++j)
      local[j + 1] = rotation_of_vector(Eigen::Map<const Eigen::Vector3d>(turns + 3 * j));
  }
  return motion;
}

PointTracks pose_motion(BodyMotion& motion, const BodyModel& model) {
  const RestJoints rest = rest_joints(model, motion.betas);
  PointTracks joints(motion.frames(), kSmplJoints);
  for (int t = 0; t < motion.frames(); ++t)
    pose_body(rest, motion.translation[static_cast<std::size_t>(t)],
              std::span(motion.local).subspan(static_cast<std::size_t>(t) * kSmplJoints, kSmplJoints), joints.frame(t));
  return joints;
}

std::vector<double> mean_betas(const NumberTable& betas) {
  const std::size_t rows = betas.shape.size() < 2 ? 1 : std::max<std::size_t>(betas.shape.front(), 1);
  const std::size_t count = betas.values.size() / rows;
  std::vector<double> mean(count, 0.0);
  for (std::size_t i = 0; i < rows * count; ++i) mean[i % count] += betas.values[i] / static_cast<double>(rows);
  return mean;
}

void add_people(RawPeople& raw, BodyPeople people, const PeopleOptions& options) {
  check_clock(people.people);
  auto& [a, b] = people.people;
  if (people.apart && options.align == Alignment::kNone)
    throw InputError(
        fmt::format("'{}', '{}': each person was recorded in a world of its own: state how they come into "
                    "one (align floor, align contact)",
                    excerpt(a.file), excerpt(b.file)));
  const BodyModel model = options.body_model.empty() ? average_body() : load_body_model(options.body_model);
  raw.layout = &joint_layout("smpl-24");
  raw.source["format"] = people.format;
  raw.source["file_a"] = name_of(a.file);
  raw.source["file_b"] = name_of(b.file);
  raw.source["body_model"] = model.kind.empty() ? "none: average skeleton" : model.kind;
  if (!people.licence.empty()) raw.source["licence"] = people.licence;
  raw.evidence.push_back(model.note);
  pose(raw, 0, std::move(a), model);
  pose(raw, 1, std::move(b), model);
  if (people.apart) align_people(raw, options);
}

namespace {

constexpr double kFloorPart = 0.05;                // of the frames, in which the lower toe may be below the floor
constexpr double kNearest = 0.2, kFarthest = 2.5;  // plausible least distance of two pelvises [m]
constexpr double kFacingDistance = 0.8;            // of two people who talk: an arm's length and a little [m]
constexpr double kMeetingTime = 0.1;               // before and after the frame in which hands meet [s]
constexpr double kMostHeightGap = 0.3;             // of hands that are said to meet [m]
constexpr double kUsualRate = 30.0;                // where the file does not say [Hz]
constexpr std::array<const char*, 2> kHandNames = {"left", "right"};

std::string axis_text(const Eigen::Vector3d& up) {
  Eigen::Index axis = 0;
  up.cwiseAbs().maxCoeff(&axis);
  return fmt::format("{}{}", up[axis] < 0.0 ? '-' : '+', "xyz"[axis]);
}

Eigen::Vector3d unit_of(Axis axis) {
  const int index = static_cast<int>(axis);  // +x, -x, +y, -y, +z, -z
  return (index % 2 == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(index / 2);
}

// The axis nearest to the mean direction from ankles to head.
Eigen::Vector3d up_in_data(const RawPeople& raw) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const PointTracks& joints : raw.joints)
    for (int t = 0; t < joints.frames(); ++t)
      sum += joints.at(t, kHead) - 0.5 * (joints.at(t, kLeftAnkle) + joints.at(t, kRightAnkle));
  Eigen::Index axis = 0;
  sum.cwiseAbs().maxCoeff(&axis);
  return (sum[axis] < 0.0 ? -1.0 : 1.0) * Eigen::Vector3d::Unit(axis);
}

// Both people in axes with z up [m].
struct Levelled {
  Eigen::Matrix3d R_LF;
  double metres_per_unit = 1.0;
  std::array<PointTracks, 2> people;
};

Levelled level(const RawPeople& raw, const Eigen::Vector3d& up, double metres_per_unit) {
  Levelled out{.R_LF = Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
               .metres_per_unit = metres_per_unit,
               .people = raw.joints};
  for (PointTracks& joints : out.people)
    for (int t = 0; t < joints.frames(); ++t) joints.frame(t) = metres_per_unit * (out.R_LF * joints.frame(t)).eval();
  return out;
}

double floor_of(const PointTracks& joints) {
  std::vector<double> heights;
  for (int t = 0; t < joints.frames(); ++t)
    heights.push_back(std::min(joints.at(t, kLeftToe).z(), joints.at(t, kRightToe).z()));
  const auto place = heights.begin() + static_cast<std::ptrdiff_t>(kFloorPart * static_cast<double>(heights.size()));
  std::nth_element(heights.begin(), place, heights.end());
  return *place;
}

double least_distance(const Levelled& levelled) {
  double least = std::numeric_limits<double>::infinity();
  for (int t = 0; t < levelled.people[0].frames(); ++t)
    least = std::min(least, (levelled.people[0].at(t, kPelvis) - levelled.people[1].at(t, kPelvis)).head<2>().norm());
  return least;
}

double heading_at(const RawPeople& raw, const PointTracks& joints, int t) {
  try {
    return heading(joints, t);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("'{}': alignment: {}", excerpt(raw.name), error.what()));
  }
}

// X such that p' = X p turns B at frame t to face A (about its own pelvis).
Pose facing(const RawPeople& raw, const Levelled& levelled, int t) {
  const double yaw = heading_at(raw, levelled.people[0], t) + std::numbers::pi - heading_at(raw, levelled.people[1], t);
  const Eigen::Quaterniond R = yaw_rotation(yaw);
  const Eigen::Vector3d pelvis = levelled.people[1].at(t, kPelvis);
  return {R, pelvis - R * pelvis};
}

void add_height(const Levelled& levelled, Pose& X) {
  X.p.z() += floor_of(levelled.people[0]) - floor_of(levelled.people[1]);
}

Pose floor_pose(const RawPeople& raw, const Levelled& levelled, std::string& sentence) {
  Pose X;
  const double distance = least_distance(levelled);
  if (distance >= kNearest && distance <= kFarthest) {
    sentence = fmt::format("level, they stay where the files have them: pelvises come to {:.2f} m", distance);
  } else {
    const int t = levelled.people[0].frames() / 2;
    X = facing(raw, levelled, t);
    const double ahead = heading_at(raw, levelled.people[0], t);
    const Eigen::Vector3d place = Eigen::Vector3d(levelled.people[0].at(t, kPelvis)) +
                                  kFacingDistance * Eigen::Vector3d(std::cos(ahead), std::sin(ahead), 0.0);
    X.p.head<2>() += (place - levelled.people[1].at(t, kPelvis)).head<2>();
    sentence = fmt::format(
        "the files have their pelvises {:.2f} m apart at the least, which no two people are who "
        "interact: B faces A at {:.1f} m in frame {}",
        distance, kFacingDistance, t);
  }
  add_height(levelled, X);
  return X;
}

// How far a hand is in front of its owner's pelvis, level [m].
double reach_ahead(const PointTracks& joints, int t, int hand, double yaw) {
  const Eigen::Vector3d arm = joints.at(t, hand) - joints.at(t, kPelvis);
  return std::cos(yaw) * arm.x() + std::sin(yaw) * arm.y();
}

struct Meeting {
  int frame = 0;
  int hand_a = kRightHand, hand_b = kRightHand;
  double gap = 0.0;  // of their heights over each one's floor [m]
};

Meeting find_meeting(const RawPeople& raw, const Levelled& levelled) {
  const auto& [a, b] = levelled.people;
  const double floors = floor_of(a) - floor_of(b);
  Meeting best;
  double best_score = -std::numeric_limits<double>::infinity();
  for (int t = 0; t < a.frames(); ++t) {
    const double yaw_a = heading_at(raw, a, t), yaw_b = heading_at(raw, b, t);
    for (const int hand_a : {kLeftHand, kRightHand})
      for (const int hand_b : {kLeftHand, kRightHand}) {
        const double gap = a.at(t, hand_a).z() - b.at(t, hand_b).z() - floors;
        const double score = reach_ahead(a, t, hand_a, yaw_a) + reach_ahead(b, t, hand_b, yaw_b) - 2.0 * std::abs(gap);
        if (score <= best_score) continue;
        best_score = score;
        best = {.frame = t, .hand_a = hand_a, .hand_b = hand_b, .gap = gap};
      }
  }
  return best;
}

Pose contact_pose(const RawPeople& raw, const Levelled& levelled, std::string& sentence) {
  const Meeting meeting = find_meeting(raw, levelled);
  if (std::abs(meeting.gap) > kMostHeightGap)
    throw InputError(
        fmt::format("'{}': align contact: expected hands that can meet, found them {:.2f} m apart in height "
                    "at best (frame {}); align floor asks for no contact",
                    excerpt(raw.name), std::abs(meeting.gap), meeting.frame));
  Pose X = facing(raw, levelled, meeting.frame);
  const double rate_hz = raw.rate_hz > 0.0 ? raw.rate_hz : kUsualRate;
  const int half = static_cast<int>(std::lround(kMeetingTime * rate_hz));
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  int count = 0;
  for (int t = std::max(0, meeting.frame - half); t <= std::min(levelled.people[0].frames() - 1, meeting.frame + half);
       ++t, ++count)
    shift += levelled.people[0].at(t, meeting.hand_a) - X * Eigen::Vector3d(levelled.people[1].at(t, meeting.hand_b));
  X.p.head<2>() += shift.head<2>() / count;
  add_height(levelled, X);
  sentence =
      fmt::format("B is turned and moved so that A's {} and B's {} hand meet in frame {}, {:.0f} cm apart in height",
                  kHandNames[meeting.hand_a - kLeftHand], kHandNames[meeting.hand_b - kLeftHand], meeting.frame,
                  100.0 * std::abs(meeting.gap));
  return X;
}

void move_b(RawPeople& raw, const Levelled& levelled, const Pose& X) {
  const Eigen::Matrix3d R = levelled.R_LF.transpose() * X.R.toRotationMatrix() * levelled.R_LF;
  const Eigen::Vector3d p = levelled.R_LF.transpose() * X.p / levelled.metres_per_unit;
  for (int t = 0; t < raw.joints[1].frames(); ++t)
    raw.joints[1].frame(t) = (R * raw.joints[1].frame(t)).eval().colwise() + p;
  const Eigen::Quaterniond turn(R);
  for (Eigen::Quaterniond& rotation : raw.rotations[1]) rotation = turn * rotation;
}

}  // namespace

void align_people(RawPeople& raw, const PeopleOptions& options) {
  require(options.align != Alignment::kNone, "align_people: expected an alignment, found none");
  const std::optional<Axis> known = options.up ? options.up : raw.up;
  const Eigen::Vector3d up = known ? unit_of(*known) : up_in_data(raw);
  const double unit = options.metres_per_unit.value_or(raw.metres_per_unit.value_or(1.0));
  const Levelled levelled = level(raw, up, unit);
  std::string sentence;
  const bool floor = options.align == Alignment::kFloor;
  const Pose X = floor ? floor_pose(raw, levelled, sentence) : contact_pose(raw, levelled, sentence);
  move_b(raw, levelled, X);
  raw.evidence.push_back(
      fmt::format("alignment: {} ({} up): one floor; {}", floor ? "floor" : "contact", axis_text(up), sentence));
  raw.source["provenance"] = "estimated shared frame";
  raw.source["alignment"] = floor ? "floor" : "contact";
}

}  // namespace duet
