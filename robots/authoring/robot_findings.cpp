#include "duet/robots/authoring/robot_findings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "duet/core/recording.h"
#include "duet/robots/explicit_step.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

using enum CheckState;

constexpr double kLevel = 1.0,
                 kMostTilt = 8.0;      // of a sole: level; a maker's stance that leans (Berkeley's: 5.7) [deg]
constexpr double kEven = 2e-3;         // most that the two soles differ in height [m]
constexpr double kStanceError = 1e-2;  // most that a stance is from where the ankles are [m]
constexpr double kMirrored = 1e-6;     // most that two sides of a card differ
constexpr double kAllOfFall = 0.95;    // share of the standing height at which a fall is none
constexpr double kSidewards = 5e-3;    // least distance of a hand from the middle that has a side [m]
constexpr int kMostNamed = 4;          // joints in a sentence
constexpr std::size_t kTracks = 6, kKeypoints = 9, kPairs = 16;
constexpr std::pair<double, double> kPlausibleMass = {3.0, 200.0};  // [kg]

std::string named(const std::vector<std::string>& names) {
  const std::size_t shown = std::min(names.size(), static_cast<std::size_t>(kMostNamed));
  std::string text = fmt::format("{}", fmt::join(names.begin(), names.begin() + static_cast<long>(shown), ", "));
  if (names.size() > shown) text += fmt::format(" and {} more", names.size() - shown);
  return text;
}

std::string spread(double least, double most) {
  return least == most ? fmt::format("{:g}", least) : fmt::format("{:g} to {:g}", least, most);
}

// The findings of one robot, which stands in its neutral pose with its soles on the ground.
class Findings {
 public:
  explicit Findings(const RobotModel& robot) : robot_(robot), standing_(robot) {
    standing_.update(robot.standing_state().X_WB, robot.neutral);
  }

  std::vector<RobotFinding> all() {
    mass();
    limits();
    gains();
    sides();
    legs();
    soles();
    heights();
    balance();
    stance();
    upper_body();
    tracks();
    people();
    shapes();
    return std::move(found_);
  }

 private:
  void add(std::string part, CheckState state, std::string text, std::string next = "", bool stops = false) {
    found_.push_back({std::move(part), state, std::move(text), std::move(next), stops});
  }

  template <typename Field>
  [[nodiscard]] std::string range_of(Field field) const {
    const auto [least, most] = std::ranges::minmax_element(robot_.joints, {}, field);
    return spread(std::invoke(field, *least), std::invoke(field, *most));
  }

  template <typename Holds>
  [[nodiscard]] std::vector<std::string> joints_that(Holds holds) const {
    std::vector<std::string> names;
    for (int j = 0; j < robot_.dof(); ++j)
      if (holds(j)) names.push_back(robot_.joints[j].name);
    return names;
  }

  void mass() {
    const double total = robot_.total_mass();
    const bool plausible = total >= kPlausibleMass.first && total <= kPlausibleMass.second;
    add("mass", plausible ? kOk : kWrong,
        fmt::format("{:.3f} kg in {} bodies, {:.3f} kg of it the base", total, robot_.links.size(),
                    robot_.links[0].mass),
        plausible ? ""
                  : fmt::format("a humanoid has {:g} to {:g} kg: are the URDF's masses in kg?", kPlausibleMass.first,
                                kPlausibleMass.second));
  }

  void limits() {
    if (robot_.joints.empty())
      return add("limits", kMissing, "no joint moves", "move joints from 'locked' to 'joints'", true);
    const double effort = robot_.joints[0].effort;
    const bool same = robot_.dof() > 4 && std::ranges::all_of(robot_.joints, [&](const RobotJoint& joint) {
                        return joint.effort == effort;
                      });
    const std::vector<std::string> endless =
        joints_that([&](int j) { return robot_.joints[j].upper - robot_.joints[j].lower > 3.9 * std::numbers::pi; });
    std::string text =
        fmt::format("torque {} N m, speed {} rad/s", range_of(&RobotJoint::effort), range_of(&RobotJoint::velocity));
    if (!endless.empty()) text += fmt::format("; without an end: {}", named(endless));
    add("limits", same ? kNote : kOk, text,
        same ? "all torques are equal, as exports write them: set 'effort' where the maker says another" : "");
  }

  void gains() {
    if (robot_.joints.empty()) return;
    const std::vector<std::string> loose = joints_that([&](int j) { return robot_.joints[j].kp == 0.0; });
    if (!loose.empty())
      add("gains", kMissing, fmt::format("kp is 0 for {}", named(loose)),
          "give the kp and kd of the maker's training or deployment");
    const std::vector<std::string> bare = joints_that([&](int j) { return robot_.joints[j].armature == 0.0; });
    JointGains own{Eigen::VectorXd(robot_.dof()), Eigen::VectorXd(robot_.dof())};
    for (int j = 0; j < robot_.dof(); ++j) {
      own.kp[j] = robot_.joints[j].kp;
      own.kd[j] = robot_.joints[j].kd;
    }
    const ExplicitStep step = largest_explicit_step(robot_, robot_.standing_state(), own);
    add("gains", bare.empty() ? kOk : kNote,
        fmt::format("kp {} N m/rad, kd {} N m s/rad, armature {} kg m^2{}", range_of(&RobotJoint::kp),
                    range_of(&RobotJoint::kd), range_of(&RobotJoint::armature),
                    step.joint < 0 ? ""
                                   : fmt::format("; torques held over a step bear {:.2g} ms ({})", 1e3 * step.largest,
                                                 robot_.joints[step.joint].name)),
        bare.empty() ? "" : fmt::format("armature is 0 for {}: take it from the maker's training", named(bare)));
  }

  // Whether joints of the two sides have mirrored numbers.
  void sides() {
    std::vector<std::string> differ;
    for (const auto& limbs : {robot_.roles.legs, robot_.roles.arms})
      for (const int left : limbs[0])
        if (std::string what = difference(left); !what.empty()) differ.push_back(std::move(what));
    if (robot_.roles.legs[0].empty()) return;
    add("sides", differ.empty() ? kOk : kWrong,
        differ.empty() ? fmt::format("{} joints of a side mirror the other's gains, torques and neutral angles",
                                     robot_.roles.legs[0].size() + robot_.roles.arms[0].size())
                       : named(differ),
        differ.empty() ? "" : "a side has another number: a slip of the pen, or of the maker?");
  }

  [[nodiscard]] std::string difference(int left) const {
    const int right = robot_.roles.counterpart[left];
    const RobotJoint &a = robot_.joints[left], &b = robot_.joints[right];
    const double sign = mirror_sign(robot_, left);
    const std::array<std::tuple<const char*, double, double>, 5> numbers = {{
        {"kp", a.kp, b.kp},
        {"kd", a.kd, b.kd},
        {"armature", a.armature, b.armature},
        {"torque", a.effort, b.effort},
        {"neutral angle", robot_.neutral[left], sign * robot_.neutral[right]},
    }};
    for (const auto& [what, mine, others] : numbers)
      if (std::abs(mine - others) > kMirrored * std::max(1.0, std::abs(mine)))
        return fmt::format("{} of {} and {} ({:g}, {:g})", what, a.name, b.name, mine, others);
    return "";
  }

  void legs() {
    const auto& leg = robot_.roles.legs[0];
    if (leg.empty())
      return add("legs", kMissing, "none",
                 "name the joints of 'legs' from the hip to the ankle: vmc and falls need it");
    const Eigen::Vector3d hip = standing_.p_WL(leg.front() + 1), ankle = standing_.p_WL(leg.back() + 1);
    add("legs", kOk,
        fmt::format("{} joints each, hip {:.3f} m and ankle {:.3f} m over the soles", leg.size(), hip.z(), ankle.z()));
  }

  [[nodiscard]] double bottom_of(int shape) const {
    const RobotShape& sole = robot_.shapes[shape];
    const double axis = (standing_.R_WL(sole.link) * (sole.X_LS.R * Eigen::Vector3d::UnitZ())).z();
    return standing_.shape_position(shape).z() - sole.half_length * std::abs(axis) - sole.radius;
  }

  void soles() {
    const std::vector<std::vector<int>> feet = soles_of_feet(robot_);
    if (feet.empty())
      return add("soles", kMissing, "none",
                 "give four spheres under each foot with 'sole: true': their lowest points are the ground", true);
    if (feet.size() != 2)
      return add("soles", kWrong, fmt::format("shapes of {} links are soles", feet.size()),
                 "soles are two feet: all shapes of the left one, then all of the right one", true);
    std::array<double, 2> lowest{};
    double tilt = 0.0;
    for (int side = 0; side < 2; ++side) {
      const auto [least, most] = std::ranges::minmax(feet[side], {}, [&](int shape) { return bottom_of(shape); });
      lowest[side] = bottom_of(least);
      const double rise = bottom_of(most) - lowest[side];
      tilt = std::max(tilt, std::atan2(rise, extent(feet[side]).norm()) * 180.0 / std::numbers::pi);
    }
    const Eigen::Vector2d size = extent(feet[0]);
    const std::string text = fmt::format("{} and {} points, {:.0f} x {:.0f} mm, tilted by {:.1f} deg", feet[0].size(),
                                         feet[1].size(), 1e3 * size.x(), 1e3 * size.y(), tilt);
    if (standing_.shape_position(feet[0].front()).y() < standing_.shape_position(feet[1].front()).y())
      return add("soles", kWrong, text + "; the right foot's stand first", "put the left foot's shapes first", true);
    if (std::abs(lowest[0] - lowest[1]) > kEven)
      return add("soles", kWrong,
                 fmt::format("{}; one foot is {:.1f} mm higher", text, 1e3 * std::abs(lowest[0] - lowest[1])),
                 "make the neutral pose and the soles of both sides mirror images");
    if (tilt <= kLevel) return add("soles", kOk, text);
    add("soles", tilt <= kMostTilt ? kNote : kWrong, text + ": the feet are not level",
        "turn the ankles of the neutral pose, or set the spheres where the maker's soles are");
  }

  [[nodiscard]] Eigen::Vector2d extent(const std::vector<int>& shapes) const {
    Eigen::Vector2d low = standing_.shape_position(shapes[0]).head<2>(), high = low;
    for (const int shape : shapes) {
      low = low.cwiseMin(standing_.shape_position(shape).head<2>());
      high = high.cwiseMax(standing_.shape_position(shape).head<2>());
    }
    return high - low;
  }

  void heights() {
    if (robot_.feet.empty()) return;
    const double base = robot_.standing_height, pelvis = base + pelvis_in_base(robot_, robot_.neutral).p.z();
    const std::string text =
        fmt::format("pelvis {:.3f} m, base {:.3f} m over the soles; falls below {:.3f} m ({:.0f} %) or {:.0f} deg",
                    pelvis, base, robot_.fall.height, 100.0 * robot_.fall.height / base,
                    std::acos(std::clamp(robot_.fall.cos_tilt, -1.0, 1.0)) * 180.0 / std::numbers::pi);
    if (base <= 0.0)
      return add("heights", kWrong, text, "the base is in or below the ground: check the soles' centers", true);
    if (robot_.fall.height > kAllOfFall * base)
      return add("heights", kWrong, text + ": it has fallen where it stands", "lower 'fall.height'", true);
    if (const double away = urdf_origin(robot_).norm(); away > 0.0)
      return add("heights", kNote, fmt::format("{}; the URDF's origin is {:.2f} m from the pelvis", text, away));
    add("heights", kOk, text);
  }

  // The centre of mass over the rectangle of the soles.
  void balance() {
    if (robot_.feet.empty()) return;
    Eigen::Vector2d low = standing_.shape_position(robot_.feet[0]).head<2>(), high = low;
    for (const int shape : robot_.feet) {
      low = low.cwiseMin(standing_.shape_position(shape).head<2>());
      high = high.cwiseMax(standing_.shape_position(shape).head<2>());
    }
    const Eigen::Vector2d com = standing_.center_of_mass().head<2>();
    const double behind = com.x() - low.x(), before = high.x() - com.x();
    const bool inside = behind > 0.0 && before > 0.0 && com.y() > low.y() && com.y() < high.y();
    add("balance", inside ? kOk : kWrong,
        fmt::format("centre of mass {:.0f} mm before the heels and {:.0f} mm behind the toes, {:.0f} mm off the middle",
                    1e3 * behind, 1e3 * before, 1e3 * std::abs(com.y() - 0.5 * (low.y() + high.y()))),
        inside ? ""
               : "it tips over where it stands: bend hips and ankles of the neutral pose until it is over the soles");
  }

  void stance() {
    const auto& legs = robot_.roles.legs;
    if (!robot_.stance)
      return add("stance", kMissing, "none", "give 'stance', half the distance of the ankles: vmc needs it");
    if (legs[0].empty()) return;
    const double half = 0.5 * (standing_.p_WL(legs[0].back() + 1).y() - standing_.p_WL(legs[1].back() + 1).y());
    const bool fits = std::abs(half - robot_.stance->half_width) <= kStanceError;
    add("stance", fits ? kOk : kWrong,
        fmt::format("half width {:.3f} m, the ankles stand {:.3f} m from the middle", robot_.stance->half_width, half),
        fits ? "" : "make 'stance.half_width' half the distance of the ankles in the neutral pose");
  }

  void upper_body() {
    const RobotRoles& roles = robot_.roles;
    const std::string text = fmt::format("waist of {}, arms of {}, {} of their joints wrists", roles.waist.size(),
                                         roles.arms[0].size(), roles.wrists.size());
    if (!roles.arms[0].empty()) return add("upper body", kOk, text);
    add("upper body", kNote, text, "a walk needs none; tasks of two people need 'arms'");
  }

  // Whether a frame that has a side lies on that side of the pelvis.
  [[nodiscard]] bool on_its_side(int frame, bool left) const {
    const double y = standing_.frame_position(frame).y() - robot_middle();
    return left ? y > kSidewards : y < -kSidewards;
  }
  [[nodiscard]] double robot_middle() const {
    return (robot_.standing_state().X_WB * pelvis_in_base(robot_, robot_.neutral).p).y();
  }

  void tracks() {
    std::vector<std::string> missing, astray;
    for (const char* name : {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"}) {
      const auto track = robot_.tracks.find(name);
      if (track == robot_.tracks.end())
        missing.emplace_back(name);
      else if ((*name == 'l' || *name == 'r') && !on_its_side(track->second, *name == 'l'))
        astray.emplace_back(name);
    }
    if (!missing.empty())
      return add("tracks", kMissing, named(missing),
                 "name their frames in 'tracks': an episode ends as an error without", true);
    if (!astray.empty())
      return add("tracks", kWrong, fmt::format("{} on the other side of the pelvis", named(astray)),
                 "left is +y of a robot that looks along +x");
    const auto reach = [&](int side) { return fmt::format("{:.3f}", arm_length(robot_, side)); };
    add("tracks", kOk, fmt::format("{}; from shoulder to hand {} m", kTracks, reach(0)));
  }

  void people() {
    const bool whole = robot_.keypoints.size() == kKeypoints && robot_.pairs.size() == kPairs;
    std::vector<std::string> astray;
    for (const Keypoint& point : robot_.keypoints)
      if (point.name.starts_with("left") || point.name.starts_with("right"))
        if (!on_its_side(point.frame, point.name.starts_with("left"))) astray.push_back(point.name);
    const std::string text = fmt::format("{} of {} keypoints, {} of {} pairs", robot_.keypoints.size(), kKeypoints,
                                         robot_.pairs.size(), kPairs);
    if (!astray.empty())
      return add("people", kWrong, fmt::format("{}; on the other side of the pelvis: {}", text, named(astray)),
                 "left is +y of a robot that looks along +x");
    add("people", whole ? kOk : kMissing, text,
        whole ? "" : "a walk needs none; retarget and score need 'keypoints' and 'pairs'");
  }

  void shapes() {
    std::vector<std::string> regions;
    for (const RobotShape& shape : robot_.shapes)
      if (std::ranges::find(regions, shape.region) == regions.end()) regions.push_back(shape.region);
    add("shapes", kOk,
        fmt::format("{} of regions {}; {} pairs may touch one another", robot_.shapes.size(), fmt::join(regions, ", "),
                    robot_.self_collision.size()));
  }

  const RobotModel& robot_;
  Kinematics standing_;
  std::vector<RobotFinding> found_;
};

}  // namespace

const char* to_string(CheckState state) {
  switch (state) {
    case kOk:
      return "ok";
    case kNote:
      return "note";
    case kMissing:
      return "missing";
    case kWrong:
      return "wrong";
  }
  return "unknown";
}

std::vector<RobotFinding> findings_of(const RobotModel& robot) { return Findings(robot).all(); }

}  // namespace duet
