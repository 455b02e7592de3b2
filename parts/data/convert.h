// Motions of robots from one format into another (docs/file-formats.md, "Robot motions"), and the preparation of paired
// motions for the real robot. Pure but for the files.
#pragma once

#include <string>
#include <vector>

#include "duet/formats/robot_motion_format.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct ConversionOptions {
  std::string to;                   // format that is written, or "paired" of a paired motion
  std::string from = {};            // format that is read; empty: recognised
  RobotMotionOptions reading = {};  // what is known better than the file says
  RobotMotionWriting writing = {};
  bool sim_to_real = false;  // Algorithm 7, of paired motions (retarget/solver/pair.h)
};

struct ConvertedMotion {
  std::string file;  // that was written
  int frames = 0;
  double rate_hz = 0.0;               // of what was written
  std::vector<std::string> evidence;  // how the file was read, and what was done to it
};

// Throws InputError, StorageError, and std::invalid_argument for a format that is not written or a preparation of what
// is no paired motion.
ConvertedMotion convert_motion(const std::string& input, const std::string& output, const RobotModel& robot,
                               const ConversionOptions& options);

// Motions to convert below the paths: files stay; folders are searched for files with an ending of the formats,
// a folder that a format recognises is one motion. Sorted. Throws InputError for a path that is not there or where
// nothing is found.
std::vector<std::string> find_robot_motions(const std::vector<std::string>& paths);

// Where each input goes: `output` itself for one input whose name it gives (by the format's ending, or that `output` is
// no folder yet of a format that is one); else a file of the input's name in the folder `output`. Throws
// std::invalid_argument where two inputs would get one name.
std::vector<std::string> converted_paths(const std::vector<std::string>& inputs, const std::string& output,
                                         const std::string& to);

}  // namespace duet
