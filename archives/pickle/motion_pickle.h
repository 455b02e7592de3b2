// Robot motions of GMR, TWIST2 and GMT: pickled dicts of NumPy arrays. Only the fixed opcodes that such files use are
// interpreted; nothing in a file is ever executed, and any other class or call is refused by name.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/pickle/pickle_node.h"
#include "duet/core/point_tracks.h"
#include "duet/core/robot_motion.h"

namespace duet {

// How the sentence of the verdict begins that names keys beside the known ones.
inline constexpr std::string_view kLeftOutKeys = "left out: ";

struct PickledMotion {
  RobotMotion motion;                       // joint_names empty where no key of the file names them
  PointTracks local_body_pos;               // (T, bodies, 3) as stored, may be empty
  std::vector<std::string> link_body_list;  // names of those bodies
  std::vector<std::string> verdict;  // what was found: rate, DoF, quaternions renormalised (worst deviation), ...
};

// Throws InputError naming file, byte offset, expected and found: truncated, a foreign class, missing keys, shapes that
// disagree, values that are not finite, a zero quaternion. Quaternions up to 0.1 from unit length are renormalised and
// reported in the verdict.
PickledMotion motion_of_pickle(const Pickle& pickle);
PickledMotion parse_motion_pickle(std::string_view bytes, const std::string& name);
PickledMotion read_motion_pickle(const std::string& path);

}  // namespace duet
