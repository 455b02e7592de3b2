// Reading whole files, and writes that leave either the old file or the new one. Every error names the path and the
// system's reason.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "duet/core/require.h"

namespace duet {

// A disk or a folder that does not take what is written to it: full, over its quota, read-only, without permission. It
// says nothing of what was to be written: a run stops at it and goes on later.
class StorageError : public InputError {
 public:
  using InputError::InputError;
};

inline constexpr std::int64_t kMostFileBytes = std::int64_t{1} << 31;
inline constexpr std::int64_t kMostTextBytes = std::int64_t{64} << 20;

// Throws InputError ("cannot read 'x.bvh': No such file or directory"), also for a file of more than `most` bytes; a
// device or a pipe may have 256 MiB.
std::string read_file(const std::string& path, std::int64_t most = kMostFileBytes);
// A description that people write (YAML, JSON, CSV): 64 MiB at most.
inline std::string read_text(const std::string& path) { return read_file(path, kMostTextBytes); }

// Writes to a temporary file beside `path`, syncs and renames it; creates missing parent folders. Follows a link that
// `path` is. Throws StorageError (for example "cannot write 'runs/a/run.json': No space left on device") and leaves
// `path` as it was.
// Unsynced it is whole after the process is killed, but not after a power cut: for what is checked by its digest when
// it is used, and can be made again.
enum class Durability { kSynced, kUnsynced };
void write_file(const std::string& path, std::string_view bytes, Durability durability = Durability::kSynced);

// The path of `name` ("episodes.jsonl", "trajectories/a.npz") in a folder that may have come from others. Throws
// StorageError where `name`, or a folder on the way to it below `folder`, is a symbolic link: what is written into
// `folder` stays there.
std::string inside(const std::string& folder, const std::string& name);

// Appends lines to one file; each is complete on disk (written and synced) when append() returns. A last line without
// its newline (a killed run) is cut off when the file is opened: where several processes write to it, under a lock that
// they share, and append() too. Not thread-safe: one owner.
class LineAppender {
 public:
  explicit LineAppender(const std::string& path);  // creates it; throws StorageError
  ~LineAppender();
  LineAppender(const LineAppender&) = delete;
  LineAppender& operator=(const LineAppender&) = delete;
  // `line` has no newline. Throws StorageError; a partly written line is cut off again.
  void append(std::string_view line);
  // Whole lines that others have appended since it was opened or last asked, each with its newline. With `cut` a rest
  // without one is cut off (only under the lock). Throws StorageError for a file that was removed or made shorter.
  std::string read_appended(bool cut);
  [[nodiscard]] std::int64_t size() const { return size_; }  // of the whole lines known [bytes]

 private:
  void cut_back();

  std::string path_;
  int descriptor_ = -1;
  std::int64_t size_ = 0;  // of the complete lines
  bool complete_ = true;   // nothing but complete lines is in the file
  bool regular_ = true;    // a device or a pipe cannot be cut
};

}  // namespace duet
