// The content of a motion file or folder, opened once by what its first bytes say, so that every format can look
// whether it is its own. Nothing in it is executed, and no name in it becomes a path.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "duet/archives/npy/npy_array.h"
#include "duet/archives/npy/npz.h"
#include "duet/archives/pickle/pickle_node.h"
#include "duet/formats/csv_table.h"

namespace duet {

enum class MotionContainer { kNpz, kNpy, kPickle, kTable, kFolder };
std::string_view to_string(MotionContainer container);  // "an NPZ archive", ...

// The content of a file or folder: only the member of the five that `container` names is set.
struct MotionSource {
  std::string path = {};  // for messages
  MotionContainer container = MotionContainer::kTable;
  std::optional<Npz> npz = {};
  std::optional<NpyArray> npy = {};
  std::optional<Pickle> pickle = {};  // its views are into `bytes`
  std::optional<CsvTable> table = {};
  std::map<std::string, std::string> files = {};  // of a folder: name -> content
  std::unique_ptr<const std::string> bytes = {};  // on the heap: views stay when the source moves

  [[nodiscard]] bool has(const std::string& npz_key) const { return npz && npz->contains(npz_key); }
};

// Throws InputError naming `name`: an empty file, and what the container's own reader says. NPZ arrays of Python
// objects are left out.
MotionSource motion_source(std::string bytes, const std::string& name);

// A file, or a folder: of that the plain files "*.csv" and "*.txt", links refused.
MotionSource open_motion_source(const std::string& path);

}  // namespace duet
