// The names that this program reads in a run directory may be files and folders of its own alone. A link, a pipe or a
// device under one of these names would make the program read or write something else, and a run may come from others
// (docs/trust.md).
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace duet {

// Throws InputError where one of a run's files, or anything in one of its folders, is neither a file nor a folder:
// which and what it is. Other names in the folder are not looked at.
void require_plain_files(const std::string& run);

// The same of one file or folder by its name below `run`, and of every folder on the way to it. One that is not there
// passes.
void require_plain_file(const std::string& run, const std::string& name);

// Files that a killed process left half-written beside those that they were to become: "run.json.part-4711-0".

// Removes those of processes that are no more from a run folder, its trajectories and its prepared clips. Only while
// nobody else works in the folder: a process of another machine cannot be seen from here.
void remove_litter(const std::string& folder);

// The manifest of a published run: the SHA-256 of every file.

// Lists every file that is in `folder` by now, beside what `about` says of the run. Throws StorageError.
void write_manifest(const std::string& folder, nlohmann::json about);

bool is_published(const std::string& folder);

// Throws InputError (file, expected, found) where `folder` is published and a file is not what the manifest says.
void check_published(const std::string& folder);

// Locks that processes share who work in one run folder: bytes of an empty file, each for one purpose. The system takes
// them back from a process that ends in whatever way, on other machines too where the folder is on a network. Locks of
// one FolderLock do not exclude one another. Not thread-safe.

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
