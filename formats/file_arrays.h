// Between the arrays of files, row by row, and those of this program. Pure functions.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/core/robot_motion.h"
#include "duet/formats/file_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

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
