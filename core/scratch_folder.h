// A temporary folder: its name cannot be guessed or be taken already, and it goes with its owner. A file made in it
// becomes the result by a rename, so that the result is there whole or not at all.
#pragma once

#include <string>

namespace duet {

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
