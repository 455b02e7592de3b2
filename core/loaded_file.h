// A file that a policy or a controller loads: part of what it is, wherever it lies.
#pragma once

#include <string>
#include <vector>

namespace duet {

struct LoadedFile {
  std::string role;  // "network", "library", "descriptor", "command wave.py": an option's name where one gives its path
  std::string path;
};

using LoadedFiles = std::vector<LoadedFile>;

}  // namespace duet
