// Files of data sets on a disk: which lie below a path, what they begin with, and which of two folders belong together.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/people/people_format.h"

namespace duet {

// The path itself where it is a file, else the files below it whose name is `wanted`, sorted. Links to folders are not
// followed. Throws InputError naming the path: not there, not readable, a file of another name.
std::vector<std::string> files_at(const std::string& path, const std::function<bool(const std::string& name)>& wanted);

// The first such file, "" where there is none: what recognition looks at. Nothing is thrown.
std::string first_file_at(const std::string& path, const std::function<bool(const std::string& name)>& wanted);

// The first bytes of a file, fewer where it is shorter, none where it is not readable.
std::string leading_bytes(const std::string& path, std::size_t count);

std::string file_stem(const std::string& path);

// The clips of two paths, one per person: two files, or two folders whose files of the same name below them belong
// together. Throws InputError: another number of paths, a file beside a folder, no pair.
std::vector<ClipPlace> pairs_at(std::span<const std::string> paths,
                                const std::function<bool(const std::string& name)>& wanted, std::string_view format);

// Each file is one clip of two people.
std::vector<ClipPlace> clips_at(std::span<const std::string> paths,
                                const std::function<bool(const std::string& name)>& wanted, std::string_view format);

// Two paths at both of which `is_one` says yes to the first file that is `wanted`.
bool both_are(std::span<const std::string> paths, const std::function<bool(const std::string& name)>& wanted,
              const std::function<bool(const std::string& path)>& is_one);

}  // namespace duet
