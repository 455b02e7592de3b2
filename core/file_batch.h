// Files of one command that appear together: each is written beside its place first, and all are renamed when the last
// is there, so that a disk that fills up leaves no new table among old ones. One owner.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/file.h"

namespace duet {

class FileBatch {
 public:
  FileBatch() = default;
  ~FileBatch();  // removes what was not put in place
  FileBatch(const FileBatch&) = delete;
  FileBatch& operator=(const FileBatch&) = delete;

  // As write_file(), but that the file has not its name yet. A second one for the same path replaces the first.
  void write(const std::string& path, std::string_view bytes);
  // Throws StorageError; the files before the one that it names are in place then.
  void put_in_place();

 private:
  struct Waiting {
    std::string temporary, place, path;  // `place`: behind links
  };
  std::vector<Waiting> waiting_;
  std::vector<std::pair<std::string, std::string>> devices_;  // also pipes, which have no place; with what they get
};

// A temporary folder: its name cannot be guessed or be taken already, and it goes with its owner. A file made in it
// becomes the result by a rename, so that the result is there whole or not at all.
class ScratchFolder {
 public:
  // In the system's folder for temporary files ($TMPDIR, else /tmp). Throws StorageError.
  ScratchFolder();
  // In the folder of `path`, which is made where it is missing, and named after it: on the same file system.
  static ScratchFolder beside(const std::string& path);
  // Removes it with all that is in it; links are removed and not followed.
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }

  // Moves `name` of this folder to `target`. Throws StorageError, also where something is there already.
  void publish(const std::string& name, const std::string& target) const;

 private:
  explicit ScratchFolder(const std::string& pattern);

  std::string path_;
};

}  // namespace duet
