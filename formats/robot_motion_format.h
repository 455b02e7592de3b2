// Motions of robots in the formats that robot learning uses: one table, from which they are told apart, read, written
// and documented (docs/file-formats.md, "Robot motions"). Nothing in a file is executed. Thread-safe.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/formats/file_motion.h"
#include "duet/formats/format_row.h"

namespace duet {

// Every format. A file belongs to the first row that recognises it.
std::span<const RobotMotionFormat> robot_motion_formats();
std::vector<std::string> robot_motion_format_names();

// The row of that name. Throws std::invalid_argument with the nearest and all known names.
const RobotMotionFormat& robot_motion_format(std::string_view name);

// Reads a file or folder of any of the formats, or of the one that is named. Throws InputError naming the file: no
// format is its own, what its format's reader and interpret() say.
RobotMotionFile read_robot_motion(const std::string& path, const RobotModel& robot,
                                  const RobotMotionOptions& options = {}, const std::string& format = "");
RobotMotionFile read_robot_motion(const MotionSource& source, const RobotModel& robot,
                                  const RobotMotionOptions& options = {}, const std::string& format = "");

// The rate that a motion of `rate_hz` is written at.
double written_rate(const RobotMotionFormat& format, double rate_hz, const RobotMotionWriting& writing);

// The files of a motion, resampled where the rate is another. The motion has the robot's joints in its order. Throws
// std::invalid_argument for a format that is only read, another robot's joints, fewer than 2 frames, or what
// validate() says.
MotionFiles robot_motion_files(const RobotMotion& motion, const RobotModel& robot, const RobotMotionFormat& format,
                               const RobotMotionWriting& writing = {});

// The same into a file or a folder (each file atomic, core/file.h). Throws StorageError too.
void write_robot_motion(const RobotMotion& motion, const RobotModel& robot, const RobotMotionFormat& format,
                        const std::string& path, const RobotMotionWriting& writing = {});

// Quaternion, order, angles, length and rate as the format documents them, for `duet list robot-formats`.
std::string documented_layout(const RobotMotionFormat& format);

}  // namespace duet
