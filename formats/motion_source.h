// The content of a motion file or folder, opened once by what its first bytes say, so that every format can look
// whether it is its own. Nothing in it is executed, and no name in it becomes a path.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/npy/npy.h"
#include "duet/archives/npy/npz.h"
#include "duet/archives/pickle/pickle_node.h"
#include "duet/core/recording.h"
#include "duet/formats/file_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Tables of numbers in any dialect of CSV (archives/csv.h): an optional line of names, lines that begin with '#' for
// what else is known. Thread-safe.

struct CsvTable {
  std::string name;                         // of the file, for messages
  std::vector<std::string> columns;         // empty where no line names them
  std::map<std::string, std::string> meta;  // of lines "# key: value" and "# key = value"
  Eigen::MatrixXd values;                   // (columns, rows): one column of the matrix is one line of the file

  [[nodiscard]] int rows() const { return static_cast<int>(values.cols()); }
  // Row of `values` by the name of the column; -1 where there is none.
  [[nodiscard]] int find(std::string_view column) const;
  // Throws InputError naming the file, the column and those that are there.
  [[nodiscard]] int get(std::string_view column) const;
};

// The first line with text that is not a number names the columns. Throws InputError naming file, line and column: no
// line, a field that is no finite number, lines of different length, a name that stands twice.
CsvTable parse_csv_table(std::string_view text, const std::string& name);

// `values` as above, nine significant digits, one line each.
std::string csv_text(std::span<const std::string> columns, const Eigen::MatrixXd& values);

enum class MotionContainer { kNpz, kNpy, kPickle, kTable, kFolder };
std::string_view to_string(MotionContainer container);  // "an NPZ archive", ...

// The content of a file or folder: only the member of the five that `container` names is set.
struct MotionSource {
  std::string path = {};  // for messages
  MotionContainer container = MotionContainer::kTable;
  std::optional<Npz> npz = {};
  std::optional<NpyArray> npy = {};
  std::optional<Pickle> pickle = {};  // its views are into `bytes`
  std::optional<CsvTable> table = {};
  std::map<std::string, std::string> files = {};  // of a folder: name -> content
  std::unique_ptr<const std::string> bytes = {};  // on the heap: views stay when the source moves

  [[nodiscard]] bool has(const std::string& npz_key) const { return npz && npz->contains(npz_key); }
};

// Throws InputError naming `name`: an empty file, and what the container's own reader says. NPZ arrays of Python
// objects are left out.
MotionSource motion_source(std::string bytes, const std::string& name);

// A file, or a folder: of that the plain files "*.csv" and "*.txt", links refused.
MotionSource open_motion_source(const std::string& path);

// Between the arrays of files, row by row, and those of this program. Pure functions.

// Rows of 3, of 4 and of `width` numbers.
std::vector<Eigen::Vector3d> vectors_of(std::span<const double> values);
std::vector<Eigen::Vector4d> quaternions_of(std::span<const double> values);
Eigen::MatrixXd columns_of(std::span<const double> values, std::size_t width);  // (width, rows)

// Root and joints of a generalised position: p, a quaternion, `joints` angles; what follows is left out. `qpos`:
// (width, T), at least 7 + joints high.
void take_qpos(const Eigen::MatrixXd& qpos, Eigen::Index joints, FileMotion& motion);

// Numbers of an array of any shape whose last size is the width. (width, rows)
Eigen::MatrixXd matrix_of(const Npz& npz, const std::string& key);

// Base positions (3, T), quaternions (4, T) in either order, of a motion.
Eigen::MatrixXd root_positions(const RobotMotion& motion);
Eigen::MatrixXd root_quaternions(const RobotMotion& motion, QuaternionOrder order);

// Rows of `matrix` at `rows`.
Eigen::MatrixXd rows_of(const Eigen::MatrixXd& matrix, const std::vector<int>& rows);
// The rows of a, then those of b.
Eigen::MatrixXd stacked(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

// The numbers of a (width, T) matrix as rows of an array of shape (T, width), or (T, width / last, last).
void put_rows(Npz& npz, const std::string& key, const Eigen::MatrixXd& matrix, std::size_t last = 0);

std::vector<std::string> joint_names(const RobotModel& robot, const std::vector<int>& joints);
std::vector<std::string> link_names(const RobotModel& robot, const std::vector<int>& links);

// A rate as these files have it: an integer where it is one.
bool is_whole(double rate_hz);

}  // namespace duet
