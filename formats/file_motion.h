// A robot's motion as a file holds it, and how it becomes a RobotMotion: the facts that files of one kind leave open
// (joint order, quaternion order, units, rate) are taken as documented, held against the robot's kinematics, and said.
// Pure functions.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/formats/motion_layout.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct FileMotion {
  std::string path = {};                                   // for messages
  std::optional<double> rate_hz = {};                      // where the file says
  std::vector<Eigen::Vector3d> position = {};              // of the base, T entries [file's unit]
  std::vector<Eigen::Vector4d> quaternion = {};            // of the base, in the file's order; or
  std::vector<Eigen::Vector3d> euler = {};                 // turns about the fixed axes x, then y, then z [file's unit]
  Eigen::MatrixXd q = {};                                  // (columns, T) [file's unit]
  std::vector<std::string> joint_names = {};               // of the columns, empty where the file has none
  std::optional<QuaternionOrder> quaternion_witness = {};  // what another array of the file says of the order
  // Where bodies were, as a witness: in W, or of the base (`bodies_in_base`). [m]
  PointTracks bodies = {};
  bool bodies_in_base = false;
  std::vector<std::string> body_names = {};  // empty: all links of the robot in one of the two orders, or
  std::vector<int> body_numbers = {};        // those at these places of the order
  std::vector<std::string> evidence = {};    // sentences of the reader

  [[nodiscard]] int frames() const { return static_cast<int>(position.size()); }
};

struct RobotMotionFile {
  std::string format;                      // name of the row that read it
  RobotMotion motion;                      // joints of the robot, in its order; validated
  std::vector<std::string> evidence;       // one sentence for each fact: what it is, and what tells
  std::optional<double> kinematics_error;  // worst distance of a body of the file from our kinematics [m]
};

// Throws InputError naming the file: a joint count or names that do not fit the robot, a quaternion more than 0.1 off
// unit length (nearer ones are renormalised), a value that is not finite, fewer than 2 frames, arrays that disagree, a
// rate out of its range, more than 24 hours.
RobotMotionFile interpret(const FileMotion& file, const MotionLayout& layout, const RobotModel& robot,
                          const RobotMotionOptions& options);

}  // namespace duet
