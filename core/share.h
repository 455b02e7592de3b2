// Files that ship with duet: robot cards, engine profiles, limit tables; and where an installed duet keeps its own.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// The file `relative` ("profiles/parity.yaml") in $DUET_SHARE, else in share/duet of one of `installed_prefixes`, else,
// where none of them is there, in the sources of a program that lies where it was built (core/share.h). Throws
// MissingError naming `what` ("robot card") and the places looked at.
std::string share_file(std::string_view what, std::string_view relative);

// The folders that may be the one into which duet was installed, in the order in which they are to be asked: that of a
// module in which another program loads duet (the Python package), the one above the program's own (<prefix>/bin/duet),
// and that of the package that a program was built against (find_package(duet) says it to the program).
std::vector<std::string> installed_prefixes();
// The file that duet's code is in: the program, or such a module.
std::string program_file();
// The folders that share_file looks in, in its order.
std::vector<std::string> share_folders();

// Where a file of others is looked for that does not ship, by its name with folders: in `folder`, in $DUET_MODELS, in
// $DUET_SHARED/models and $DUET_SHARED/arena.
std::vector<std::string> published_places(const std::string& folder, const std::string& name);

// The first of `places` that exists; throws MissingError naming them all where none does.
std::string first_existing(std::string_view what, const std::vector<std::string>& places);

// The tree in which a program was built, found from where the program lies: no path of a build is in a program, and one
// that was copied or installed elsewhere has no such tree.

struct BuildTree {
  std::string sources, build;  // folders of duet
};

// The tree of the nearest CMakeCache.txt above `program` that is of the same owner as the program and names duet's
// sources. None where there is no such file.
std::optional<BuildTree> build_tree_of(const std::string& program);

// The version of duet: that of the CMake project, and written nowhere else.
const char* duet_version();  // "0.1.0"

}  // namespace duet
