// The names that this program reads in a run directory may be files and folders of its own alone. A link, a pipe or a
// device under one of these names would make the program read or write something else, and a run may come from others
// (docs/trust.md).
#pragma once

#include <string>

namespace duet {

// Throws InputError where one of a run's files, or anything in one of its folders, is neither a file nor a folder:
// which and what it is. Other names in the folder are not looked at.
void require_plain_files(const std::string& run);

// The same of one file or folder by its name below `run`, and of every folder on the way to it. One that is not there
// passes.
void require_plain_file(const std::string& run, const std::string& name);

}  // namespace duet
