#include "duet/core/file_batch.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

namespace duet {
namespace {

namespace fs = std::filesystem;

// Messages name the file that was asked for.
void write_temporary(const std::string& temporary, const std::string& path, std::string_view bytes) {
  try {
    write_file(temporary, bytes);
  } catch (const StorageError& error) {
    std::string message = error.what();
    if (const std::size_t at = message.find(temporary); at != std::string::npos)
      message.replace(at, temporary.size(), path);
    throw StorageError(message);
  }
}

}  // namespace

FileBatch::~FileBatch() {
  for (const Waiting& file : waiting_) ::unlink(file.temporary.c_str());
}

void FileBatch::write(const std::string& path, std::string_view bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (fs::is_directory(status)) return write_file(path, bytes);  // says that it is one
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    devices_.emplace_back(path, bytes);
    return;
  }
  const std::string place = fs::exists(status) ? fs::canonical(path).string() : path;
  const auto same = std::ranges::find(waiting_, place, &Waiting::place);
  const std::string temporary =
      same != waiting_.end() ? same->temporary : fmt::format("{}.part-{}-{}-batch", place, ::getpid(), waiting_.size());
  write_temporary(temporary, path, bytes);
  if (same == waiting_.end()) waiting_.push_back({temporary, place, path});
  if (fs::exists(status)) fs::permissions(temporary, status.permissions(), error);
}

void FileBatch::put_in_place() {
  for (const auto& [path, bytes] : devices_) write_file(path, bytes);
  devices_.clear();
  for (const Waiting& file : waiting_) {
    std::error_code error;
    fs::rename(file.temporary, file.place, error);
    if (error) throw StorageError(fmt::format("cannot write '{}': {}", file.path, error.message()));
  }
  waiting_.clear();
}

}  // namespace duet
