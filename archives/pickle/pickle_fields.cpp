#include "duet/archives/pickle/pickle_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "duet/archives/pickle/pickle_machine.h"
#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

std::string expected_table_text(std::size_t frames, const std::vector<std::size_t>& rest) {
  std::string text = frames == 0 ? "(T" : fmt::format("({}", frames);
  for (const std::size_t size : rest) text += size == 0 ? ", n" : fmt::format(", {}", size);
  return text + ")";
}

}  // namespace

PickleDict::PickleDict(const Pickle& pickle, const PickleNode& node) : pickle_(pickle) {
  if (node.kind != PickleKind::kDict)
    pickle.fail(node.offset, fmt::format("expected a dict, found {}", to_string(node.kind)));
  for (std::size_t i = 0; i + 1 < node.items.size(); i += 2) add(pickle[node.items[i]], node.items[i + 1]);
}

const PickleNode* PickleDict::find(const std::string& key) const {
  const auto found = values_.find(key);
  if (found == values_.end() || pickle_[found->second].kind == PickleKind::kNone) return nullptr;
  return &pickle_[found->second];
}

const PickleNode& PickleDict::get(const std::string& key) const {
  if (const PickleNode* node = find(key)) return *node;
  throw InputError(fmt::format("'{}': missing key '{}'; keys found: {}", pickle_.name, key,
                               excerpt(fmt::format("{}", fmt::join(keys(), ", ")), kShownSentence)));
}

std::vector<std::string> PickleDict::keys() const {
  std::vector<std::string> names;
  for (const auto& [name, node] : values_) names.push_back(name);
  return names;
}

void PickleDict::add(const PickleNode& key, int value) {
  if (key.kind != PickleKind::kText)
    pickle_.fail(key.offset, fmt::format("expected a string as key, found {}", to_string(key.kind)));
  const std::string name(key.text);
  if (!values_.emplace(name, value).second)
    pickle_.fail(key.offset, fmt::format("key '{}' is there twice", excerpt(name)));
}

PickleTable pickle_table(const Pickle& pickle, const PickleNode& node, const std::string& key, std::size_t frames,
                         const std::vector<std::size_t>& rest) {
  const std::string what = "key '" + key + "'";
  PickleNumbers numbers = pickle_numbers(pickle, node, what);
  const std::vector<std::size_t>& shape = numbers.shape;
  bool fits = shape.size() == rest.size() + 1 && (frames == 0 || shape[0] == frames);
  for (std::size_t d = 0; fits && d < rest.size(); ++d)
    fits = rest[d] == 0 ? shape[d + 1] > 0 : shape[d + 1] == rest[d];
  if (!fits)
    pickle.fail(node.offset, fmt::format("{}: expected shape {}, found ({})", what, expected_table_text(frames, rest),
                                         fmt::join(shape, ", ")));
  PickleTable table{.rows = shape[0], .values = std::move(numbers.values)};
  if (table.rows < 2 || table.rows > 100'000'000)
    pickle.fail(node.offset, fmt::format("{}: expected at least 2 frames, found {}", what, table.rows));
  table.row_size = table.values.size() / table.rows;
  for (std::size_t i = 0; i < table.values.size(); ++i)
    if (!std::isfinite(table.values[i]))
      pickle.fail(node.offset,
                  fmt::format("{}: frame {}, number {} is not finite", what, i / table.row_size, i % table.row_size));
  return table;
}

double pickle_rate(const Pickle& pickle, const PickleNode& node) {
  const double rate_hz = pickle_number(pickle, node, "key 'fps'");
  if (!std::isfinite(rate_hz) || rate_hz <= 0.0)
    pickle.fail(node.offset, fmt::format("key 'fps': expected a positive rate, found {}", rate_hz));
  return rate_hz;
}

namespace {

constexpr std::size_t kMostMotionBytes = std::size_t{1} << 30;  // hours of one robot
constexpr double kUnitTolerance = 1e-6;
constexpr double kRepairable = 0.1;  // deviation of a quaternion's length from 1 that is renormalised
const std::array<std::string, 6> kKeys = {"fps", "root_pos", "root_rot", "dof_pos", "local_body_pos", "link_body_list"};
const std::array<std::string, 3> kNameKeys = {"joint_names", "dof_names", "joint_order"};  // of files that have them

// Rotations of the root; the sentence says what had to be mended.
std::vector<Eigen::Quaterniond> get_rotations(const Pickle& pickle, const PickleNode& node,
                                              const PickleTable& quat_xyzw, std::string& sentence) {
  std::vector<Eigen::Quaterniond> rotations;
  double worst = 0.0;
  std::size_t worst_frame = 0;
  for (std::size_t t = 0; t < quat_xyzw.rows; ++t) {
    const double* q = &quat_xyzw.values[4 * t];
    const Eigen::Quaterniond R(q[3], q[0], q[1], q[2]);
    const double deviation = std::abs(R.norm() - 1.0);
    if (!(deviation <= kRepairable))
      pickle.fail(
          node.offset,
          fmt::format("key 'root_rot': frame {}: expected a unit quaternion (xyzw), found length {}", t, R.norm()));
    if (deviation > worst) worst_frame = t;
    worst = std::max(worst, deviation);
    rotations.push_back(R.normalized());
  }
  sentence = worst <= kUnitTolerance
                 ? "root_rot: read as xyzw; unit length"
                 : fmt::format("root_rot: read as xyzw; renormalised, worst length off by {:.4f} in frame {}", worst,
                               worst_frame);
  return rotations;
}

std::vector<std::string> get_names(const Pickle& pickle, const PickleNode& node, const std::string& key) {
  if (node.kind != PickleKind::kList && node.kind != PickleKind::kTuple)
    pickle.fail(node.offset, fmt::format("key '{}': expected a list, found {}", key, to_string(node.kind)));
  std::vector<std::string> names;
  for (const int item : node.items) {
    const PickleNode& name = pickle[item];
    if (name.kind != PickleKind::kText)
      pickle.fail(name.offset, fmt::format("key '{}': expected a string, found {}", key, to_string(name.kind)));
    names.emplace_back(name.text);
  }
  return names;
}

void read_bodies(const Pickle& pickle, const PickleDict& dict, std::size_t frames, PickledMotion& result) {
  if (const PickleNode* names = dict.find("link_body_list"))
    result.link_body_list = get_names(pickle, *names, "link_body_list");
  const PickleNode* positions = dict.find("local_body_pos");
  if (positions == nullptr) {
    result.verdict.emplace_back("local_body_pos: none");
    return;
  }
  PickleTable table = pickle_table(pickle, *positions, "local_body_pos", frames, {result.link_body_list.size(), 3});
  const int bodies = static_cast<int>(table.row_size / 3);
  result.local_body_pos = PointTracks(static_cast<int>(table.rows), bodies, std::move(table.values));
  result.verdict.push_back(fmt::format("local_body_pos: {} bodies, {} named", bodies, result.link_body_list.size()));
}

// Names of the joints, and a sentence on the keys that tell nothing of the motion.
void read_more(const Pickle& pickle, const PickleDict& dict, PickledMotion& result) {
  std::vector<std::string> others;
  for (const std::string& key : dict.keys()) {
    if (std::find(kKeys.begin(), kKeys.end(), key) != kKeys.end()) continue;
    const PickleNode* node = dict.find(key);
    const bool names = std::find(kNameKeys.begin(), kNameKeys.end(), key) != kNameKeys.end();
    if (names && node != nullptr && result.motion.joint_names.empty())
      result.motion.joint_names = get_names(pickle, *node, key);
    else
      others.push_back(key);
  }
  if (!others.empty())
    result.verdict.push_back(std::string(kLeftOutKeys) + "keys that are none of the format's: " +
                             excerpt(fmt::format("{}", fmt::join(others, ", ")), kShownSentence));
}

}  // namespace

PickledMotion motion_of_pickle(const Pickle& pickle) {
  const PickleDict dict(pickle, pickle[pickle.root]);
  PickledMotion result;
  RobotMotion& motion = result.motion;
  motion.rate_hz = pickle_rate(pickle, dict.get("fps"));
  const PickleTable position = pickle_table(pickle, dict.get("root_pos"), "root_pos", 0, {3});
  const PickleNode& rotation = dict.get("root_rot");
  const PickleTable quat_xyzw = pickle_table(pickle, rotation, "root_rot", position.rows, {4});
  const PickleTable joints = pickle_table(pickle, dict.get("dof_pos"), "dof_pos", position.rows, {0});

  std::string rotation_sentence;
  const std::vector<Eigen::Quaterniond> rotations = get_rotations(pickle, rotation, quat_xyzw, rotation_sentence);
  for (std::size_t t = 0; t < position.rows; ++t)
    motion.root.push_back({.R = rotations[t], .p = Eigen::Map<const Eigen::Vector3d>(&position.values[3 * t])});
  motion.q = Eigen::Map<const Eigen::MatrixXd>(joints.values.data(), static_cast<Eigen::Index>(joints.row_size),
                                               static_cast<Eigen::Index>(joints.rows));
  result.verdict = {fmt::format("rate: {} Hz, {} frames", motion.rate_hz, position.rows),
                    fmt::format("joints: {}", joints.row_size), rotation_sentence};
  read_bodies(pickle, dict, position.rows, result);
  read_more(pickle, dict, result);
  return result;
}

PickledMotion parse_motion_pickle(std::string_view bytes, const std::string& name) {
  return motion_of_pickle(parse_pickle(bytes, name));
}

PickledMotion read_motion_pickle(const std::string& path) {
  return parse_motion_pickle(read_data(path, kMostMotionBytes), path);
}

}  // namespace duet
