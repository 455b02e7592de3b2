#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/robots/card.h"
#include "duet/robots/yaml_schema.h"

namespace duet {
namespace {

const std::vector<std::string>& smpl_names() {
  static const std::vector<std::string> names(kSmplNames.begin(), kSmplNames.end());
  return names;
}

std::string name_of(const YAML::Node& node) {
  return node.IsMap() && node["name"] && node["name"].IsScalar() ? node["name"].Scalar() : "";
}

// An entry of one of the card's lists, with its place.
template <typename Entry>
Entry read_entry(const std::string& file, const YAML::Node& node, const std::string& where,
                 const Schema<Entry>& schema) {
  Entry entry;
  entry.place = {file, read_mapping(file, node, where, schema, entry).line()};
  return entry;
}

CardJoint read_joint(const std::string& file, const YAML::Node& node) {
  using J = CardJoint;
  static const Schema<J> schema = {required_key({"name"}, &J::name),
                                   required_key({.name = "armature", .range = kNotNegative}, &J::armature),
                                   required_key({.name = "kp", .range = kNotNegative}, &J::kp),
                                   required_key({.name = "kd", .range = kNotNegative}, &J::kd),
                                   optional_key({"neutral"}, &J::neutral),
                                   optional_key({"lower"}, &J::lower),
                                   optional_key({"upper"}, &J::upper),
                                   optional_key({.name = "effort", .range = kPositive}, &J::effort),
                                   optional_key({.name = "velocity", .range = kPositive}, &J::velocity)};
  return read_entry(file, node, fmt::format("joint '{}'", name_of(node)), schema);
}

CardLock read_lock(const std::string& file, const YAML::Node& node) {
  using L = CardLock;
  static const Schema<L> schema = {required_key({"name"}, &L::joint), required_key({"position"}, &L::position)};
  return read_entry(file, node, fmt::format("locked joint '{}'", name_of(node)), schema);
}

// URDF's fixed-axis roll, pitch, yaw.
Eigen::Quaterniond from_rpy(const Eigen::Vector3d& rpy) {
  return Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX());
}

CardFrame read_frame(const std::string& file, const YAML::Node& node) {
  using F = CardFrame;
  static const Schema<F> schema = {
      required_key({"name"}, &F::name),
      required_key({"link"}, &F::link),
      {"xyz", [](const YamlSection& section, F& frame) { frame.X_LF.p = section.vector3("xyz"); }},
      {"rpy",
       [](const YamlSection& section, F& frame) {
         if (section.has("rpy")) frame.X_LF.R = from_rpy(section.vector3("rpy"));
       }},
      optional_key({"replaces_urdf_link"}, &F::replaces_urdf_link)};
  return read_entry(file, node, fmt::format("frame '{}'", name_of(node)), schema);
}

CardShape read_shape(const std::string& file, const YAML::Node& node) {
  const YamlSection section(file, node, "shape", {"link", "kind", "center", "from", "to", "radius", "region", "sole"});
  CardShape shape;
  shape.place = {file, section.line()};
  shape.link = section.text("link");
  const std::string kind = section.text("kind");
  if (kind != "sphere" && kind != "capsule")
    section.fail_key("kind", fmt::format("expected sphere or capsule, found '{}'", kind));
  shape.kind = kind == "sphere" ? ShapeKind::kSphere : ShapeKind::kCapsule;
  const bool sphere = shape.kind == ShapeKind::kSphere;
  for (const char* key : {"center", "from", "to"})
    if (section.has(key) != (sphere == (std::string_view(key) == "center")))
      section.fail(shape.place.line, fmt::format("expected {} for a {}, found {} '{}'",
                                                 sphere ? "'center' alone" : "'from' and 'to' alone", kind,
                                                 section.has(key) ? "also" : "no", key));
  shape.from = section.vector3(sphere ? "center" : "from");
  shape.to = section.vector3(sphere ? "center" : "to");
  if (!sphere && (shape.to - shape.from).norm() < 1e-6)
    section.fail(shape.place.line, "expected two different ends of the capsule, found the same point");
  read_value(section, {.name = "radius", .range = kPositive}, shape.radius);
  shape.region = section.text("region");
  read_optional(section, {"sole"}, shape.sole);
  return shape;
}

CardPoint read_human_point(const std::string& file, const YAML::Node& node, const char* what, bool named) {
  const YamlSection section =
      named ? YamlSection(file, node, fmt::format("{} '{}'", what, name_of(node)), {"name", "frame", "smpl"})
            : YamlSection(file, node, what, {"frame", "smpl"});
  const std::string joint = section.text("smpl");
  CardPoint point{.name = named ? section.text("name") : "",
                  .place = {file, section.line()},
                  .frame = section.text("frame"),
                  .smpl = smpl_index(joint)};
  if (point.smpl < 0) section.fail(section.line("smpl"), unknown_name_message("SMPL joint", joint, smpl_names()));
  return point;
}

CardRegions read_regions(const YamlSection& root, const std::string& file, const YAML::Node& node) {
  const int line = node.Mark().line + 1;
  if (!node.IsSequence() || node.size() != 2 || !node[0].IsScalar() || !node[1].IsScalar())
    root.fail(line, fmt::format("key 'self_collision': expected a pair of regions, found {}", describe(node)));
  return {.place = {file, line}, .first = node[0].Scalar(), .second = node[1].Scalar()};
}

std::vector<CardPoint> read_tracks(const std::string& file, const YamlSection& root) {
  const YamlSection section(file, root.node("tracks"), "tracks",
                            {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"});
  std::vector<CardPoint> tracks;
  for (const char* name : kTrackNames)
    if (section.has(name))
      tracks.push_back({.name = name, .place = {file, section.line(name)}, .frame = section.text(name)});
  return tracks;
}

template <typename Entry, typename Name>
void refuse_repeats(const YamlSection& root, const std::vector<Entry>& entries, const char* what, Name name) {
  std::set<std::string> seen;
  for (const Entry& entry : entries)
    if (!seen.insert(name(entry)).second)
      root.fail(entry.place.line, fmt::format("expected each {} once, found '{}' again", what, name(entry)));
}

// A card and those that extended it on the way here, the outermost first.
class CardReader {
 public:
  RobotCard read(const std::string& text, const std::string& file) {
    const YamlSection root(file, parse_yaml(text, file), "robot card",
                           {"name",   "extends",     "urdf",        "base",          "joints", "locked", "frames",
                            "shapes", "pairs",       "keypoints",   "tracks",        "legs",   "arms",   "waist",
                            "wrists", "compound",    "bodies",      "push_link",     "imu",    "fall",   "stance",
                            "poses",  "root_bounds", "pose_ranges", "self_collision"});
    RobotCard card = root.has("extends") ? extended(root, file) : RobotCard{};
    card.files.insert(card.files.begin(), file);
    take_names(root, file, card);
    take_lists(root, file, card);
    read_roles(root, file, card.roles);
    for (const auto& [key, value] : content_of(root.keys())) card.content[key] = value;
    return card;
  }

 private:
  RobotCard extended(const YamlSection& root, const std::string& file) {
    namespace fs = std::filesystem;
    const std::string base = root.text("extends");
    const int line = root.line("extends");
    if (fs::path(base).is_absolute() || !base.ends_with(".yaml"))
      root.fail(line,
                fmt::format("key 'extends': expected the path of a card (.yaml) from this one, found '{}'", base));
    const std::string path = (fs::path(file).parent_path() / base).lexically_normal().string();
    chain_.push_back(fs::path(file).lexically_normal().string());
    if (std::ranges::find(chain_, path) != chain_.end())
      root.fail(line,
                fmt::format("key 'extends': expected cards without a cycle, found {}, which extends {}", path, file));
    if (chain_.size() > kMostExtended)
      root.fail(line, fmt::format("key 'extends': expected at most {} cards in a row, found one more", kMostExtended));
    RobotCard card = read(read_text(path), path);
    card.urdf = (fs::path(base).parent_path() / card.urdf).lexically_normal().string();
    return card;
  }

  static void take_names(const YamlSection& root, const std::string& file, RobotCard& card) {
    card.name = root.text("name");
    if (card.urdf.empty() || root.has("urdf")) card.urdf = root.text("urdf");
    if (!card.base.empty() && !root.has("base")) return;
    card.base = root.text("base");
    card.base_place = {file, root.line("base")};
  }

  static void take_lists(const YamlSection& root, const std::string& file, RobotCard& card) {
    const auto take = [&](const char* key, auto& entries, auto read_entry) {
      if (!root.has(key)) return;
      entries.clear();
      for (const YAML::Node& node : root.items(key)) entries.push_back(read_entry(node));
    };
    take("joints", card.joints, [&](const YAML::Node& node) { return read_joint(file, node); });
    take("locked", card.locked, [&](const YAML::Node& node) { return read_lock(file, node); });
    take("frames", card.frames, [&](const YAML::Node& node) { return read_frame(file, node); });
    take("shapes", card.shapes, [&](const YAML::Node& node) { return read_shape(file, node); });
    take("pairs", card.pairs, [&](const YAML::Node& node) { return read_human_point(file, node, "pair", false); });
    take("keypoints", card.keypoints,
         [&](const YAML::Node& node) { return read_human_point(file, node, "keypoint", true); });
    take("self_collision", card.self_collision, [&](const YAML::Node& node) { return read_regions(root, file, node); });
    if (root.has("tracks")) card.tracks = read_tracks(file, root);
    refuse_repeats(root, card.joints, "joint", [](const CardJoint& joint) { return joint.name; });
    refuse_repeats(root, card.locked, "locked joint", [](const CardLock& lock) { return lock.joint; });
    refuse_repeats(root, card.frames, "frame", [](const CardFrame& frame) { return frame.name; });
    refuse_repeats(root, card.keypoints, "keypoint", [](const CardPoint& keypoint) { return keypoint.name; });
    refuse_repeats(root, card.self_collision, "pair of regions", [](const CardRegions& pair) {
      return fmt::format("{}, {}", std::min(pair.first, pair.second), std::max(pair.first, pair.second));
    });
  }

  std::vector<std::string> chain_;
};

}  // namespace

RobotCard parse_card(const std::string& text, const std::string& file) { return CardReader().read(text, file); }

namespace {

// Digests of what five cards say, and of the bytes (URDF, then card) of the ones that said it first.
constexpr std::pair<std::string_view, std::string_view> kPublished[] = {
    {"8e5271e0342ce54d6ede6146fd46edf5e79663a137c37d79e57b1e705a8b9c41",
     "b22cde7449b8de81c5bb67eb826ea8dddc87783671befcad2c40d80e1b44af7b"},
    {"5e752ab06c9a8b0ea6dbe8df10be0fe44b1ef3b6ab3a1f20958d760c2d86253a",
     "a973fe9e6231e92af5ed4d7f964a4ebea7c0eccbc5b491f2624da4d0902c20ab"},
    {"be49fea89b0093e3fcbfb872e8da1d4d6c5b2ea044d7e625c43937fb52f408f1",
     "af0aa4f47abb05dd0c61ca8a1146d8bca28e240a727e66c5b05f13df780b2845"},
    {"fdfc0b8be1422dea183c3e0774c3b1e7e69338571ef2ed2b4b435888ba24f4b7",
     "57bdbfda72094abe6364700628b71638ea92df71d477ba71c6f24046917ca788"},
    {"d39934b980d6832f630499f620f8b10e360dc0a94183a1ffe9d9452bf6b20768",
     "f5a01d41e2755e19a38604e36e60ff9cbb6dfc7d88870508ad1dde14828c264f"},
};

std::string quoted(const std::string& text) {
  const std::optional<double> number = parse_number(text);
  return number ? fmt::format("{}", *number) : fmt::format("{}:{}", text.size(), text);
}

std::string spelling(const YAML::Node& node) {
  if (node.IsScalar()) return quoted(node.Scalar());
  std::string text;
  if (node.IsSequence()) {
    for (const YAML::Node& item : node) text += fmt::format("{},", spelling(item));
    return fmt::format("[{}]", text);
  }
  std::map<std::string, std::string> entries;
  if (node.IsMap())
    for (const auto& entry : node) entries[entry.first.Scalar()] = spelling(entry.second);
  for (const auto& [key, value] : entries) text += fmt::format("{}:{}={},", key.size(), key, value);
  return fmt::format("{{{}}}", text);
}

}  // namespace

std::map<std::string, std::string> content_of(const YAML::Node& card) {
  std::map<std::string, std::string> content;
  for (const auto& entry : card)
    if (const std::string& key = entry.first.Scalar(); key != "extends" && key != "urdf")
      content[key] = spelling(entry.second);
  return content;
}

std::string robot_digest(std::string_view urdf, const std::map<std::string, std::string>& content) {
  Sha256 sha256;
  sha256.update(std::string_view("duet.robot/1\n"));
  for (const auto& [key, value] : content) sha256.update(std::string_view(fmt::format("{}: {}\n", key, value)));
  sha256.update(urdf);
  const std::string digest = sha256.hex();
  for (const auto& [now, published] : kPublished)
    if (digest == now) return std::string(published);
  return digest;
}

}  // namespace duet
