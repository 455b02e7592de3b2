#include "duet/motion/people/made_up.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/motion/people/people_detection.h"
#include "duet/motion/plausibility.h"
#include "duet/motion/synthesis/stage.h"
#include "duet/tasks/synthesis/posed_body.h"

namespace duet {
namespace {

constexpr double kUsualDistance = 1.0;  // of two people whose task has none [m]
constexpr std::array<std::string_view, 4> kMadeUpKinds = {"gaps", "legs", "partner", "rate"};

using Frames = std::vector<SmplFrame>;

// The average body, standing straight: the 24 joints, arms hanging. x forward, y left, z up, origin on the floor. [m]
SmplFrame standing_body() {
  const synthesis::Body body = synthesis::make_body(kAverageStature, {});
  SmplFrame p = SmplFrame::Zero();
  p(2, kPelvis) = body.ankle_height() + body.leg() - body.offset[kLeftHip].z();
  for (int j = 1; j < kSmplJoints; ++j) {
    const bool is_arm = j >= kLeftElbow && j <= kRightHand;
    const Eigen::Vector3d& bone = body.offset[j];
    p.col(j) = p.col(kSmplParents[j]) + (is_arm ? Eigen::Vector3d(-bone.norm() * Eigen::Vector3d::UnitZ()) : bone);
  }
  return p;
}

Eigen::Vector3d middle(const SmplFrame& p, SmplJoint left, SmplJoint right) {
  return 0.5 * (p.col(left) + p.col(right));
}

double arm_length(const SmplFrame& p) {
  const auto arm = [&](SmplJoint shoulder, SmplJoint elbow, SmplJoint wrist) {
    return (p.col(elbow) - p.col(shoulder)).norm() + (p.col(wrist) - p.col(elbow)).norm();
  };
  return 0.5 * (arm(kLeftShoulder, kLeftElbow, kLeftWrist) + arm(kRightShoulder, kRightElbow, kRightWrist));
}

double unit_by_arms(const RawPeople& people, const std::array<Frames, 2>& frames, const PeopleOptions& options) {
  if (options.metres_per_unit) return *options.metres_per_unit;
  if (people.metres_per_unit) return *people.metres_per_unit;
  double length = 0.0;
  for (const Frames& person : frames) {
    std::vector<double> lengths;
    for (const SmplFrame& p : person) lengths.push_back(arm_length(p));
    length += 0.5 * quantile(std::move(lengths), 0.5);
  }
  const double average = arm_length(standing_body()), widest = std::sqrt(kTallestPerson / kShortestPerson);
  for (const LengthUnit& unit : kLengthUnits)
    if (const double ratio = unit.metres * length / average; ratio >= 1.0 / widest && ratio <= widest)
      return unit.metres;
  throw InputError(fmt::format(
      "'{}': cannot tell the unit of length: the arms measure {:.4g} units from shoulder to wrist, which is "
      "{:.2f} to {:.2f} m in none of metre, CMU unit, inch, centimetre, millimetre; state the metres per unit",
      excerpt(people.name), length, average / widest, average * widest));
}

// From where the elbows are to the head, mean over both people.
Eigen::Vector3d mean_up(const std::array<Frames, 2>& frames) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Frames& person : frames)
    for (const SmplFrame& p : person)
      sum += (p.col(kHead) - middle(p, kLeftElbow, kRightElbow)).normalized() / static_cast<double>(2 * person.size());
  return sum;
}

// The legs of both people, below what is known of them.
class LegMaker {
 public:
  LegMaker(RawPeople& people, const PeopleOptions& options) : people_(people), layout_(*people.layout) {
    const int in_file = static_cast<int>(layout_.names.size()) - layout_.made_up;
    anchor_ = column_of(kLeftHip) < in_file ? kLeftHip : column_of(kPelvis) < in_file ? kPelvis : kNeck;
    for (const std::size_t who : {0U, 1U}) widen(who, in_file);
    R_ = rotation_of(find_up(people, mean_up(frames_), "elbows", options).value);
    const double unit = unit_by_arms(people, frames_, options);
    body_ = standing_body() / unit;
    for (const std::size_t who : {0U, 1U}) {
      std::vector<double> heights;
      for (SmplFrame& p : frames_[who]) p = R_ * p, heights.push_back(anchor_in(p).z());
      stands_[who] = quantile(std::move(heights), 0.5);
    }
    floor_ = options.floor ? *options.floor / unit : 0.5 * (stands_[0] + stands_[1]) - anchor_in(body_).z();
  }

  void make() {
    for (const std::size_t who : {0U, 1U}) {
      Eigen::Vector3d left = Eigen::Vector3d::UnitY();
      for (std::size_t t = 0; t < frames_[who].size(); ++t) {
        const SmplFrame& p = frames_[who][t];
        Eigen::Vector3d across = p.col(kLeftShoulder) - p.col(kRightShoulder);
        across.z() = 0.0;
        if (across.norm() > 0.0) left = across.normalized();
        for (const int side : {0, 1}) make_leg(who, static_cast<int>(t), side, hip_of(who, p, side, left));
      }
    }
  }

  [[nodiscard]] std::string sentence() const {
    return fmt::format(
        "legs: made up, straight, of an average body of {:.2f} m, below the {}, facing as the shoulders do; the floor "
        "is "
        "where they end",
        kAverageStature,
        anchor_ == kLeftHip  ? "hips"
        : anchor_ == kPelvis ? "pelvis"
                             : "neck");
  }

 private:
  [[nodiscard]] int column_of(SmplJoint joint) const { return layout_.smpl[joint].parts.front().column; }
  static int sided(SmplJoint joint, int side) { return side == 0 ? static_cast<int>(joint) : kSmplMirror[joint]; }

  // Columns for the legs, and the joints that do not hang on them, both as the file has its axes.
  void widen(std::size_t who, int in_file) {
    PointTracks wide(people_.joints[who].frames(), static_cast<int>(layout_.names.size()));
    for (int t = 0; t < wide.frames(); ++t) {
      wide.frame(t).leftCols(in_file) = people_.joints[who].frame(t);
      make_smpl(layout_, std::as_const(wide).frame(t), false, frames_[who].emplace_back());
    }
    people_.joints[who] = std::move(wide);
  }

  [[nodiscard]] Eigen::Vector3d anchor_in(const SmplFrame& p) const {
    return anchor_ == kLeftHip ? middle(p, kLeftHip, kRightHip) : Eigen::Vector3d(p.col(anchor_));
  }

  // A neck that bows leaves the hips where they are.
  [[nodiscard]] Eigen::Vector3d hip_of(std::size_t who, const SmplFrame& p, int side,
                                       const Eigen::Vector3d& left) const {
    if (anchor_ == kLeftHip) return p.col(sided(kLeftHip, side));
    Eigen::Vector3d hip = anchor_in(p) + body_(1, sided(kLeftHip, side)) * left;
    if (anchor_ == kNeck) hip.z() = stands_[who];
    hip.z() -= body_(2, anchor_) - body_(2, kLeftHip);
    return hip;
  }

  void make_leg(std::size_t who, int t, int side, const Eigen::Vector3d& hip) {
    const double way = floor_ + body_(2, kLeftAnkle) - hip.z();
    const double knee = (body_(2, kLeftHip) - body_(2, kLeftKnee)) / (body_(2, kLeftHip) - body_(2, kLeftAnkle));
    for (const auto& [joint, share] : {std::pair{kLeftHip, 0.0}, {kLeftKnee, knee}, {kLeftAnkle, 1.0}})
      if (joint != anchor_)
        people_.joints[who].at(t, layout_.smpl[sided(joint, side)].parts.front().column) =
            R_.transpose() * (hip + share * way * Eigen::Vector3d::UnitZ());
  }

  RawPeople& people_;
  const JointLayout& layout_;
  SmplJoint anchor_;              // the lowest that is known
  std::array<Frames, 2> frames_;  // up along z, in the file's unit
  Eigen::Matrix3d R_;
  SmplFrame body_;                // in that unit
  std::array<double, 2> stands_;  // the usual height of each anchor
  double floor_ = 0.0;
};

}  // namespace

std::string add_legs(RawPeople& people, const PeopleOptions& options) {
  LegMaker legs(people, options);
  legs.make();
  return legs.sentence();
}

HumanMotion still_partner(const HumanMotion& person, Task task) {
  Eigen::Vector2d ahead = Eigen::Vector2d::Zero();
  for (int t = 0; t < person.frames(); ++t) ahead += synthesis::towards(heading(person.joints, t));
  const double yaw = std::atan2(ahead.y(), ahead.x());
  ahead = synthesis::towards(yaw);
  const Eigen::Vector2d left(-ahead.y(), ahead.x());
  double farthest = -std::numeric_limits<double>::infinity();  // he does not walk through the partner
  std::vector<double> aside;
  for (int t = 0; t < person.frames(); ++t) {
    const Eigen::Vector2d root = person.joints.at(t, kPelvis).head<2>();
    farthest = std::max(farthest, root.dot(ahead));
    aside.push_back(root.dot(left));
  }
  const double usual = synthesis::manner_of(task, Likeness::kVaried).distance.middle;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  place.head<2>() = (farthest + (usual > 0.0 ? usual : kUsualDistance)) * ahead + quantile(aside, 0.5) * left;
  const Eigen::Matrix3d R = Eigen::AngleAxisd(yaw + std::numbers::pi, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const SmplFrame stands = (R * standing_body()).colwise() + place;
  HumanMotion motion{.rate_hz = person.rate_hz, .joints = PointTracks(person.frames(), kSmplJoints), .rotations = {}};
  for (int t = 0; t < motion.frames(); ++t) motion.joints.frame(t) = stands;
  return motion;
}

void put_made_up(const MadeUp& shares, std::map<std::string, std::string>& source) {
  for (const auto& [kind, share] : shares) source[std::string(kMadeUpKey) + kind] = fmt::format("{:.4g}", share);
}

MadeUp made_up_of(const std::map<std::string, std::string>& source) {
  MadeUp shares;
  for (const std::string_view kind : kMadeUpKinds)
    if (const auto found = source.find(std::string(kMadeUpKey).append(kind)); found != source.end())
      shares.emplace(kind, parse_number(found->second).value_or(1.0));
  return shares;
}

std::string made_up_kinds(const std::map<std::string, std::string>& source) {
  std::string kinds;
  for (const auto& [kind, share] : made_up_of(source)) kinds += (kinds.empty() ? "" : "+") + kind;
  return kinds;
}

}  // namespace duet
