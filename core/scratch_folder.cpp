#include "duet/core/scratch_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "duet/core/file.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

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
