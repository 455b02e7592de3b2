#include "duet/formats/motion_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>

#include "duet/archives/csv.h"
#include "duet/archives/npy/npy.h"
#include "duet/archives/pickle/pickle_files.h"
#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::int64_t kMostSourceBytes = std::int64_t{1} << 30;  // hours of one robot
constexpr std::size_t kMostFolderFiles = 1000;
constexpr std::string_view kZipMagic = "PK";
constexpr std::string_view kNpyMagic = "\x93NUMPY";
constexpr char kPickleMagic = '\x80';

bool is_pickle_name(const std::string& name) {
  const std::string ending = std::filesystem::path(name).extension().string();
  return ending == ".pkl" || ending == ".pickle" || ending == ".joblib";
}

bool belongs_to_motion(const std::filesystem::path& file) {
  return file.extension() == ".csv" || file.extension() == ".txt";
}

MotionSource open_folder(const std::string& path) {
  MotionSource source{.path = path, .container = MotionContainer::kFolder};
  std::int64_t left = kMostSourceBytes;
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    const std::string name = entry.path().filename().string();
    if (!belongs_to_motion(entry.path())) continue;
    if (source.files.size() == kMostFolderFiles)
      throw InputError(
          fmt::format("'{}': expected the folder of one motion, found more than {} files", path, kMostFolderFiles));
    std::string content = read_data(join_without_links(path, name), left);
    left -= static_cast<std::int64_t>(content.size());
    source.files.emplace(name, std::move(content));
  }
  return source;
}

}  // namespace

std::string_view to_string(MotionContainer container) {
  switch (container) {
    case MotionContainer::kNpz:
      return "an NPZ archive";
    case MotionContainer::kNpy:
      return "an NPY array";
    case MotionContainer::kPickle:
      return "a pickle";
    case MotionContainer::kTable:
      return "a table of numbers";
    case MotionContainer::kFolder:
      break;
  }
  return "a folder";
}

MotionSource motion_source(std::string bytes, const std::string& name) {
  if (bytes.empty()) throw InputError(fmt::format("'{}': the file is empty", name));
  MotionSource source{.path = name, .bytes = std::make_unique<const std::string>(std::move(bytes))};
  const std::string_view content = *source.bytes;
  if (content.starts_with(kZipMagic)) {
    source.container = MotionContainer::kNpz;
    source.npz = Npz::parse(content, name, ObjectArrays::kSkipped);
  } else if (content.starts_with(kNpyMagic)) {
    source.container = MotionContainer::kNpy;
    try {
      source.npy = parse_npy(content);
    } catch (const InputError& error) {
      throw InputError(fmt::format("'{}': {}", name, error.what()));
    }
  } else if (content.front() == kPickleMagic || is_pickle_name(name)) {
    source.container = MotionContainer::kPickle;
    source.pickle = parse_joblib(content, name);
  } else {
    source.table = parse_csv_table(content, name);
  }
  return source;
}

MotionSource open_motion_source(const std::string& path) {
  if (std::filesystem::is_directory(path)) return open_folder(path);
  return motion_source(read_data(path, kMostSourceBytes), path);
}

namespace {

void read_meta(std::string_view comment, CsvTable& table) {
  const std::string_view text = trimmed(comment.substr(1));
  const std::size_t mark = text.find_first_of(":=");
  if (mark != std::string_view::npos)
    table.meta.emplace(std::string(trimmed(text.substr(0, mark))), std::string(trimmed(text.substr(mark + 1))));
}

// Text that is no number; "nan" and "inf" are numbers that are refused later.
bool names_columns(std::span<const std::string> fields) {
  return std::any_of(fields.begin(), fields.end(), [](const std::string& field) {
    const bool letters = field.find_first_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_") == 0;
    return letters && field != "nan" && field != "inf" && field != "NaN";
  });
}

std::vector<std::string> column_names(const CsvReader& rows) {
  std::vector<std::string> columns;
  for (const std::string& field : rows.fields()) {
    if (std::find(columns.begin(), columns.end(), field) != columns.end())
      rows.fail(fmt::format("column '{}' stands twice", excerpt(field)));
    columns.push_back(field);
  }
  return columns;
}

void take_numbers(const CsvReader& rows, std::vector<double>& values) {
  const auto fields = rows.fields();
  for (std::size_t c = 0; c < fields.size(); ++c) {
    const std::optional<double> value = rows.number(fields[c]);
    if (!value) rows.fail(fmt::format("column {}: expected a finite number, found '{}'", c + 1, excerpt(fields[c])));
    values.push_back(*value);
  }
}

}  // namespace

int CsvTable::find(std::string_view column) const {
  const auto found = std::find(columns.begin(), columns.end(), column);
  return found == columns.end() ? -1 : static_cast<int>(found - columns.begin());
}

int CsvTable::get(std::string_view column) const {
  if (const int found = find(column); found >= 0) return found;
  throw InputError(fmt::format("'{}': no column '{}'. It has: {}", name, column,
                               excerpt(fmt::format("{}", fmt::join(columns, ", ")), kShownSentence)));
}

CsvTable parse_csv_table(std::string_view text, const std::string& name) {
  CsvTable table;
  table.name = name;
  std::vector<double> values;
  std::size_t width = 0;
  CsvReader rows(text, name);
  while (rows.next()) {
    if (rows.blank()) continue;
    const bool names = width == 0 && names_columns(rows.fields());
    if (width == 0) width = rows.fields().size();
    if (rows.fields().size() != width)
      rows.fail(fmt::format("expected {} columns as in the lines before, found {}", width, rows.fields().size()));
    if (names)
      table.columns = column_names(rows);
    else
      take_numbers(rows, values);
  }
  for (const std::string_view comment : rows.comments()) read_meta(comment, table);
  if (values.empty()) throw InputError(fmt::format("'{}': expected lines of numbers, found none", name));
  const auto count = static_cast<Eigen::Index>(values.size() / width);
  table.values = Eigen::Map<const Eigen::MatrixXd>(values.data(), static_cast<Eigen::Index>(width), count);
  return table;
}

std::string csv_text(std::span<const std::string> columns, const Eigen::MatrixXd& values) {
  std::string text;
  if (!columns.empty()) text = fmt::format("{}\n", fmt::join(columns, ","));
  for (Eigen::Index row = 0; row < values.cols(); ++row)
    for (Eigen::Index c = 0; c < values.rows(); ++c)
      fmt::format_to(std::back_inserter(text), "{:.9g}{}", values(c, row), c + 1 < values.rows() ? ',' : '\n');
  return text;
}

std::vector<Eigen::Vector3d> vectors_of(std::span<const double> values) {
  std::vector<Eigen::Vector3d> rows;
  for (std::size_t i = 0; i + 3 <= values.size(); i += 3) rows.emplace_back(values[i], values[i + 1], values[i + 2]);
  return rows;
}

std::vector<Eigen::Vector4d> quaternions_of(std::span<const double> values) {
  std::vector<Eigen::Vector4d> rows;
  for (std::size_t i = 0; i + 4 <= values.size(); i += 4)
    rows.emplace_back(values[i], values[i + 1], values[i + 2], values[i + 3]);
  return rows;
}

Eigen::MatrixXd columns_of(std::span<const double> values, std::size_t width) {
  if (width == 0) return {};
  const auto rows = static_cast<Eigen::Index>(values.size() / width);
  return Eigen::Map<const Eigen::MatrixXd>(values.data(), static_cast<Eigen::Index>(width), rows);
}

void take_qpos(const Eigen::MatrixXd& qpos, Eigen::Index joints, FileMotion& motion) {
  for (Eigen::Index t = 0; t < qpos.cols(); ++t) {
    motion.position.emplace_back(qpos.col(t).head<3>());
    motion.quaternion.emplace_back(qpos.col(t).segment<4>(3));
  }
  motion.q.resize(joints, qpos.cols());
  if (qpos.cols() > 0) motion.q = qpos.middleRows(7, joints);  // without frames there is no row to point at
}

Eigen::MatrixXd matrix_of(const Npz& npz, const std::string& key) {
  const std::vector<std::size_t>& shape = npz.array(key).shape;
  if (shape.size() < 2 || shape.back() == 0)
    throw InputError(fmt::format("'{}': array '{}': expected rows of numbers, found {} dimensions{}", npz.name(), key,
                                 shape.size(), shape.size() < 2 ? "" : " and no columns"));
  const std::vector<long> any(shape.size(), -1);
  return columns_of(npz.numbers(key, any), shape.back());
}

Eigen::MatrixXd root_positions(const RobotMotion& motion) {
  Eigen::MatrixXd p(3, motion.frames());
  for (int t = 0; t < motion.frames(); ++t) p.col(t) = motion.root[static_cast<std::size_t>(t)].p;
  return p;
}

Eigen::MatrixXd root_quaternions(const RobotMotion& motion, QuaternionOrder order) {
  Eigen::MatrixXd quat(4, motion.frames());
  for (int t = 0; t < motion.frames(); ++t) {
    const Eigen::Quaterniond& R = motion.root[static_cast<std::size_t>(t)].R;
    if (order == QuaternionOrder::kXyzw)
      quat.col(t) << R.x(), R.y(), R.z(), R.w();
    else
      quat.col(t) << R.w(), R.x(), R.y(), R.z();
  }
  return quat;
}

Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<int>& rows) {
  Eigen::MatrixXd chosen(static_cast<Eigen::Index>(rows.size()), matrix.cols());
  for (std::size_t i = 0; i < rows.size(); ++i) chosen.row(static_cast<Eigen::Index>(i)) = matrix.row(rows[i]);
  return chosen;
}

Eigen::MatrixXd stacked(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  Eigen::MatrixXd both(a.rows() + b.rows(), a.cols());
  both << a, b;
  return both;
}

void put_rows(Npz& npz, const std::string& key, const Eigen::MatrixXd& matrix, std::size_t last) {
  const auto width = static_cast<std::size_t>(matrix.rows()), rows = static_cast<std::size_t>(matrix.cols());
  std::vector<std::size_t> shape = {rows, width};
  if (last > 0) shape = {rows, width / last, last};
  npz.set(key, std::vector<double>(matrix.data(), matrix.data() + matrix.size()), shape);
}

std::vector<std::string> joint_names(const RobotModel& robot, const std::vector<int>& joints) {
  std::vector<std::string> names;
  names.reserve(joints.size());
  for (const int j : joints) names.push_back(robot.joints[static_cast<std::size_t>(j)].name);
  return names;
}

std::vector<std::string> link_names(const RobotModel& robot, const std::vector<int>& links) {
  std::vector<std::string> names;
  names.reserve(links.size());
  for (const int link : links) names.push_back(robot.links[static_cast<std::size_t>(link)].name);
  return names;
}

bool is_whole(double rate_hz) {
  return rate_hz == std::floor(rate_hz) && rate_hz < static_cast<double>(std::numeric_limits<int>::max());
}

}  // namespace duet
