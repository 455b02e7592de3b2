#include "duet/archives/zip/zip.h"

#include <fmt/format.h>
#include <zip.h>
#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>

#include "duet/core/require.h"

namespace duet {
namespace {

struct DiscardArchive {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
using Archive = std::unique_ptr<zip_t, DiscardArchive>;

struct FreeSource {
  void operator()(zip_source_t* source) const { zip_source_free(source); }
};
using Source = std::unique_ptr<zip_source_t, FreeSource>;

struct CloseEntry {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};
using Entry = std::unique_ptr<zip_file_t, CloseEntry>;

struct Error {
  Error() { zip_error_init(&value); }
  ~Error() { zip_error_fini(&value); }
  Error(const Error&) = delete;
  Error& operator=(const Error&) = delete;
  zip_error_t value;
};

[[noreturn]] void fail(const std::string& name, const std::string& problem) {
  throw InputError(fmt::format("'{}': {}", name, problem));
}

Archive open_archive(std::string_view bytes, const std::string& name) {
  Error error;
  Source source(zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error.value));
  if (!source) fail(name, zip_error_strerror(&error.value));
  Archive archive(zip_open_from_source(source.get(), ZIP_RDONLY, &error.value));
  if (!archive) fail(name, "not a zip archive or truncated");
  // The archive owns the source from here on.
  static_cast<void>(source.release());  // NOLINT(bugprone-unused-return-value)
  return archive;
}

// The whole entry: libzip compares the checksum when the end is reached.
std::string read_entry(zip_t* archive, zip_uint64_t index, const std::string& what, std::size_t limit) {
  Entry file(zip_fopen_index(archive, index, 0));
  if (!file) throw InputError(fmt::format("{}: {}", what, zip_strerror(archive)));
  std::string content;
  char buffer[1 << 15];
  for (;;) {
    const zip_int64_t count = zip_fread(file.get(), buffer, sizeof buffer);
    if (count < 0) throw InputError(fmt::format("{}: {}", what, zip_file_strerror(file.get())));
    if (count == 0) return content;
    content.append(buffer, static_cast<std::size_t>(count));
    if (content.size() > limit) throw InputError(fmt::format("{}: above {} bytes", what, limit));
  }
}

[[noreturn]] void refuse_total(const std::string& name, const ZipLimits& limits) {
  fail(name, fmt::format("expected entries of at most {} bytes together, found more", limits.total_bytes));
}

// The archive's own claims about its entries; the sizes need not be true.
struct Claim {
  zip_uint64_t index;
  std::string entry;
  std::size_t bytes;
};

Claim claim_of(zip_t* archive, zip_uint64_t index, const std::string& name) {
  zip_stat_t status;
  if (zip_stat_index(archive, index, 0, &status) != 0) fail(name, zip_strerror(archive));
  return {index, status.name == nullptr ? "" : status.name, (status.valid & ZIP_STAT_SIZE) != 0 ? status.size : 0};
}

std::vector<Claim> claims(zip_t* archive, const std::string& name, const ZipLimits& limits,
                          const std::function<bool(const std::string& entry)>& wanted) {
  const auto count = static_cast<zip_uint64_t>(zip_get_num_entries(archive, 0));
  if (count > limits.entries) fail(name, fmt::format("expected at most {} entries, found {}", limits.entries, count));
  std::vector<Claim> claims;
  std::size_t total = 0;
  for (zip_uint64_t index = 0; index < count; ++index) {
    Claim claim = claim_of(archive, index, name);
    if (wanted && !wanted(claim.entry)) continue;
    if (claim.bytes > limits.entry_bytes)
      fail(name, fmt::format("entry '{}': above {} bytes", excerpt(claim.entry), limits.entry_bytes));
    claims.push_back(std::move(claim));
    total += claims.back().bytes;  // no overflow: at most 10^4 entries, each below its limit
    if (total > limits.total_bytes) refuse_total(name, limits);
  }
  return claims;
}

void add_entry(zip_t* archive, const ZipEntry& entry, ZipMethod method) {
  const auto check = [&](bool ok) {
    if (!ok)
      throw InputError(fmt::format("cannot put '{}' in an archive: {}", excerpt(entry.name), zip_strerror(archive)));
  };
  Source source(zip_source_buffer(archive, entry.content.data(), entry.content.size(), 0));
  check(source != nullptr);
  const zip_int64_t index = zip_file_add(archive, entry.name.c_str(), source.get(), ZIP_FL_ENC_UTF_8);
  check(index >= 0);
  static_cast<void>(source.release());  // NOLINT(bugprone-unused-return-value): the archive owns it now
  constexpr zip_uint16_t kMidnight = 0, kFirstOfJanuary1980 = (1 << 5) | 1;
  const auto position = static_cast<zip_uint64_t>(index);
  check(zip_file_set_dostime(archive, position, kMidnight, kFirstOfJanuary1980, 0) == 0);
  check(zip_set_file_compression(archive, position, method == ZipMethod::kStored ? ZIP_CM_STORE : ZIP_CM_DEFLATE, 0) ==
        0);
}

std::string read_source(zip_source_t* source) {
  zip_stat_t status;
  if (zip_source_stat(source, &status) != 0 || zip_source_open(source) != 0)
    throw InputError(fmt::format("cannot make an archive: {}", zip_error_strerror(zip_source_error(source))));
  std::string bytes;
  bytes.reserve(status.size);
  char buffer[1 << 15];  // stays in the first cache: the text is not filled with zeros before
  for (;;) {
    const zip_int64_t count = zip_source_read(source, buffer, sizeof buffer);
    if (count <= 0) break;
    bytes.append(buffer, static_cast<std::size_t>(count));
  }
  zip_source_close(source);
  if (bytes.size() != status.size) throw InputError("cannot make an archive: short read");
  return bytes;
}

}  // namespace

void read_zip(std::string_view bytes, const std::string& name, const ZipLimits& limits,
              const std::function<void(const std::string& entry, const std::string& content)>& take) {
  read_zip(bytes, name, limits, {}, take);
}

void read_zip(std::string_view bytes, const std::string& name, const ZipLimits& limits,
              const std::function<bool(const std::string& entry)>& wanted,
              const std::function<void(const std::string& entry, const std::string& content)>& take) {
  if (bytes.empty()) fail(name, "empty, expected a zip archive");  // libzip takes it for an archive of nothing
  const Archive archive = open_archive(bytes, name);
  std::size_t total = 0;
  for (const Claim& claim : claims(archive.get(), name, limits, wanted)) {
    const std::string what = fmt::format("'{}': entry '{}'", name, excerpt(claim.entry));
    const std::string content = read_entry(archive.get(), claim.index, what, limits.entry_bytes);
    total += content.size();
    if (total > limits.total_bytes) refuse_total(name, limits);
    take(claim.entry, content);
  }
}

std::vector<std::string> zip_entry_names(const std::string& path) {
  int error = 0;
  const Archive archive(zip_open(path.c_str(), ZIP_RDONLY, &error));
  std::vector<std::string> names;
  const zip_int64_t count = archive ? zip_get_num_entries(archive.get(), 0) : 0;
  for (zip_int64_t index = 0; index < count; ++index)
    if (const char* name = zip_get_name(archive.get(), static_cast<zip_uint64_t>(index), 0)) names.emplace_back(name);
  return names;
}

std::string zip_bytes(const std::vector<ZipEntry>& entries, ZipMethod method) {
  if (entries.empty()) return std::string("PK\x05\x06", 4) + std::string(18, '\0');  // libzip makes no file of nothing
  Error error;
  Source target(zip_source_buffer_create(nullptr, 0, 0, &error.value));
  if (!target) throw InputError(fmt::format("cannot make an archive: {}", zip_error_strerror(&error.value)));
  zip_source_keep(target.get());  // one owner here, one in the archive
  Archive archive(zip_open_from_source(target.get(), ZIP_TRUNCATE, &error.value));
  if (!archive) {
    zip_source_free(target.get());
    throw InputError(fmt::format("cannot make an archive: {}", zip_error_strerror(&error.value)));
  }
  for (const ZipEntry& entry : entries) add_entry(archive.get(), entry, method);
  if (zip_close(archive.get()) != 0)
    throw InputError(fmt::format("cannot make an archive: {}", zip_strerror(archive.get())));
  static_cast<void>(archive.release());  // NOLINT(bugprone-unused-return-value): closed, and freed by that
  return read_source(target.get());
}

std::string deflated(std::string_view bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string stream(size, '\0');
  const int status =
      compress2(reinterpret_cast<Bytef*>(stream.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                static_cast<uLong>(bytes.size()), Z_BEST_COMPRESSION);
  if (status != Z_OK) throw InputError("zlib cannot be set up");
  stream.resize(size);
  return stream;
}

std::string base64(std::string_view bytes) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t taken = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < taken ? static_cast<std::uint8_t>(bytes[i + k]) : std::uint32_t{0});
    for (std::size_t k = 0; k < 4; ++k) text.push_back(k <= taken ? kDigits[group >> (18 - 6 * k) & 63] : '=');
  }
  return text;
}

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
