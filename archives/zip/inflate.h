// zlib and gzip streams in memory. Thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace duet {

// The content of a whole zlib or gzip stream. Throws InputError naming `name`: truncated, damaged, more than `limit`
// bytes (a few kilobytes can hold a terabyte of zeros; memory grows with what comes out and no further).
std::string inflated(std::string_view bytes, const std::string& name, std::size_t limit);

}  // namespace duet
