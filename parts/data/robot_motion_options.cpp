#include "duet/parts/data/robot_motion_options.h"

namespace duet::cli {

void add_robot_motion_options(CLI::App& command, RobotMotionArguments& arguments) {
  command.add_option("--quaternion", arguments.quaternion, "of a robot's root: xyzw or wxyz (default: detected)");
  command.add_option("--joints", arguments.joints,
                     "order of a robot's joints: depth-first or breadth-first (default: detected)");
  command.add_option("--angles", arguments.angles, "of a robot's joints: rad or deg (default: detected)");
  command.add_option("--motion", arguments.options.motion, "of a file with several robot motions: its name or number");
}

RobotMotionOptions options_of(const RobotMotionArguments& arguments) {
  RobotMotionOptions options = arguments.options;
  if (!arguments.quaternion.empty()) options.quaternion = parse_quaternion_order(arguments.quaternion);
  if (!arguments.joints.empty()) options.joints = parse_tree_order(arguments.joints);
  if (!arguments.angles.empty()) options.angles = parse_angle_unit(arguments.angles);
  return options;
}

}  // namespace duet::cli
