// Reading whole files, and writes that leave either the old file or the new one. Every error names the path and the
// system's reason.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace duet {

// Throws InputError ("cannot read 'x.bvh': No such file or directory").
std::string read_file(const std::string& path);

// Writes to a temporary file beside `path`, syncs and renames it; creates missing parent folders. Throws InputError
// (for example "cannot write 'runs/a/run.json': No space left on device") and leaves `path` as it was.
void write_file(const std::string& path, std::string_view bytes);

// Appends lines to one file; each is complete on disk (written and synced) when append() returns. A last line without
// its newline (a killed run) is cut off when the file is opened. Not thread-safe: one owner.
class LineAppender {
 public:
  explicit LineAppender(const std::string& path);  // creates it; throws InputError
  ~LineAppender();
  LineAppender(const LineAppender&) = delete;
  LineAppender& operator=(const LineAppender&) = delete;
  // `line` has no newline. Throws InputError; a partly written line is cut off again.
  void append(std::string_view line);

 private:
  void cut_back();

  std::string path_;
  int descriptor_ = -1;
  std::int64_t size_ = 0;  // of the complete lines
  bool complete_ = true;   // nothing but complete lines is in the file
  bool regular_ = true;    // a device or a pipe cannot be cut
};

}  // namespace duet
