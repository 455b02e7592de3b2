#include "duet/archives/zip/inflate.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <limits>

#include "duet/core/require.h"

namespace duet {
namespace {

// Ends the stream whatever happens.
struct Inflater {
  Inflater() {
    constexpr int kZlibOrGzip = MAX_WBITS + 32;
    if (inflateInit2(&stream, kZlibOrGzip) != Z_OK) throw InputError("zlib cannot be set up");
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
  z_stream stream{};
};

}  // namespace

std::string inflated(std::string_view bytes, const std::string& name, std::size_t limit) {
  Inflater inflater;
  z_stream& stream = inflater.stream;
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // zlib does not write to it
  if (bytes.size() > std::numeric_limits<uInt>::max())
    throw InputError(fmt::format("'{}': above {} compressed bytes", name, std::numeric_limits<uInt>::max()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::string content;
  char buffer[1 << 16];
  for (int status = Z_OK; status != Z_STREAM_END;) {
    stream.next_out = reinterpret_cast<Bytef*>(buffer);
    stream.avail_out = sizeof buffer;
    status = inflate(&stream, Z_NO_FLUSH);
    if (status == Z_BUF_ERROR || (status == Z_OK && stream.avail_in == 0 && stream.avail_out == sizeof buffer))
      throw InputError(fmt::format("'{}': the compressed stream is truncated after {} bytes", name, bytes.size()));
    if (status != Z_OK && status != Z_STREAM_END)
      throw InputError(fmt::format("'{}': byte {}: the compressed stream is damaged ({})", name, stream.total_in,
                                   stream.msg != nullptr ? stream.msg : "zlib"));
    content.append(buffer, sizeof buffer - stream.avail_out);
    if (content.size() > limit) throw InputError(fmt::format("'{}': inflates to more than {} bytes", name, limit));
  }
  return content;
}

}  // namespace duet
