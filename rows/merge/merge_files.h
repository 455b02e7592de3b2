// The files of a merge (rows/merge/row_merge.h): lines read once with their places, an index that is sorted on the
// disk, rows read again where they stand, a result that appears at once. Each object has one owner.
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "duet/core/task.h"

namespace duet {

// Where a row stands, and what decides about it.
struct RowEntry {
  std::string place;  // what rows are sorted by, the key at its end: equal for rows of one episode and no others
  std::array<unsigned char, 16> fingerprint{};
  std::string started_at;
  std::uint32_t source = 0, length = 0;  // length: of the line without its newline [bytes]
  std::uint64_t offset = 0;
  Outcome outcome = Outcome::kOk;
};

// Orders by place, then source and offset.
bool is_before(const RowEntry& a, const RowEntry& b);

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using OpenFile = std::unique_ptr<std::FILE, CloseFile>;

// Whole lines of a file, one after the other; none where there is no file. Throws InputError where it cannot be read
// and for a line of more than kMostTextBytes.
class LineFile {
 public:
  // Reads from the byte `begin` on, where a line begins.
  explicit LineFile(std::string path, std::uint64_t begin = 0);
  // The next line without its newline; valid until the next call.
  std::optional<std::string_view> next();
  [[nodiscard]] std::uint64_t offset() const { return offset_; }  // of the last line
  [[nodiscard]] int line() const { return line_; }                // its number, from 1
  [[nodiscard]] bool torn() const { return torn_; }               // at the end: whether a line without newline follows

 private:
  bool fill();

  std::string path_;
  OpenFile file_;
  std::vector<char> block_;                         // grows with the longest line
  std::size_t begin_ = 0, searched_ = 0, end_ = 0;  // in it: what is not given out yet, what has no newline
  std::uint64_t offset_ = 0, next_ = 0;
  int line_ = 0;
  bool torn_ = false;
};

// Sorted entries: in memory, or in a file without a name beside `output`. Throws StorageError.
class EntryStream {
 public:
  explicit EntryStream(std::vector<RowEntry> entries) : entries_(std::move(entries)) {}
  EntryStream(const std::string& output, const std::vector<RowEntry>& entries);
  // False at the end; else entry() is the next one, which may be moved from.
  bool next();
  [[nodiscard]] RowEntry& entry() { return entry_; }
  [[nodiscard]] const RowEntry& entry() const { return entry_; }

 private:
  std::vector<RowEntry> entries_;
  std::size_t place_ = 0;
  OpenFile file_;
  RowEntry entry_;
};

// Rows where they stand; some files are open at a time. Throws InputError for a file that became shorter.
class SourceFiles {
 public:
  explicit SourceFiles(std::vector<std::string> paths) : paths_(std::move(paths)) {}
  ~SourceFiles();
  SourceFiles(const SourceFiles&) = delete;
  SourceFiles& operator=(const SourceFiles&) = delete;
  std::string read(const RowEntry& entry);
  // The row to `to`, which has room for it.
  void read(const RowEntry& entry, char* to);

 private:
  int descriptor(std::uint32_t source);

  std::vector<std::string> paths_;
  std::list<std::uint32_t> used_;  // the latest first
  struct Open {
    int descriptor;
    std::list<std::uint32_t>::iterator place;
  };
  std::unordered_map<std::uint32_t, Open> open_;
};

// Lines that take the place of `path` in one step, on disk when commit() returns; without it nothing is left of them.
// Throws StorageError.
class ReplacedFile {
 public:
  explicit ReplacedFile(std::string path);
  ~ReplacedFile();
  ReplacedFile(const ReplacedFile&) = delete;
  ReplacedFile& operator=(const ReplacedFile&) = delete;
  // Room for a line of so many bytes, to be filled before the next call; its newline is set.
  char* line(std::size_t bytes);
  void commit();

 private:
  [[noreturn]] void fail();
  void flush();

  std::string path_, partial_;
  OpenFile file_;
  std::vector<char> block_;  // lines that are not in the file yet
  std::size_t filled_ = 0;
};

}  // namespace duet
