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

}  // namespace duet
