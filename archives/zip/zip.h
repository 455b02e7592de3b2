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

// The sizes that an archive may grow to. A few kilobytes can hold a terabyte of zeros; the sizes that the archive
// claims are compared before anything is inflated, and what comes out is counted again.
struct ZipLimits {
  std::size_t entry_bytes = 0;
  std::size_t total_bytes = 0;
  std::size_t entries = 10'000;
};

// Calls `take` for each entry in the archive's order. Throws InputError naming `name`, the entry and what is wrong: not
// a zip, truncated, a checksum that does not match, above one of the limits.
void read_zip(std::string_view bytes, const std::string& name, const ZipLimits& limits,
              const std::function<void(const std::string& entry, const std::string& content)>& take);

// The same for the entries that `wanted` says yes to; the others are neither inflated nor counted.
void read_zip(std::string_view bytes, const std::string& name, const ZipLimits& limits,
              const std::function<bool(const std::string& entry)>& wanted,
              const std::function<void(const std::string& entry, const std::string& content)>& take);

// The names of the entries of a file, from its directory alone: cheap. Nothing where it is no archive or not there.
std::vector<std::string> zip_entry_names(const std::string& path);

// Motions deflate to nine tenths of their size at a hundred times the cost of storing them.
enum class ZipMethod { kDeflated, kStored };

// In the order given, with the time stamp 1980-01-01: the same entries give the same bytes.
std::string zip_bytes(const std::vector<ZipEntry>& entries, ZipMethod method = ZipMethod::kDeflated);

// Bytes made small enough to travel in a text: a zlib stream, and base64 (RFC 4648). Thread-safe.

// A whole zlib stream of `bytes`; `inflated` and a browser's DecompressionStream("deflate") read it. The same bytes
// give the same stream with one version of zlib.
std::string deflated(std::string_view bytes);

// With padding, without line ends.
std::string base64(std::string_view bytes);

// zlib and gzip streams in memory. Thread-safe.

// The content of a whole zlib or gzip stream. Throws InputError naming `name`: truncated, damaged, more than `limit`
// bytes (a few kilobytes can hold a terabyte of zeros; memory grows with what comes out and no further).
std::string inflated(std::string_view bytes, const std::string& name, std::size_t limit);

}  // namespace duet
