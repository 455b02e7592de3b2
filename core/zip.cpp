#include "core/zip.h"

#include <fmt/format.h>
#include <zip.h>

#include <memory>

#include "core/require.h"

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
  if (!archive) fail(name, fmt::format("not a zip archive or truncated ({})", zip_error_strerror(&error.value)));
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

void add_entry(zip_t* archive, const ZipEntry& entry) {
  const auto check = [&](bool ok) {
    if (!ok) throw InputError(fmt::format("cannot put '{}' in an archive: {}", entry.name, zip_strerror(archive)));
  };
  Source source(zip_source_buffer(archive, entry.content.data(), entry.content.size(), 0));
  check(source != nullptr);
  const zip_int64_t index = zip_file_add(archive, entry.name.c_str(), source.get(), ZIP_FL_ENC_UTF_8);
  check(index >= 0);
  static_cast<void>(source.release());  // NOLINT(bugprone-unused-return-value): the archive owns it now
  constexpr zip_uint16_t kMidnight = 0, kFirstOfJanuary1980 = (1 << 5) | 1;
  const auto position = static_cast<zip_uint64_t>(index);
  check(zip_file_set_dostime(archive, position, kMidnight, kFirstOfJanuary1980, 0) == 0);
  check(zip_set_file_compression(archive, position, ZIP_CM_DEFLATE, 0) == 0);
}

std::string read_source(zip_source_t* source) {
  zip_stat_t status;
  if (zip_source_stat(source, &status) != 0 || zip_source_open(source) != 0)
    throw InputError(fmt::format("cannot make an archive: {}", zip_error_strerror(zip_source_error(source))));
  std::string bytes(status.size, '\0');
  const zip_int64_t count = zip_source_read(source, bytes.data(), bytes.size());
  zip_source_close(source);
  if (count != static_cast<zip_int64_t>(bytes.size())) throw InputError("cannot make an archive: short read");
  return bytes;
}

}  // namespace

void read_zip(std::string_view bytes, const std::string& name, std::size_t limit,
              const std::function<void(const std::string& entry, const std::string& content)>& take) {
  if (bytes.empty()) fail(name, "empty, expected a zip archive");  // libzip takes it for an archive of nothing
  const Archive archive = open_archive(bytes, name);
  const zip_int64_t count = zip_get_num_entries(archive.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const auto index = static_cast<zip_uint64_t>(i);
    zip_stat_t status;
    if (zip_stat_index(archive.get(), index, 0, &status) != 0) fail(name, zip_strerror(archive.get()));
    const std::string entry(status.name == nullptr ? "" : status.name);
    const std::string what = fmt::format("'{}': entry '{}'", name, entry);
    if ((status.valid & ZIP_STAT_SIZE) != 0 && status.size > limit)
      throw InputError(fmt::format("{}: above {} bytes", what, limit));
    take(entry, read_entry(archive.get(), index, what, limit));
  }
}

std::string zip_bytes(const std::vector<ZipEntry>& entries) {
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
  for (const ZipEntry& entry : entries) add_entry(archive.get(), entry);
  if (zip_close(archive.get()) != 0)
    throw InputError(fmt::format("cannot make an archive: {}", zip_strerror(archive.get())));
  static_cast<void>(archive.release());  // NOLINT(bugprone-unused-return-value): closed, and freed by that
  return read_source(target.get());
}

}  // namespace duet
