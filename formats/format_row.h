// One row of the table of robot motion formats (formats/robot_motion_format.h): what a format is, how it is told from
// the others, how it is read and written.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "duet/formats/file_motion.h"
#include "duet/formats/motion_source.h"

namespace duet {

struct RobotMotionWriting {
  std::optional<double> rate_hz = {};  // resampled to; empty: the motion's, or the format's where its files hold none
  TreeOrder order = TreeOrder::kBreadthFirst;  // of joints and bodies, in the formats that have both
  std::string name = "motion";                 // of the motion, in the formats that keep one
};

// Name -> content of the files of one motion; "" where it is a single file.
using MotionFiles = std::map<std::string, std::string>;

struct RobotMotionFormat {
  const char* name;      // "gmr", ...
  const char* about;     // one sentence
  const char* holds;     // keys or columns
  const char* evidence;  // where the layout was looked up
  const char* licence;   // of the tool or data set that made the format
  const char* ending;    // of the files, "" for a folder
  MotionContainer container;
  MotionLayout layout;
  bool holds_rate = true;                          // the files say their rate
  bool (*recognises)(const MotionSource& source);  // never throws
  // Throws InputError naming the file, what was expected and what was found.
  FileMotion (*read)(const MotionSource& source, const RobotModel& robot, const RobotMotionOptions& options);
  // null: only read. `motion` is valid, has the robot's joints in its order and the rate that it is written at.
  MotionFiles (*write)(const RobotMotion& motion, const RobotModel& robot, const RobotMotionWriting& writing) = nullptr;
};

// Robot motions in pickles: GMR, TWIST, TWIST2 and GMT; PHC, ASAP and SONIC's motion libraries.
std::vector<RobotMotionFormat> pickle_formats();

// Motions as rows of generalised positions: MuJoCo's qpos in archives (OmniRetarget, LocoMuJoCo, SPIDER), PHUMA's
// arrays, and duet's own files.
std::vector<RobotMotionFormat> qpos_formats();

// Motions as tables of numbers: Unitree's and LAFAN1's, BONES-SEED's, hhtools'.
std::vector<RobotMotionFormat> table_formats();

// Motions for tracking policies, with the poses and velocities of all bodies: BeyondMimic's and holosoma's archives,
// SONIC's folders.
std::vector<RobotMotionFormat> tracking_formats();

}  // namespace duet
