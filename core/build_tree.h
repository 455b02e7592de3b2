// The tree in which a program was built, found from where the program lies: no path of a build is in a program, and one
// that was copied or installed elsewhere has no such tree.
#pragma once

#include <optional>
#include <string>

namespace duet {

struct BuildTree {
  std::string sources, build;  // folders of duet
};

// The tree of the nearest CMakeCache.txt above `program` that is of the same owner as the program and names duet's
// sources. None where there is no such file.
std::optional<BuildTree> build_tree_of(const std::string& program);

}  // namespace duet
