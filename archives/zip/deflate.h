// Bytes made small enough to travel in a text: a zlib stream, and base64 (RFC 4648). Thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace duet {

// A whole zlib stream of `bytes`; `inflated` and a browser's DecompressionStream("deflate") read it. The same bytes
// give the same stream with one version of zlib.
std::string deflated(std::string_view bytes);

// With padding, without line ends.
std::string base64(std::string_view bytes);

}  // namespace duet
