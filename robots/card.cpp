#include "robots/card.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <set>

#include "core/names.h"
#include "core/skeleton.h"
#include "robots/yaml_section.h"

namespace duet {
namespace {

const std::vector<std::string>& smpl_names() {
  static const std::vector<std::string> names(kSmplNames.begin(), kSmplNames.end());
  return names;
}

std::string name_of(const YAML::Node& node) {
  return node.IsMap() && node["name"] && node["name"].IsScalar() ? node["name"].Scalar() : "";
}

void refuse_negative(const YamlSection& section, const char* key, std::optional<double> value) {
  if (value && *value < 0.0)
    section.fail(section.line(key), fmt::format("'{}': expected a number >= 0, found {}", key, *value));
}

double positive(const YamlSection& section, const char* key) {
  const double value = section.number(key);
  if (value <= 0.0) section.fail(section.line(key), fmt::format("'{}': expected a number > 0, found {}", key, value));
  return value;
}

CardJoint read_joint(const std::string& file, const YAML::Node& node) {
  const YamlSection section(file, node, fmt::format("joint '{}'", name_of(node)),
                            {"name", "armature", "kp", "kd", "neutral", "lower", "upper", "effort", "velocity"});
  CardJoint joint{.name = section.text("name"),
                  .line = section.line(),
                  .armature = section.number("armature"),
                  .kp = section.number("kp"),
                  .kd = section.number("kd"),
                  .neutral = section.optional_number("neutral").value_or(0.0),
                  .lower = section.optional_number("lower"),
                  .upper = section.optional_number("upper"),
                  .effort = section.optional_number("effort"),
                  .velocity = section.optional_number("velocity")};
  refuse_negative(section, "armature", joint.armature);
  refuse_negative(section, "kp", joint.kp);
  refuse_negative(section, "kd", joint.kd);
  if (joint.effort) joint.effort = positive(section, "effort");
  if (joint.velocity) joint.velocity = positive(section, "velocity");
  return joint;
}

CardLock read_lock(const std::string& file, const YAML::Node& node) {
  const YamlSection section(file, node, fmt::format("locked joint '{}'", name_of(node)), {"name", "position"});
  return {.joint = section.text("name"), .line = section.line(), .position = section.number("position")};
}

// URDF's fixed-axis roll, pitch, yaw.
Eigen::Quaterniond from_rpy(const Eigen::Vector3d& rpy) {
  return Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX());
}

CardFrame read_frame(const std::string& file, const YAML::Node& node) {
  const YamlSection section(file, node, fmt::format("frame '{}'", name_of(node)),
                            {"name", "link", "xyz", "rpy", "replaces_urdf_link"});
  CardFrame frame{.name = section.text("name"),
                  .line = section.line(),
                  .link = section.text("link"),
                  .X_LF = {},
                  .replaces_urdf_link = section.flag_or("replaces_urdf_link", false)};
  frame.X_LF.p = section.vector3("xyz");
  if (section.has("rpy")) frame.X_LF.R = from_rpy(section.vector3("rpy"));
  return frame;
}

CardShape read_shape(const std::string& file, const YAML::Node& node) {
  const YamlSection section(file, node, "shape", {"link", "kind", "center", "from", "to", "radius", "region", "sole"});
  CardShape shape;
  shape.line = section.line();
  shape.link = section.text("link");
  const std::string kind = section.text("kind");
  if (kind != "sphere" && kind != "capsule")
    section.fail(section.line("kind"), fmt::format("'kind': expected sphere or capsule, found '{}'", kind));
  shape.kind = kind == "sphere" ? ShapeKind::kSphere : ShapeKind::kCapsule;
  const bool sphere = shape.kind == ShapeKind::kSphere;
  for (const char* key : {"center", "from", "to"})
    if (section.has(key) != (sphere == (std::string_view(key) == "center")))
      section.fail(shape.line, fmt::format("expected {} for a {}, found {} '{}'",
                                           sphere ? "'center' alone" : "'from' and 'to' alone", kind,
                                           section.has(key) ? "also" : "no", key));
  shape.from = section.vector3(sphere ? "center" : "from");
  shape.to = section.vector3(sphere ? "center" : "to");
  if (!sphere && (shape.to - shape.from).norm() < 1e-6)
    section.fail(shape.line, "expected two different ends of the capsule, found the same point");
  shape.radius = positive(section, "radius");
  shape.region = section.text("region");
  shape.sole = section.flag_or("sole", false);
  return shape;
}

CardPoint read_human_point(const std::string& file, const YAML::Node& node, const char* what, bool named) {
  const YamlSection section =
      named ? YamlSection(file, node, fmt::format("{} '{}'", what, name_of(node)), {"name", "frame", "smpl"})
            : YamlSection(file, node, what, {"frame", "smpl"});
  const std::string joint = section.text("smpl");
  CardPoint point{.name = named ? section.text("name") : "",
                  .line = section.line(),
                  .frame = section.text("frame"),
                  .smpl = smpl_index(joint)};
  if (point.smpl < 0) section.fail(section.line("smpl"), unknown_name_message("SMPL joint", joint, smpl_names()));
  return point;
}

CardRegions read_regions(const YamlSection& root, const YAML::Node& node) {
  const int line = node.Mark().line + 1;
  if (!node.IsSequence() || node.size() != 2 || !node[0].IsScalar() || !node[1].IsScalar())
    root.fail(line, fmt::format("'self_collision': expected a pair of regions, found {}", describe(node)));
  return {.line = line, .first = node[0].Scalar(), .second = node[1].Scalar()};
}

std::vector<CardPoint> read_tracks(const std::string& file, const YamlSection& root) {
  if (!root.has("tracks")) return {};
  const YamlSection section(file, root.node("tracks"), "tracks",
                            {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"});
  std::vector<CardPoint> tracks;
  for (const char* name : kTrackNames)
    if (section.has(name)) tracks.push_back({.name = name, .line = section.line(name), .frame = section.text(name)});
  return tracks;
}

template <typename Entry, typename Name>
void refuse_repeats(const YamlSection& root, const std::vector<Entry>& entries, const char* what, Name name) {
  std::set<std::string> seen;
  for (const Entry& entry : entries)
    if (!seen.insert(name(entry)).second)
      root.fail(entry.line, fmt::format("expected each {} once, found '{}' again", what, name(entry)));
}

}  // namespace

RobotCard parse_card(const std::string& text, const std::string& file) {
  const YamlSection root(file, parse_yaml(text, file), "robot card",
                         {"name", "urdf", "base", "joints", "locked", "frames", "shapes", "pairs", "keypoints",
                          "tracks", "self_collision"});
  RobotCard card;
  card.name = root.text("name");
  card.urdf = root.text("urdf");
  card.base = root.text("base");
  card.base_line = root.line("base");
  for (const YAML::Node& node : root.items("joints")) card.joints.push_back(read_joint(file, node));
  for (const YAML::Node& node : root.items("locked")) card.locked.push_back(read_lock(file, node));
  for (const YAML::Node& node : root.items("frames")) card.frames.push_back(read_frame(file, node));
  for (const YAML::Node& node : root.items("shapes")) card.shapes.push_back(read_shape(file, node));
  for (const YAML::Node& node : root.items("pairs")) card.pairs.push_back(read_human_point(file, node, "pair", false));
  for (const YAML::Node& node : root.items("keypoints"))
    card.keypoints.push_back(read_human_point(file, node, "keypoint", true));
  card.tracks = read_tracks(file, root);
  for (const YAML::Node& node : root.items("self_collision")) card.self_collision.push_back(read_regions(root, node));
  refuse_repeats(root, card.joints, "joint", [](const CardJoint& joint) { return joint.name; });
  refuse_repeats(root, card.locked, "locked joint", [](const CardLock& lock) { return lock.joint; });
  refuse_repeats(root, card.frames, "frame", [](const CardFrame& frame) { return frame.name; });
  refuse_repeats(root, card.keypoints, "keypoint", [](const CardPoint& keypoint) { return keypoint.name; });
  refuse_repeats(root, card.self_collision, "pair of regions", [](const CardRegions& pair) {
    return fmt::format("{}, {}", std::min(pair.first, pair.second), std::max(pair.first, pair.second));
  });
  return card;
}

}  // namespace duet
