#include "duet/rows/merge/merge_files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <random>
#include <system_error>
#include <tuple>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kMergeBlock = std::size_t{1} << 20;   // of what is read at once
constexpr std::size_t kIndexBlock = std::size_t{16} << 10;  // buffer of each sorted piece: there may be a thousand
constexpr std::size_t kMostOpenSources = 64;

std::string last_reason() { return std::generic_category().message(errno); }

// Two machines may have a process of one number.
std::string beside_output(const std::string& path) {
  return fmt::format("{}.part-{}-{:08x}", path, ::getpid(), std::random_device()());
}

template <typename T>
void put(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// The parts of fixed size of an entry, as they stand in a sorted piece.
struct EntryHead {
  std::uint32_t place_bytes, time_bytes, source, length;
  std::uint64_t offset;
  std::array<unsigned char, 16> fingerprint;
  Outcome outcome;
};

}  // namespace

bool is_before(const RowEntry& a, const RowEntry& b) {
  return std::tie(a.place, a.source, a.offset) < std::tie(b.place, b.source, b.offset);
}

LineFile::LineFile(std::string path, std::uint64_t begin)
    : path_(std::move(path)), file_(std::fopen(path_.c_str(), "rbe")), next_(begin) {
  const bool there = file_ && ::fseeko(file_.get(), static_cast<off_t>(begin), SEEK_SET) == 0;
  if (!there && errno != ENOENT) throw InputError(fmt::format("cannot read '{}': {}", path_, last_reason()));
}

// More of the file behind what is there; false at its end.
bool LineFile::fill() {
  if (!file_) return false;
  std::copy(block_.begin() + static_cast<std::ptrdiff_t>(begin_), block_.begin() + static_cast<std::ptrdiff_t>(end_),
            block_.begin());
  searched_ -= begin_;
  end_ -= begin_;
  begin_ = 0;
  if (static_cast<std::int64_t>(end_) > kMostTextBytes)
    throw InputError(
        fmt::format("{}:{}: expected a row of at most {} bytes, found more", path_, line_ + 1, kMostTextBytes));
  if (block_.size() < end_ + kMergeBlock) block_.resize(end_ + kMergeBlock);
  const std::size_t count = std::fread(block_.data() + end_, 1, kMergeBlock, file_.get());
  if (std::ferror(file_.get()) != 0) throw InputError(fmt::format("cannot read '{}': {}", path_, last_reason()));
  end_ += count;
  return count > 0;
}

std::optional<std::string_view> LineFile::next() {
  const auto newline = [this] { return std::string_view(block_.data(), end_).find('\n', searched_); };
  std::size_t end = newline();
  while (end == std::string_view::npos) {
    searched_ = end_;
    if (!fill()) {
      torn_ = begin_ < end_;
      return std::nullopt;
    }
    end = newline();
  }
  const std::string_view line(block_.data() + begin_, end - begin_);
  begin_ = searched_ = end + 1;
  offset_ = next_;
  next_ += line.size() + 1;
  ++line_;
  return line;
}

EntryStream::EntryStream(const std::string& output, const std::vector<RowEntry>& entries) {
  const std::string path = beside_output(output + ".index");
  file_.reset(std::fopen(path.c_str(), "w+be"));
  if (!file_) throw StorageError(fmt::format("cannot write '{}': {}", path, last_reason()));
  ::unlink(path.c_str());
  std::setvbuf(file_.get(), nullptr, _IOFBF, kIndexBlock);
  for (const RowEntry& entry : entries) {
    std::string bytes;
    put(bytes, EntryHead{.place_bytes = static_cast<std::uint32_t>(entry.place.size()),
                         .time_bytes = static_cast<std::uint32_t>(entry.started_at.size()),
                         .source = entry.source,
                         .length = entry.length,
                         .offset = entry.offset,
                         .fingerprint = entry.fingerprint,
                         .outcome = entry.outcome});
    bytes += entry.place;
    bytes += entry.started_at;
    if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size())
      throw StorageError(fmt::format("cannot write '{}': {}", path, last_reason()));
  }
  if (std::fflush(file_.get()) != 0) throw StorageError(fmt::format("cannot write '{}': {}", path, last_reason()));
  std::rewind(file_.get());
}

bool EntryStream::next() {
  if (!file_) {
    if (place_ == entries_.size()) return false;
    entry_ = std::move(entries_[place_++]);
    return true;
  }
  EntryHead head{};
  if (std::fread(&head, sizeof head, 1, file_.get()) != 1) return false;
  entry_.fingerprint = head.fingerprint;
  entry_.source = head.source;
  entry_.length = head.length;
  entry_.offset = head.offset;
  entry_.outcome = head.outcome;
  entry_.place.resize(head.place_bytes);
  entry_.started_at.resize(head.time_bytes);
  const bool whole = std::fread(entry_.place.data(), 1, head.place_bytes, file_.get()) == head.place_bytes &&
                     std::fread(entry_.started_at.data(), 1, head.time_bytes, file_.get()) == head.time_bytes;
  if (!whole) throw StorageError("cannot read the index of a merge back: the disk gave less than was written");
  return true;
}

SourceFiles::~SourceFiles() {
  for (const auto& [source, open] : open_) ::close(open.descriptor);
}

int SourceFiles::descriptor(std::uint32_t source) {
  if (const auto known = open_.find(source); known != open_.end()) {
    used_.splice(used_.begin(), used_, known->second.place);
    return known->second.descriptor;
  }
  if (open_.size() >= kMostOpenSources) {
    ::close(open_.at(used_.back()).descriptor);
    open_.erase(used_.back());
    used_.pop_back();
  }
  const int opened = ::open(paths_[source].c_str(), O_RDONLY | O_CLOEXEC);
  if (opened < 0) throw InputError(fmt::format("cannot read '{}': {}", paths_[source], last_reason()));
  used_.push_front(source);
  open_[source] = {opened, used_.begin()};
  return opened;
}

std::string SourceFiles::read(const RowEntry& entry) {
  std::string line(entry.length, '\0');
  read(entry, line.data());
  return line;
}

void SourceFiles::read(const RowEntry& entry, char* to) {
  const int from = descriptor(entry.source);
  for (std::size_t done = 0; done < entry.length;) {
    const ssize_t count = ::pread(from, to + done, entry.length - done, static_cast<off_t>(entry.offset + done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0)
      throw InputError(fmt::format("cannot read '{}': {}", paths_[entry.source],
                                   count < 0 ? last_reason() : "it was made shorter while it was read"));
    done += static_cast<std::size_t>(count);
  }
}

ReplacedFile::ReplacedFile(std::string path) : path_(std::move(path)), partial_(beside_output(path_)) {
  file_.reset(std::fopen(partial_.c_str(), "wbe"));
  if (!file_) throw StorageError(fmt::format("cannot write '{}': {}", path_, last_reason()));
  std::setvbuf(file_.get(), nullptr, _IONBF, 0);
  block_.resize(kMergeBlock);
}

ReplacedFile::~ReplacedFile() {
  if (file_) ::unlink(partial_.c_str());
}

void ReplacedFile::fail() { throw StorageError(fmt::format("cannot write '{}': {}", path_, last_reason())); }

void ReplacedFile::flush() {
  if (std::fwrite(block_.data(), 1, filled_, file_.get()) != filled_) fail();
  filled_ = 0;
}

char* ReplacedFile::line(std::size_t bytes) {
  if (filled_ + bytes + 1 > block_.size()) flush();
  if (bytes + 1 > block_.size()) block_.resize(bytes + 1);
  char* const place = block_.data() + filled_;
  place[bytes] = '\n';
  filled_ += bytes + 1;
  return place;
}

void ReplacedFile::commit() {
  flush();
  if (std::fflush(file_.get()) != 0 || ::fsync(::fileno(file_.get())) != 0) fail();
  if (::rename(partial_.c_str(), path_.c_str()) != 0) fail();
  file_.reset();
}

}  // namespace duet
