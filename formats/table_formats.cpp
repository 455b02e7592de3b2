#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "duet/core/require.h"
#include "duet/formats/format_row.h"
#include "duet/formats/motion_source.h"

namespace duet {
namespace {

constexpr Eigen::Index kRootColumns = 7;
constexpr std::string_view kBonesJoint = "_dof";
const std::array<std::string, 8> kToolsRoot = {"time",    "root_x",  "root_y",  "root_z",
                                               "root_qx", "root_qy", "root_qz", "root_qw"};
constexpr std::string_view kToolsJoint = "dof_";
constexpr double kSameRate = 0.01;  // what two statements of a rate may differ by, as a share

// From the mean step of the column of times. Throws InputError where they do not ascend.
std::optional<double> rate_of_times(const CsvTable& table) {
  const int time = table.find(kToolsRoot[0]);
  if (time < 0 || table.rows() < 2) return std::nullopt;
  const double span = table.values(time, table.rows() - 1) - table.values(time, 0);
  if (!(span > 0.0))
    throw InputError(fmt::format("'{}': column 'time': expected ascending times, found {} s in all", table.name, span));
  return (table.rows() - 1) / span;
}

// From the meta line, else from the times; a sentence where the two disagree.
std::optional<double> rate_of(const CsvTable& table, std::vector<std::string>& evidence) {
  const std::optional<double> by_times = rate_of_times(table);
  for (const char* key : {"sample_rate", "fps"}) {
    const auto found = table.meta.find(key);
    if (found == table.meta.end()) continue;
    if (const std::optional<double> rate = parse_number(found->second); rate && *rate > 0.0) {
      if (by_times && std::abs(*by_times / *rate - 1.0) > kSameRate)
        evidence.push_back(
            fmt::format("doubt: '{}' of the file says {} Hz, its column 'time' {:.5g} Hz", key, *rate, *by_times));
      return rate;
    }
    throw InputError(fmt::format("'{}': {}: expected a rate above 0 Hz, found '{}'", table.name, key, found->second));
  }
  return by_times;
}

// ---- Unitree and LAFAN1: without names, or with a line of them

// A named column of the root: an axis, of its position or of its quaternion.
struct RootColumn {
  char axis = '\0';
  bool rotation = false;
};

// "root_x", "pos_x", "x" and "qw", "quat_w", "rot_x", ...; none for a joint.
std::optional<RootColumn> root_column(std::string name) {
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (name.empty() || std::string_view("xyzw").find(name.back()) == std::string_view::npos) return std::nullopt;
  const char axis = name.back();
  name.pop_back();
  for (const std::string_view part : {"root", "base", "pelvis", "_", ".", " "})
    for (std::size_t at = name.find(part); at != std::string::npos; at = name.find(part)) name.erase(at, part.size());
  for (const std::string_view turn : {"q", "quat", "quaternion", "rot", "rotation", "orientation", "ori"})
    if (name == turn) return RootColumn{axis, true};
  for (const std::string_view place : {"", "p", "pos", "position", "t", "trans", "translate", "translation"})
    if (name == place && axis != 'w') return RootColumn{axis, false};
  return std::nullopt;
}

// Columns of x, y, z and of the quaternion's x, y, z, w; -1 where no name says so.
std::array<int, kRootColumns> named_root(const CsvTable& table) {
  std::array<int, kRootColumns> row{};
  row.fill(-1);
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const std::optional<RootColumn> found = root_column(table.columns[c]);
    if (!found) continue;
    const std::size_t place = std::string_view("xyzw").find(found->axis) + (found->rotation ? 3 : 0);
    if (row[place] < 0) row[place] = static_cast<int>(c);
  }
  return row;
}

bool names_a_root(const CsvTable& table) {
  const std::array<int, kRootColumns> row = named_root(table);
  return std::all_of(row.begin(), row.end(), [](int column) { return column >= 0; });
}

bool is_unitree(const MotionSource& source) {
  if (!source.table || source.table->values.rows() <= kRootColumns) return false;
  if (source.table->columns.empty()) return true;
  return source.table->find(kToolsRoot[4]) < 0 && names_a_root(*source.table);
}

// Rates that recordings have, the common ones and those of NTSC.
bool is_common_rate(double rate_hz) {
  for (const double common :
       {20.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 72.0, 90.0, 100.0, 120.0, 144.0, 200.0, 240.0, 250.0, 500.0, 1000.0})
    if (std::abs(rate_hz - common) < 1e-9 || std::abs(rate_hz - common / 1.001) < 0.01) return true;
  return false;
}

// The whole number that ends at `end`, and where it begins.
std::size_t digits_before(std::string_view text, std::size_t end) {
  while (end > 0 && std::isdigit(static_cast<unsigned char>(text[end - 1])) != 0) --end;
  return end;
}

// "60" of "take_102.bvh_60hz.csv", 119.88 of "walk_119.88hz.csv". In "take_119_88hz.csv" both 88 and 119.88 can be
// meant: the one that recordings have. Throws InputError where that decides nothing.
std::optional<double> rate_in_name(const std::string& path) {
  std::string name = std::filesystem::path(path).filename().string();
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  std::size_t unit = std::min(name.find("hz"), name.find("fps"));
  if (unit == std::string::npos) return std::nullopt;
  if (unit > 1 && std::string_view("_- ").find(name[unit - 1]) != std::string_view::npos) --unit;
  const std::string_view text(name.data(), unit);
  const std::size_t begin = digits_before(text, unit);
  const std::optional<double> whole = parse_number(text.substr(begin));
  if (!whole || *whole <= 0.0) return std::nullopt;
  if (begin < 2 || std::string_view("._").find(text[begin - 1]) == std::string_view::npos) return whole;
  const std::size_t first = digits_before(text, begin - 1);
  const bool word = first > 0 && std::isalpha(static_cast<unsigned char>(text[first - 1])) != 0;
  if (first == begin - 1 || word) return whole;
  const std::optional<double> decimal =
      parse_number(fmt::format("{}.{}", text.substr(first, begin - 1 - first), text.substr(begin)));
  if (!decimal || text[begin - 1] == '.') return decimal;
  if (is_common_rate(*whole) != is_common_rate(*decimal)) return is_common_rate(*whole) ? whole : decimal;
  throw InputError(
      fmt::format("'{}': the file's name may say {} Hz or {} Hz; say which with --rate", path, *whole, *decimal));
}

// The name of a joint without what writers put around it.
std::string bare_joint(const std::string& column) {
  std::string_view name = column;
  if (name.starts_with(kToolsJoint)) name.remove_prefix(kToolsJoint.size());
  if (name.ends_with(kBonesJoint)) name.remove_suffix(kBonesJoint.size());
  return std::string(name);
}

bool counts_frames(std::string_view column) {
  for (const std::string_view name : {"time", "Time", "timestamp", "t", "frame", "Frame", "index"})
    if (column == name) return true;
  return false;
}

// Root and joints as the line of names says, wherever they stand.
void take_named_columns(const CsvTable& table, FileMotion& motion) {
  const std::array<int, kRootColumns> root = named_root(table);
  if (!names_a_root(table))
    throw InputError(
        fmt::format("'{}': line 1 names columns, but not the root's x, y, z and quaternion (root_x, "
                    "root_y, root_z, qx, qy, qz, qw): {}",
                    table.name, excerpt(fmt::format("{}", fmt::join(table.columns, ", ")), kShownSentence)));
  std::vector<int> rows;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const int column = static_cast<int>(c);
    if (std::find(root.begin(), root.end(), column) != root.end() || counts_frames(table.columns[c])) continue;
    motion.joint_names.push_back(bare_joint(table.columns[c]));
    rows.push_back(column);
  }
  const Eigen::MatrixXd qpos = rows_of(table.values, {root.begin(), root.end()});
  take_qpos(qpos, 0, motion);
  motion.q = rows_of(table.values, rows);
  motion.quaternion_witness = QuaternionOrder::kXyzw;
  motion.evidence.emplace_back("root: its columns are bound by name");
}

FileMotion read_unitree(const MotionSource& source, const RobotModel& /*robot*/, const RobotMotionOptions& options) {
  FileMotion motion{.path = source.path};
  const CsvTable& table = *source.table;
  if (table.columns.empty()) {
    take_qpos(table.values, table.values.rows() - kRootColumns, motion);
  } else {
    take_named_columns(table, motion);
    motion.rate_hz = rate_of(table, motion.evidence);
  }
  if (options.rate_hz || motion.rate_hz) return motion;
  motion.rate_hz = rate_in_name(source.path);
  if (motion.rate_hz) motion.evidence.push_back(fmt::format("the file's name says {} Hz", *motion.rate_hz));
  return motion;
}

MotionFiles write_unitree(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& /*writing*/) {
  const Eigen::MatrixXd root = stacked(root_positions(motion), root_quaternions(motion, QuaternionOrder::kXyzw));
  return {{"", csv_text({}, stacked(root, rows_of(motion.q, joints_in_order(robot, TreeOrder::kDepthFirst))))}};
}

// ---- BONES-SEED

const std::array<std::string, 7> kBonesRoot = {"Frame",        "root_translateX", "root_translateY", "root_translateZ",
                                               "root_rotateX", "root_rotateY",    "root_rotateZ"};
constexpr double kCentimetre = 0.01;
constexpr double kDegree = std::numbers::pi / 180.0;

bool is_bones(const MotionSource& source) { return source.table && source.table->find(kBonesRoot[1]) >= 0; }

// Columns whose name has the prefix and the suffix, as joints.
void take_named_joints(const CsvTable& table, std::string_view prefix, std::string_view suffix, FileMotion& motion) {
  std::vector<int> rows;
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    const std::string& name = table.columns[c];
    if (name.size() <= prefix.size() + suffix.size() || !name.starts_with(prefix) || !name.ends_with(suffix)) continue;
    motion.joint_names.push_back(name.substr(prefix.size(), name.size() - prefix.size() - suffix.size()));
    rows.push_back(static_cast<int>(c));
  }
  if (rows.empty())
    throw InputError(fmt::format("'{}': expected columns '{}<joint>{}', found none", table.name, prefix, suffix));
  motion.q = rows_of(table.values, rows);
}

FileMotion read_bones(const MotionSource& source, const RobotModel& /*robot*/, const RobotMotionOptions& /*options*/) {
  const CsvTable& table = *source.table;
  FileMotion motion{.path = source.path};
  std::array<int, 6> row{};
  for (std::size_t i = 0; i < row.size(); ++i) row[i] = table.get(kBonesRoot[i + 1]);
  for (int t = 0; t < table.rows(); ++t) {
    motion.position.emplace_back(table.values(row[0], t), table.values(row[1], t), table.values(row[2], t));
    motion.euler.emplace_back(table.values(row[3], t), table.values(row[4], t), table.values(row[5], t));
  }
  take_named_joints(table, "", kBonesJoint, motion);
  return motion;
}

// Turns about the fixed axes x, then y, then z; at a pitch of 90 degrees the first is 0. [rad]
Eigen::Vector3d fixed_axis_turns(const Eigen::Quaterniond& rotation) {
  const Eigen::Matrix3d R = rotation.toRotationMatrix();
  const double level = std::hypot(R(0, 0), R(1, 0));
  constexpr double kUpright = 1e-9;
  if (level < kUpright) return {0.0, std::atan2(-R(2, 0), level), std::atan2(-R(0, 1), R(1, 1))};
  return {std::atan2(R(2, 1), R(2, 2)), std::atan2(-R(2, 0), level), std::atan2(R(1, 0), R(0, 0))};
}

MotionFiles write_bones(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& /*writing*/) {
  const std::vector<int> joints = joints_in_order(robot, TreeOrder::kDepthFirst);
  Eigen::MatrixXd root(7, motion.frames());
  for (int t = 0; t < motion.frames(); ++t) {
    const Pose& X_WB = motion.root[static_cast<std::size_t>(t)];
    root.col(t) << t, X_WB.p / kCentimetre, fixed_axis_turns(X_WB.R) / kDegree;
  }
  std::vector<std::string> columns(kBonesRoot.begin(), kBonesRoot.end());
  for (const std::string& name : joint_names(robot, joints)) columns.push_back(name + std::string(kBonesJoint));
  return {{"", csv_text(columns, stacked(root, rows_of(motion.q, joints) / kDegree))}};
}

// ---- hhtools

bool is_hhtools(const MotionSource& source) { return source.table && source.table->find(kToolsRoot[4]) >= 0; }

FileMotion read_hhtools(const MotionSource& source, const RobotModel& /*robot*/,
                        const RobotMotionOptions& /*options*/) {
  const CsvTable& table = *source.table;
  FileMotion motion{.path = source.path};
  motion.rate_hz = rate_of(table, motion.evidence);
  std::array<int, 7> row{};
  for (std::size_t i = 0; i < row.size(); ++i) row[i] = table.get(kToolsRoot[i + 1]);
  for (int t = 0; t < table.rows(); ++t) {
    motion.position.emplace_back(table.values(row[0], t), table.values(row[1], t), table.values(row[2], t));
    motion.quaternion.emplace_back(table.values(row[3], t), table.values(row[4], t), table.values(row[5], t),
                                   table.values(row[6], t));
  }
  take_named_joints(table, kToolsJoint, "", motion);
  return motion;
}

MotionFiles write_hhtools(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& /*writing*/) {
  const std::vector<int> joints = joints_in_order(robot, TreeOrder::kDepthFirst);
  Eigen::MatrixXd time(1, motion.frames());
  for (int t = 0; t < motion.frames(); ++t) time(0, t) = t / motion.rate_hz;
  std::vector<std::string> columns(kToolsRoot.begin(), kToolsRoot.end());
  for (const std::string& name : joint_names(robot, joints)) columns.push_back(std::string(kToolsJoint) + name);
  const Eigen::MatrixXd root = stacked(root_positions(motion), root_quaternions(motion, QuaternionOrder::kXyzw));
  return {{"", fmt::format("# sample_rate: {}\n", motion.rate_hz) +
                   csv_text(columns, stacked(stacked(time, root), rows_of(motion.q, joints)))}};
}

}  // namespace

std::vector<RobotMotionFormat> table_formats() {
  return {
      {.name = "unitree",
       .about = "Unitree's LAFAN1 retargeting and what follows it (rl_sar; a rate in the file's name counts)",
       .holds = "CSV: x, y, z, quaternion, n joint angles; bound by name where the first line names them",
       .evidence = "unitreerobotics/LAFAN1_Retargeting_Dataset README; whole_body_tracking csv_to_npz.py",
       .licence = "see the data set's card",
       .ending = ".csv",
       .container = MotionContainer::kTable,
       .layout = {.quaternion = QuaternionOrder::kXyzw, .rate_hz = 30.0},
       .holds_rate = false,
       .recognises = is_unitree,
       .read = read_unitree,
       .write = write_unitree},
      {.name = "bones",
       .about = "BONES-SEED: centimetres and degrees, root as turns about the fixed axes x, y, z",
       .holds = "CSV: Frame, root_translateX, Y, Z, root_rotateX, Y, Z, <joint>_dof",
       .evidence = "NVlabs/ProtoMotions data/scripts/convert_g1_csv_to_proto.py",
       .licence = "see the data set's card",
       .ending = ".csv",
       .container = MotionContainer::kTable,
       .layout = {.turns = true, .angles = AngleUnit::kDegrees, .metres = kCentimetre, .rate_hz = 120.0},
       .holds_rate = false,
       .recognises = is_bones,
       .read = read_bones,
       .write = write_bones},
      {.name = "hhtools",
       .about = "human-humanoid-tools",
       .holds = "CSV: lines '# key: value', then time, root_x, root_y, root_z, root_qx, root_qy, root_qz, root_qw, "
                "dof_<joint>",
       .evidence = "Roboparty/human-humanoid-tools hhtools/io/robot_csv.py",
       .licence = "Apache-2.0",
       .ending = ".csv",
       .container = MotionContainer::kTable,
       .layout = {.quaternion = QuaternionOrder::kXyzw},
       .recognises = is_hhtools,
       .read = read_hhtools,
       .write = write_hhtools},
  };
}

}  // namespace duet
