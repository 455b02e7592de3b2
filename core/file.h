// Reading whole files, and writes that leave either the old file or the new one. Every error names the path and the
// system's reason.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/require.h"

namespace duet {

// A disk or a folder that does not take what is written to it: full, over its quota, read-only, without permission. It
// says nothing of what was to be written: a run stops at it and goes on later.
class StorageError : public InputError {
 public:
  using InputError::InputError;
};

inline constexpr std::int64_t kMostFileBytes = std::int64_t{1} << 31;
inline constexpr std::int64_t kMostTextBytes = std::int64_t{64} << 20;

// Throws InputError ("cannot read 'x.bvh': No such file or directory"), also for a file of more than `most` bytes; a
// device or a pipe may have 256 MiB.
std::string read_file(const std::string& path, std::int64_t most = kMostFileBytes);
// A description that people write (YAML, JSON, CSV): 64 MiB at most.
inline std::string read_text(const std::string& path) { return read_file(path, kMostTextBytes); }

// Writes to a temporary file beside `path`, syncs and renames it; creates missing parent folders. Follows a link that
// `path` is. Throws StorageError (for example "cannot write 'runs/a/run.json': No space left on device") and leaves
// `path` as it was.
// Unsynced it is whole after the process is killed, but not after a power cut: for what is checked by its digest when
// it is used, and can be made again.
enum class Durability { kSynced, kUnsynced };
void write_file(const std::string& path, std::string_view bytes, Durability durability = Durability::kSynced);

// The path of `name` ("episodes.jsonl", "trajectories/a.npz") in a folder that may have come from others. Throws
// StorageError where `name`, or a folder on the way to it below `folder`, is a symbolic link: what is written into
// `folder` stays there.
std::string join_without_links(const std::string& folder, const std::string& name);

// Appends lines to one file; each is complete on disk (written and synced) when append() returns. A last line without
// its newline (a killed run) is cut off when the file is opened: where several processes write to it, under a lock that
// they share, and append() too. Not thread-safe: one owner.
class LineAppender {
 public:
  explicit LineAppender(const std::string& path);  // creates it; throws StorageError
  ~LineAppender();
  LineAppender(const LineAppender&) = delete;
  LineAppender& operator=(const LineAppender&) = delete;
  // `line` has no newline. Throws StorageError; a partly written line is cut off again.
  void append(std::string_view line);
  // Whole lines that others have appended since it was opened or last asked, each with its newline. With `cut` a rest
  // without one is cut off (only under the lock). Throws StorageError for a file that was removed or made shorter.
  std::string read_appended(bool cut);
  [[nodiscard]] std::int64_t size() const { return size_; }  // of the whole lines known [bytes]

 private:
  void cut_back();

  std::string path_;
  int descriptor_ = -1;
  std::int64_t size_ = 0;  // of the complete lines
  bool complete_ = true;   // nothing but complete lines is in the file
  bool regular_ = true;    // a device or a pipe cannot be cut
};

// Detection of a file that is no data at all, by its first bytes: a pointer of Git LFS, a page that a server sent, text
// in another encoding, a document of an office. Thread-safe.

inline constexpr std::size_t kToldBytes = 1024;  // from the beginning of a file, enough for every kind

// A sentence without the file's name ("this is a Git LFS pointer, ..."); "" where the bytes may be data.
std::string no_data_fault(std::string_view first_bytes);

// Throws InputError ("'FILE': this is ...") for the first bytes of a file. A file that is named ".html" may be a page.
void refuse_no_data(const std::string& path, std::string_view first_bytes);

// Text without the byte order mark that some editors write before UTF-8.
std::string_view without_byte_order_mark(std::string_view text);

// Text of any system: without that mark, and with "\n" in the place of "\r\n" and of "\r" alone.
std::string plain_text(std::string text);

// A callback that is told of each file that a thread reads whole (core/file.h), so that a reader knows nothing of those
// who want to know what it read. One per thread; only core/digest.h uses it.

using ReadObserver = void (*)(const std::string& path, std::string_view bytes);

// This thread's; null: nobody is told.
ReadObserver& read_observer();

// A file that a policy or a controller loads: part of what it is, wherever it lies.
struct LoadedFile {
  std::string role;  // "network", "library", "descriptor", "command wave.py": an option's name where one gives its path
  std::string path;
};

using LoadedFiles = std::vector<LoadedFile>;

// Files that others made, for whoever reads them: what is no data at all is said by name (file.h), text of any
// system becomes plain. Thread-safe.

// read_file() of what a reader reads. Throws InputError also where the file is empty.
std::string read_data(const std::string& path, std::int64_t most = kMostFileBytes);

// The same of text that is read line by line (CSV, BVH, lists of names): without a byte order mark, with "\n" in the
// place of "\r\n" and of "\r" alone.
std::string read_plain_text(const std::string& path, std::int64_t most = kMostTextBytes);

// At most `most` bytes from the beginning, as they are. Throws InputError where the file cannot be read.
std::string read_head(const std::string& path, std::size_t most);

// Throws what read_data() would throw at the first bytes, for whoever reads a file in parts. A folder is let be.
void require_data(const std::string& path);

// Names the file in errors that are found only after it was read. Thread-safe.

// "FILE: MESSAGE", or the message alone where it names the file already.
std::string file_context_message(const std::string& path, const std::string& message);

// The result of `work`. Its InputError, std::invalid_argument and std::bad_alloc become an InputError that names the
// file.
template <typename Work>
decltype(auto) with_file_context(const std::string& path, Work&& work) {
  try {
    return std::forward<Work>(work)();
  } catch (const StorageError&) {
    throw;  // the disk's fault, not the file's
  } catch (const InputError& error) {
    throw InputError(file_context_message(path, error.what()));
  } catch (const std::invalid_argument& error) {
    throw InputError(file_context_message(path, error.what()));
  } catch (const std::bad_alloc&) {
    throw InputError(file_context_message(path, "there is not enough memory for it"));
  }
}

}  // namespace duet
