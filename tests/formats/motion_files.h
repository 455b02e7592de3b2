// Files of robot motions in every layout, written and read back, for the tests of the formats.
#pragma once

#include <string>
#include <vector>

#include "duet/formats/robot_motion_format.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

inline constexpr double kSame = 1e-6;  // what a round trip may change: nine digits of text

inline const RobotModel& robot(const std::string& name) {
  static const RobotModel g1 = load_robot(card_path("g1")), t1 = load_robot(card_path("t1"));
  return name == "g1" ? g1 : t1;
}

inline RobotMotionFile read_bytes(const std::string& bytes, const std::string& name,
                                  const RobotMotionOptions& options = {}, const std::string& format = "") {
  return read_robot_motion(motion_source(bytes, name), robot("g1"), options, format);
}

inline std::vector<RobotMotionFormat> written_formats() {
  std::vector<RobotMotionFormat> formats;
  for (const RobotMotionFormat& format : robot_motion_formats())
    if (format.write != nullptr) formats.push_back(format);
  return formats;
}

inline std::string file_of(const RobotMotion& motion, const std::string& format) {
  return robot_motion_files(motion, robot("g1"), robot_motion_format(format), {.rate_hz = motion.rate_hz}).at("");
}

}  // namespace duet::test
