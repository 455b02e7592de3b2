#include "duet/core/file_batch.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "duet/core/file.h"

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

namespace {

[[noreturn]] void fail_to_make(const std::string& path, int error) {
  throw StorageError(fmt::format("cannot write '{}': {}", path, std::generic_category().message(error)));
}

// 0, or the error number. Nothing that is there is replaced; a file system that cannot promise it is asked beforehand.
int move_to_new(const std::string& from, const std::string& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return 0;
  if (errno != EINVAL && errno != ENOSYS) return errno;
  std::error_code error;
  if (fs::exists(fs::symlink_status(to, error))) return EEXIST;
  return ::rename(from.c_str(), to.c_str()) == 0 ? 0 : errno;
}

}  // namespace

ScratchFolder::ScratchFolder() : ScratchFolder((fs::temp_directory_path() / "duet-XXXXXX").string()) {}

ScratchFolder::ScratchFolder(const std::string& pattern) : path_(pattern) {
  if (::mkdtemp(path_.data()) == nullptr) fail_to_make(pattern, errno);
}

ScratchFolder ScratchFolder::beside(const std::string& path) {
  const fs::path normal = fs::absolute(path).lexically_normal();
  const fs::path target = normal.has_filename() ? normal : normal.parent_path();  // "out/" is out
  std::error_code error;
  fs::create_directories(target.parent_path(), error);
  if (error) fail_to_make(path, error.value());
  return ScratchFolder(target.string() + ".part-XXXXXX");
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void ScratchFolder::publish(const std::string& name, const std::string& target) const {
  const fs::path normal = fs::path(target).lexically_normal();
  const std::string to = (normal.has_filename() ? normal : normal.parent_path()).string();
  if (const int error = move_to_new(*this / name, to); error != 0) fail_to_make(target, error);
}

}  // namespace duet
