// Dicts of arrays inside a pickle, read key by key. All functions throw InputError naming file, byte, key, expected and
// found.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/pickle/pickle_node.h"
#include "duet/core/recording.h"

namespace duet {

// A dict whose keys are strings. Keeps a reference: the pickle must outlive it.
class PickleDict {
 public:
  PickleDict(const Pickle& pickle, const PickleNode& node);

  // nullptr where the key is absent or None.
  [[nodiscard]] const PickleNode* find(const std::string& key) const;
  [[nodiscard]] const PickleNode& get(const std::string& key) const;
  [[nodiscard]] std::vector<std::string> keys() const;  // sorted

 private:
  void add(const PickleNode& key, int value);

  const Pickle& pickle_;
  std::map<std::string, int> values_;
};

struct PickleTable {
  std::size_t rows = 0;
  std::size_t row_size = 0;
  std::vector<double> values;  // row by row, finite
};

// An array, or lists, of `frames` rows (0: any number of at least 2) of shape `rest` (0: any size), all finite.
PickleTable pickle_table(const Pickle& pickle, const PickleNode& node, const std::string& key, std::size_t frames,
                         const std::vector<std::size_t>& rest);

// One number in any of the ways of pickle_number: frames per second, above 0.
double pickle_rate(const Pickle& pickle, const PickleNode& node);

// Robot motions of GMR, TWIST2 and GMT: pickled dicts of NumPy arrays. Only the fixed opcodes that such files use are
// interpreted; nothing in a file is ever executed, and any other class or call is refused by name.

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
