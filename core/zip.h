// Zip archives in memory (through libzip): the container of NPZ. Thread-safe.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct ZipEntry {
  std::string name;
  std::string content;
};

// Calls `take` for each entry in the archive's order. Throws InputError naming `name`, the entry and what is wrong: not
// a zip, truncated, a checksum that does not match, an entry above `limit` bytes.
void read_zip(std::string_view bytes, const std::string& name, std::size_t limit,
              const std::function<void(const std::string& entry, const std::string& content)>& take);

// Deflated, in the order given, with the time stamp 1980-01-01: the same entries give the same bytes.
std::string zip_bytes(const std::vector<ZipEntry>& entries);

}  // namespace duet
