// Files that others made, for whoever reads them: what is no data at all is said by name (no_data.h), text of any
// system becomes plain. Thread-safe.
#pragma once

#include <cstdint>
#include <string>

#include "duet/core/file.h"

namespace duet {

// read_file() of what a reader reads. Throws InputError also where the file is empty.
std::string read_data(const std::string& path, std::int64_t most = kMostFileBytes);

// The same of text that is read line by line (CSV, BVH, lists of names): without a byte order mark, with "\n" in the
// place of "\r\n" and of "\r" alone.
std::string read_plain_text(const std::string& path, std::int64_t most = kMostTextBytes);

// At most `most` bytes from the beginning, as they are. Throws InputError where the file cannot be read.
std::string read_head(const std::string& path, std::size_t most);

// Throws what read_data() would throw at the first bytes, for whoever reads a file in parts. A folder is let be.
void require_data(const std::string& path);

}  // namespace duet
