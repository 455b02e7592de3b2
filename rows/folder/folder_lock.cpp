#include "duet/rows/folder/folder_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "duet/core/file.h"

namespace duet {
namespace {

std::string reason(int error) { return std::generic_category().message(error); }

// Errors by which a file system says that it has no locks; Linux before 3.15 has no such locks at all.
bool has_no_locks(int error) {
  return error == ENOLCK || error == EINVAL || error == ENOSYS || error == EOPNOTSUPP || error == ENOTSUP;
}

}  // namespace

FolderLock::FolderLock(const std::string& path) : path_(path) {
  do descriptor_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
  while (descriptor_ < 0 && errno == EINTR);
  if (descriptor_ < 0) throw StorageError(fmt::format("cannot write '{}': {}", path, reason(errno)));
}

FolderLock::~FolderLock() { ::close(descriptor_); }

// 0, or the error number. These locks belong to the open file and not to the process: another FolderLock of the same
// process is excluded too, and closing any other descriptor of the file takes nothing back.
int FolderLock::apply(short type, std::uint64_t place, bool wait) {
  if (!refusal_.empty()) return 0;
  struct flock region {};
  region.l_type = type;
  region.l_whence = SEEK_SET;
  region.l_start = static_cast<off_t>(place);
  region.l_len = 1;
  int answer = -1;
  do answer = ::fcntl(descriptor_, wait ? F_OFD_SETLKW : F_OFD_SETLK, &region);
  while (answer != 0 && errno == EINTR);
  if (answer == 0) return 0;
  if (!has_no_locks(errno)) return errno;
  refusal_ = reason(errno);
  return 0;
}

bool FolderLock::try_lock(std::uint64_t place, Kind kind) {
  const int error = apply(kind == Kind::kShared ? F_RDLCK : F_WRLCK, place, false);
  if (error == EAGAIN || error == EACCES) return false;
  if (error != 0) throw StorageError(fmt::format("cannot lock '{}': {}", path_, reason(error)));
  return true;
}

void FolderLock::lock(std::uint64_t place, Kind kind) {
  if (const int error = apply(kind == Kind::kShared ? F_RDLCK : F_WRLCK, place, true); error != 0)
    throw StorageError(fmt::format("cannot lock '{}': {}", path_, reason(error)));
}

void FolderLock::unlock(std::uint64_t place) { apply(F_UNLCK, place, false); }

std::uint64_t lock_place(std::string_view text) {
  std::uint64_t hash = 14695981039346656037ULL;  // FNV-1a
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return (hash >> 2) | 16;  // below 2^62: a place in a file
}

}  // namespace duet
