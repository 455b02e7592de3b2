// Locks that processes share who work in one run folder: bytes of an empty file, each for one purpose. The system takes
// them back from a process that ends in whatever way, on other machines too where the folder is on a network. Locks of
// one FolderLock do not exclude one another. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace duet {

class FolderLock {
 public:
  enum class Kind { kShared, kExclusive };

  explicit FolderLock(const std::string& path);  // creates the file; throws StorageError
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  // Whether it has the lock now; true without one where the file system has none (see refusal()).
  bool try_lock(std::uint64_t place, Kind kind = Kind::kExclusive);
  // Waits for it.
  void lock(std::uint64_t place, Kind kind = Kind::kExclusive);
  void unlock(std::uint64_t place);

  // Why the file system locks nothing; empty where it does. Known after the first lock.
  [[nodiscard]] const std::string& refusal() const { return refusal_; }

 private:
  int apply(short type, std::uint64_t place, bool wait);

  std::string path_, refusal_;
  int descriptor_ = -1;
};

// The byte that stands for a text, for example for an episode's key; never one of the first 16.
std::uint64_t lock_place(std::string_view text);

// Holds one byte for a scope.
class ScopedLock {
 public:
  ScopedLock(FolderLock& lock, std::uint64_t place) : lock_(lock), place_(place) { lock_.lock(place_); }
  ~ScopedLock() { lock_.unlock(place_); }
  ScopedLock(const ScopedLock&) = delete;
  ScopedLock& operator=(const ScopedLock&) = delete;

 private:
  FolderLock& lock_;
  std::uint64_t place_;
};

}  // namespace duet
