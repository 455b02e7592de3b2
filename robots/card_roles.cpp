#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/robots/card.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/roles.h"
#include "duet/robots/yaml_schema.h"

namespace duet {
namespace {

constexpr double kFallShare = 0.57;      // of the standing height at which a robot whose card is silent has fallen
constexpr double kParallel = 0.9;        // least cosine between a hinge and the mirror image of its counterpart
constexpr std::size_t kMostGroups = 64;  // of compound joints, of poses
constexpr const char* kSides[] = {"left", "right"};

std::vector<CardName> names_in(const YamlSection& section, const std::string& file, const char* key,
                               const YAML::Node& list) {
  const auto fail = [&](const YAML::Node& node) { section.refuse_key(key, "a list of names", node); };
  if (!list.IsSequence()) fail(list);
  std::vector<CardName> names;
  for (const YAML::Node& node : list) {
    if (!node.IsScalar()) fail(node);
    names.push_back({node.Scalar(), {file, node.Mark().line + 1}});
  }
  return names;
}

void read_sides(const YamlSection& card, const std::string& file, const char* key,
                std::array<std::vector<CardName>, 2>& sides, CardPlace& place) {
  if (!card.has(key)) return;
  const YamlSection section(file, card.node(key), key, {"left", "right"});
  for (int side = 0; side < 2; ++side) sides[side] = names_in(section, file, kSides[side], section.node(kSides[side]));
  place = {file, section.line()};
}

void read_names(const YamlSection& card, const std::string& file, const char* key, std::vector<CardName>& names) {
  if (card.has(key)) names = names_in(card, file, key, card.node(key));
}

void refuse_many(const YamlSection& card, const char* key, std::size_t count) {
  if (count > kMostGroups) card.fail_key(key, fmt::format("expected at most {}, found {}", kMostGroups, count));
}

void read_compound(const YamlSection& card, const std::string& file, std::vector<std::vector<CardName>>& groups) {
  if (!card.has("compound")) return;
  groups.clear();
  refuse_many(card, "compound", card.items("compound").size());
  for (const YAML::Node& node : card.items("compound")) groups.push_back(names_in(card, file, "compound", node));
}

void read_name(const YamlSection& card, const std::string& file, const char* key, std::optional<CardName>& name) {
  if (card.has(key)) name = CardName{card.text(key), {file, card.line(key)}};
}

std::pair<double, double> range(const YamlSection& section, const std::string& key, const YAML::Node& node) {
  const auto number = [&](std::size_t i) {
    double value = 0.0;
    if (!node[i].IsScalar() || !YAML::convert<double>::decode(node[i], value) || !std::isfinite(value))
      section.fail(node.Mark().line + 1,
                   fmt::format("key '{}': expected a finite number, found {}", key, describe(node[i])));
    return value;
  };
  if (!node.IsSequence() || node.size() != 2)
    section.fail(node.Mark().line + 1, fmt::format("key '{}': expected two numbers, found {}", key, describe(node)));
  const std::pair<double, double> values = {number(0), number(1)};
  if (values.first > values.second)
    section.fail(node.Mark().line + 1,
                 fmt::format("key '{}': expected lower <= upper, found [{}, {}]", key, values.first, values.second));
  return values;
}

void read_sizes(const YamlSection& card, const std::string& file, CardRoles& roles) {
  if (card.has("fall")) {
    const YamlSection section(file, card.node("fall"), "fall", {"height", "cos_tilt"});
    FallRule& fall = roles.fall.emplace();
    read_value(section, {.name = "height", .range = kPositive}, fall.height);
    fall.cos_tilt = section.number("cos_tilt");
  }
  if (card.has("stance")) {
    const YamlSection section(file, card.node("stance"), "stance", {"half_width", "shift"});
    const auto shift = range(section, "shift", section.node("shift"));
    StanceSize& stance = roles.stance.emplace(StanceSize{0.0, {shift.first, shift.second}});
    read_value(section, {.name = "half_width", .range = kPositive}, stance.half_width);
  }
  if (card.has("root_bounds")) {
    const YamlSection section(file, card.node("root_bounds"), "root_bounds", {"height", "crouch", "roll", "pitch"});
    const auto height = range(section, "height", section.node("height"));
    const auto pitch = range(section, "pitch", section.node("pitch"));
    roles.root_bounds = RootBounds{height.first,           height.second, section.number("crouch"),
                                   section.number("roll"), pitch.first,   pitch.second};
  }
}

// The pairs of a mapping in its order; a key twice is refused.
template <typename Take>
void for_each_joint(const YamlSection& card, const std::string& file, const std::string& where, const YAML::Node& node,
                    Take take) {
  if (!node.IsMap())
    card.fail(node.Mark().line + 1, fmt::format("key '{}': expected a mapping, found {}", where, describe(node)));
  std::set<std::string> seen;
  for (const auto& entry : node) {
    const CardName joint{entry.first.IsScalar() ? entry.first.Scalar() : "", {file, entry.first.Mark().line + 1}};
    if (!seen.insert(joint.name).second)
      card.fail(joint.place.line,
                fmt::format("key '{}': expected each joint once, found '{}' again", where, joint.name));
    take(joint, entry.second);
  }
}

void read_ranges(const YamlSection& card, const std::string& file, std::vector<CardRange>& ranges) {
  if (!card.has("pose_ranges")) return;
  ranges.clear();
  for_each_joint(card, file, "pose_ranges", card.node("pose_ranges"),
                 [&](const CardName& joint, const YAML::Node& value) {
                   const auto [lower, upper] = range(card, joint.name, value);
                   ranges.push_back({joint, lower, upper});
                 });
}

void read_poses(const YamlSection& card, const std::string& file,
                std::map<std::string, std::vector<CardAngle>>& poses) {
  if (!card.has("poses")) return;
  poses.clear();
  refuse_many(card, "poses", card.node("poses").size());
  for_each_joint(card, file, "poses", card.node("poses"), [&](const CardName& pose, const YAML::Node& angles) {
    std::vector<CardAngle>& out = poses[pose.name];
    for_each_joint(card, file, pose.name, angles, [&](const CardName& joint, const YAML::Node& value) {
      double angle = 0.0;
      if (!value.IsScalar() || !YAML::convert<double>::decode(value, angle) || !std::isfinite(angle))
        card.fail(joint.place.line,
                  fmt::format("key '{}': expected a finite number, found {}", joint.name, describe(value)));
      out.push_back({joint, angle});
    });
  });
}

[[noreturn]] void fail_at(const CardPlace& place, const std::string& message) {
  throw InputError(fmt::format("{}:{}: {}", place.file, place.line, message));
}

// Looks names up; a joint that the card locks is none.
class RoleBinder {
 public:
  RoleBinder(const RobotCard& card, RobotModel& robot) : card_(card), robot_(robot), roles_(robot.roles) {}

  void bind() {
    const CardRoles& given = card_.roles;
    for (int side = 0; side < 2; ++side) {
      roles_.legs[side] = joints(given.legs[side]);
      roles_.arms[side] = joints(given.arms[side]);
    }
    roles_.waist = joints(given.waist);
    roles_.wrists = joints(given.wrists);
    for (const std::vector<CardName>& group : given.compound) roles_.compound.push_back(joints(group));
    set_counterparts();
    set_bodies();
    roles_.push_frame = given.push_link ? frame(*given.push_link) : 0;
    roles_.imu_frame = given.imu ? frame(*given.imu) : 0;
    for (const CardRange& entry : given.pose_ranges) add_range(entry);
    for (const auto& [name, angles] : given.poses) add_pose(name, angles);
    robot_.fall = given.fall.value_or(FallRule{kFallShare * robot_.standing_height});
    robot_.stance = given.stance;
    robot_.root_bounds = given.root_bounds;
    move_heights();
  }

 private:
  // The card's heights are of the URDF's origin, or, where that is below them when the robot stands, of the pelvis.
  void move_heights() {
    const double below = urdf_origin(robot_).z(), standing = robot_.standing_height + below;  // of the URDF's origin
    if (below == 0.0) return;
    const auto move = [&](double& height) {
      if (height < standing) height -= below;
    };
    if (card_.roles.fall) move(robot_.fall.height);
    if (!robot_.root_bounds) return;
    RootBounds& bounds = *robot_.root_bounds;
    if (bounds.lowest >= standing) return;
    for (double* height : {&bounds.lowest, &bounds.highest, &bounds.least_crouch}) *height -= below;
  }

  [[nodiscard]] bool is_locked(const std::string& joint) const {
    return std::ranges::any_of(card_.locked, [&](const CardLock& lock) { return lock.joint == joint; });
  }

  // -1 for a locked one.
  [[nodiscard]] int joint(const CardName& given) const {
    if (is_locked(given.name)) return -1;
    try {
      return robot_.joint_index(given.name);
    } catch (const std::invalid_argument& error) {
      fail_at(given.place, error.what());
    }
  }

  [[nodiscard]] int frame(const CardName& given) const {
    try {
      return robot_.frame_index(given.name);
    } catch (const std::invalid_argument& error) {
      fail_at(given.place, error.what());
    }
  }

  [[nodiscard]] std::vector<int> joints(const std::vector<CardName>& given) const {
    std::vector<int> found;
    for (const CardName& name : given)
      if (const int index = joint(name); index >= 0) found.push_back(index);
    return found;
  }

  void set_counterparts() {
    roles_.counterpart.resize(robot_.joints.size());
    for (int j = 0; j < robot_.dof(); ++j) roles_.counterpart[j] = j;
    exchange(roles_.legs, card_.roles.legs_place, "legs");
    exchange(roles_.arms, card_.roles.arms_place, "arms");
  }

  void exchange(const std::array<std::vector<int>, 2>& sides, const CardPlace& place, const char* what) {
    if (sides[0].size() != sides[1].size())
      fail_at(place, fmt::format("key '{}': expected as many joints left as right, found {} and {}", what,
                                 sides[0].size(), sides[1].size()));
    for (std::size_t i = 0; i < sides[0].size(); ++i) {
      const int left = sides[0][i], right = sides[1][i];
      if (roles_.counterpart[left] != left || roles_.counterpart[right] != right || left == right)
        fail_at(place, fmt::format("key '{}': expected each joint once in legs and arms, found '{}' or '{}' again",
                                   what, robot_.joints[left].name, robot_.joints[right].name));
      if (std::abs(mirrored_axis(hinge_axis(robot_, left)).dot(hinge_axis(robot_, right))) < kParallel)
        fail_at(place, fmt::format("key '{}': expected '{}' to mirror '{}', found hinges about other axes at zero",
                                   what, robot_.joints[left].name, robot_.joints[right].name));
      roles_.counterpart[left] = right;
      roles_.counterpart[right] = left;
    }
  }

  void set_bodies() {
    for (const CardName& name : card_.roles.bodies) roles_.bodies.push_back(robot_.frames[frame(name)].link);
    if (card_.roles.bodies.empty())
      for (int i = 0; i < static_cast<int>(robot_.links.size()); ++i) roles_.bodies.push_back(i);
    std::ranges::sort(roles_.bodies);
    roles_.bodies.erase(std::unique(roles_.bodies.begin(), roles_.bodies.end()), roles_.bodies.end());
  }

  void check_angle(const CardName& given, int joint, double angle) const {
    const RobotJoint& limits = robot_.joints[joint];
    if (angle < limits.lower || angle > limits.upper)
      fail_at(given.place, fmt::format("joint '{}': expected angles in [{}, {}], found {}", given.name, limits.lower,
                                       limits.upper, angle));
  }

  void add_range(const CardRange& entry) {
    const int index = joint(entry.joint);
    if (index < 0) return;
    check_angle(entry.joint, index, entry.lower);
    check_angle(entry.joint, index, entry.upper);
    roles_.pose_ranges[index] = {entry.lower, entry.upper};
  }

  void add_pose(const std::string& name, const std::vector<CardAngle>& angles) {
    Eigen::VectorXd q = robot_.neutral;
    for (const CardAngle& angle : angles) {
      const int index = joint(angle.joint);
      if (index < 0) continue;
      check_angle(angle.joint, index, angle.value);
      q[index] = angle.value;
    }
    roles_.poses[name] = q;
  }

  const RobotCard& card_;
  RobotModel& robot_;
  RobotRoles& roles_;
};

}  // namespace

void read_roles(const YamlSection& card, const std::string& file, CardRoles& roles) {
  read_sides(card, file, "legs", roles.legs, roles.legs_place);
  read_sides(card, file, "arms", roles.arms, roles.arms_place);
  read_names(card, file, "waist", roles.waist);
  read_names(card, file, "wrists", roles.wrists);
  read_names(card, file, "bodies", roles.bodies);
  read_compound(card, file, roles.compound);
  read_name(card, file, "push_link", roles.push_link);
  read_name(card, file, "imu", roles.imu);
  read_sizes(card, file, roles);
  read_ranges(card, file, roles.pose_ranges);
  read_poses(card, file, roles.poses);
}

void bind_roles(const RobotCard& card, RobotModel& robot) { RoleBinder(card, robot).bind(); }

}  // namespace duet
