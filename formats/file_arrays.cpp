#include "duet/formats/file_arrays.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "duet/core/require.h"

namespace duet {

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
