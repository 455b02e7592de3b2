// Options of the commands that read robot motions of other tools: what is known better than a file says.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "duet/formats/robot_motion_format.h"

namespace duet::cli {

struct RobotMotionArguments {
  std::string quaternion, joints, angles;
  RobotMotionOptions options;  // the names above are not in it
};

// --quaternion, --joints, --angles, --motion; format, rate and units are options that the commands name themselves.
void add_robot_motion_options(CLI::App& command, RobotMotionArguments& arguments);

// Throws std::invalid_argument for an unknown name.
RobotMotionOptions options_of(const RobotMotionArguments& arguments);

}  // namespace duet::cli
