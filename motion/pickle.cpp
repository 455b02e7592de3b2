#include "motion/pickle.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "core/file.h"
#include "core/names.h"
#include "core/require.h"
#include "core/text.h"
#include "motion/pickle_machine.h"

namespace duet {
namespace {

constexpr std::size_t kMostMotionBytes = std::size_t{1} << 30;  // hours of one robot
constexpr double kUnitTolerance = 1e-6;
constexpr double kRepairable = 0.1;  // deviation of a quaternion's length from 1 that is renormalised
const std::array<std::string, 6> kKeys = {"fps", "root_pos", "root_rot", "dof_pos", "local_body_pos", "link_body_list"};

class MotionDict {
 public:
  explicit MotionDict(const Pickle& pickle) : pickle_(pickle) {
    const PickleNode& root = pickle[pickle.root];
    if (root.kind != PickleKind::kDict)
      pickle.fail(root.offset, fmt::format("expected a dict, found {}", to_string(root.kind)));
    for (std::size_t i = 0; i + 1 < root.items.size(); i += 2) add(pickle[root.items[i]], root.items[i + 1]);
  }

  // nullptr where the key is absent or None.
  [[nodiscard]] const PickleNode* find(const std::string& key) const {
    const auto found = values_.find(key);
    if (found == values_.end() || pickle_[found->second].kind == PickleKind::kNone) return nullptr;
    return &pickle_[found->second];
  }
  [[nodiscard]] const PickleNode& get(const std::string& key) const {
    if (const PickleNode* node = find(key)) return *node;
    std::vector<std::string> found;
    for (const auto& [name, node] : values_) found.push_back(name);
    throw InputError(fmt::format("'{}': missing key '{}'; keys found: {}", pickle_.name, key,
                                 shown(fmt::format("{}", fmt::join(found, ", ")), kShownSentence)));
  }

 private:
  void add(const PickleNode& key, int value) {
    if (key.kind != PickleKind::kText)
      pickle_.fail(key.offset, fmt::format("expected a string as key, found {}", to_string(key.kind)));
    const std::string name(key.text);
    if (std::find(kKeys.begin(), kKeys.end(), name) == kKeys.end())
      pickle_.fail(key.offset, unknown_name_message("key", name, kKeys));
    if (!values_.emplace(name, value).second)
      pickle_.fail(key.offset, fmt::format("key '{}' is there twice", shown(name)));
  }

  const Pickle& pickle_;
  std::map<std::string, int> values_;
};

struct Table {
  std::size_t rows = 0;
  std::size_t row_size = 0;
  std::vector<double> values;
};

std::string shape_text(std::size_t frames, const std::vector<std::size_t>& rest) {
  std::string text = frames == 0 ? "(T" : fmt::format("({}", frames);
  for (const std::size_t size : rest) text += size == 0 ? ", n" : fmt::format(", {}", size);
  return text + ")";
}

// An array of `frames` rows (0: any number of at least 2) of shape `rest` (0: any size), all finite.
Table get_table(const Pickle& pickle, const PickleNode& node, const std::string& key, std::size_t frames,
                const std::vector<std::size_t>& rest) {
  const std::string what = "key '" + key + "'";
  Table table{.values = array_values(pickle, node, what)};
  bool fits = node.shape.size() == rest.size() + 1 && (frames == 0 || node.shape[0] == frames);
  for (std::size_t d = 0; fits && d < rest.size(); ++d)
    fits = rest[d] == 0 ? node.shape[d + 1] > 0 : node.shape[d + 1] == rest[d];
  if (!fits)
    pickle.fail(node.offset, fmt::format("{}: expected shape {}, found ({})", what, shape_text(frames, rest),
                                         fmt::join(node.shape, ", ")));
  table.rows = node.shape[0];
  if (table.rows < 2 || table.rows > 100'000'000)
    pickle.fail(node.offset, fmt::format("{}: expected at least 2 frames, found {}", what, table.rows));
  table.row_size = table.values.size() / table.rows;
  for (std::size_t i = 0; i < table.values.size(); ++i)
    if (!std::isfinite(table.values[i]))
      pickle.fail(node.offset,
                  fmt::format("{}: frame {}, number {} is not finite", what, i / table.row_size, i % table.row_size));
  return table;
}

double get_rate(const Pickle& pickle, const PickleNode& node) {
  double rate_hz = 0.0;
  if (node.kind == PickleKind::kFloat) {
    rate_hz = node.number;
  } else if (node.kind == PickleKind::kInt) {
    rate_hz = static_cast<double>(node.integer);
  } else {
    const std::vector<double> values = array_values(pickle, node, "key 'fps'");
    if (values.size() != 1)
      pickle.fail(node.offset, fmt::format("key 'fps': expected one number, found {}", values.size()));
    rate_hz = values[0];
  }
  if (!std::isfinite(rate_hz) || rate_hz <= 0.0)
    pickle.fail(node.offset, fmt::format("key 'fps': expected a positive rate, found {}", rate_hz));
  return rate_hz;
}

// Rotations of the root; the sentence says what had to be mended.
std::vector<Eigen::Quaterniond> get_rotations(const Pickle& pickle, const PickleNode& node, const Table& quat_xyzw,
                                              std::string& sentence) {
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

std::vector<std::string> get_names(const Pickle& pickle, const PickleNode& node) {
  if (node.kind != PickleKind::kList && node.kind != PickleKind::kTuple)
    pickle.fail(node.offset, fmt::format("key 'link_body_list': expected a list, found {}", to_string(node.kind)));
  std::vector<std::string> names;
  for (const int item : node.items) {
    const PickleNode& name = pickle[item];
    if (name.kind != PickleKind::kText)
      pickle.fail(name.offset, fmt::format("key 'link_body_list': expected a string, found {}", to_string(name.kind)));
    names.emplace_back(name.text);
  }
  return names;
}

void read_bodies(const Pickle& pickle, const MotionDict& dict, std::size_t frames, PickledMotion& result) {
  if (const PickleNode* names = dict.find("link_body_list")) result.link_body_list = get_names(pickle, *names);
  const PickleNode* positions = dict.find("local_body_pos");
  if (positions == nullptr) {
    result.verdict.emplace_back("local_body_pos: none");
    return;
  }
  Table table = get_table(pickle, *positions, "local_body_pos", frames, {result.link_body_list.size(), 3});
  const int bodies = static_cast<int>(table.row_size / 3);
  result.local_body_pos = PointTracks(static_cast<int>(table.rows), bodies, std::move(table.values));
  result.verdict.push_back(fmt::format("local_body_pos: {} bodies, {} named", bodies, result.link_body_list.size()));
}

}  // namespace

PickledMotion parse_motion_pickle(std::string_view bytes, const std::string& name) {
  const Pickle pickle = parse_pickle(bytes, name);
  const MotionDict dict(pickle);
  PickledMotion result;
  RobotMotion& motion = result.motion;
  motion.rate_hz = get_rate(pickle, dict.get("fps"));
  const Table position = get_table(pickle, dict.get("root_pos"), "root_pos", 0, {3});
  const PickleNode& rotation = dict.get("root_rot");
  const Table quat_xyzw = get_table(pickle, rotation, "root_rot", position.rows, {4});
  const Table joints = get_table(pickle, dict.get("dof_pos"), "dof_pos", position.rows, {0});

  std::string rotation_sentence;
  const std::vector<Eigen::Quaterniond> rotations = get_rotations(pickle, rotation, quat_xyzw, rotation_sentence);
  for (std::size_t t = 0; t < position.rows; ++t)
    motion.root.push_back({.R = rotations[t], .p = Eigen::Map<const Eigen::Vector3d>(&position.values[3 * t])});
  motion.q = Eigen::Map<const Eigen::MatrixXd>(joints.values.data(), static_cast<Eigen::Index>(joints.row_size),
                                               static_cast<Eigen::Index>(joints.rows));
  result.verdict = {fmt::format("rate: {} Hz, {} frames", motion.rate_hz, position.rows),
                    fmt::format("joints: {}, not named by the file", joints.row_size), rotation_sentence};
  read_bodies(pickle, dict, position.rows, result);
  return result;
}

PickledMotion read_motion_pickle(const std::string& path) {
  return parse_motion_pickle(read_file(path, kMostMotionBytes), path);
}

}  // namespace duet
