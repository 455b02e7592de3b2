#include "duet/formats/table_formats.h"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "duet/core/number.h"
#include "duet/core/require.h"
#include "duet/formats/file_arrays.h"

namespace duet {
namespace {

constexpr Eigen::Index kRootColumns = 7;

// ---- Unitree and LAFAN1: no names

bool is_unitree(const MotionSource& source) {
  return source.table && source.table->columns.empty() && source.table->values.rows() > kRootColumns;
}

// "60" of "take_102.bvh_60hz.csv".
std::optional<double> rate_in_name(const std::string& path) {
  std::string name = std::filesystem::path(path).filename().string();
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  const std::size_t unit = name.find("hz");
  if (unit == std::string::npos) return std::nullopt;
  std::size_t begin = unit;
  while (begin > 0 && (std::isdigit(static_cast<unsigned char>(name[begin - 1])) != 0)) --begin;
  const std::optional<double> rate = parse_number(std::string_view(name).substr(begin, unit - begin));
  return rate && *rate > 0.0 ? rate : std::nullopt;
}

FileMotion read_unitree(const MotionSource& source, const RobotModel& /*robot*/,
                        const RobotMotionOptions& /*options*/) {
  FileMotion motion{.path = source.path};
  const Eigen::MatrixXd& rows = source.table->values;
  take_qpos(rows, rows.rows() - kRootColumns, motion);
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
constexpr std::string_view kBonesJoint = "_dof";
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

const std::array<std::string, 8> kToolsRoot = {"time",    "root_x",  "root_y",  "root_z",
                                               "root_qx", "root_qy", "root_qz", "root_qw"};
constexpr std::string_view kToolsJoint = "dof_";

bool is_hhtools(const MotionSource& source) { return source.table && source.table->find(kToolsRoot[4]) >= 0; }

// From the meta line, else from the mean step of the column of times.
std::optional<double> rate_of(const CsvTable& table) {
  for (const char* key : {"sample_rate", "fps"}) {
    const auto found = table.meta.find(key);
    if (found == table.meta.end()) continue;
    if (const std::optional<double> rate = parse_number(found->second); rate && *rate > 0.0) return rate;
    throw InputError(fmt::format("'{}': {}: expected a rate above 0 Hz, found '{}'", table.name, key, found->second));
  }
  const int time = table.find(kToolsRoot[0]);
  if (time < 0 || table.rows() < 2) return std::nullopt;
  const double span = table.values(time, table.rows() - 1) - table.values(time, 0);
  if (!(span > 0.0))
    throw InputError(fmt::format("'{}': column 'time': expected ascending times, found {} s in all", table.name, span));
  return (table.rows() - 1) / span;
}

FileMotion read_hhtools(const MotionSource& source, const RobotModel& /*robot*/,
                        const RobotMotionOptions& /*options*/) {
  const CsvTable& table = *source.table;
  FileMotion motion{.path = source.path, .rate_hz = rate_of(table)};
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
       .holds = "CSV without names: x, y, z, quaternion, n joint angles",
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
