#include "duet/core/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>
#include <utility>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::int64_t kMostStreamBytes = std::int64_t{256} << 20;  // of a device or a pipe, which may have no end

std::string reason(int error) { return std::generic_category().message(error); }

[[noreturn]] void fail_to_read(const std::string& path, int error) {
  throw InputError(fmt::format("cannot read '{}': {}", path, reason(error)));
}

[[noreturn]] void fail_to_write(const std::string& path, const std::string& reason) {
  throw StorageError(fmt::format("cannot write '{}': {}", path, reason));
}
[[noreturn]] void fail_to_write(const std::string& path, int error) { fail_to_write(path, reason(error)); }

class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return value_; }
  int release() { return std::exchange(value_, -1); }
  // 0, or the error that closing reports (a network file system may tell here that the disk is full).
  int close() { return ::close(std::exchange(value_, -1)) == 0 ? 0 : errno; }

 private:
  int value_;
};

int open_file(const std::string& path, int flags, mode_t mode = 0) {
  int descriptor = -1;
  do descriptor = ::open(path.c_str(), flags | O_CLOEXEC, mode);
  while (descriptor < 0 && errno == EINTR);
  return descriptor;
}

// 0, or the error number. Bytes written before the error stay written.
int write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

// 0, or the error number. Devices and pipes have nothing to sync and answer EINVAL.
int sync_data(int descriptor) { return ::fsync(descriptor) == 0 || errno == EINVAL || errno == ENOTSUP ? 0 : errno; }

std::filesystem::path parent_folder(const std::string& path) {
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  return parent.empty() ? std::filesystem::path(".") : parent;
}

void create_parent(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(parent_folder(path), error);
  if (error) fail_to_write(path, error.value());
}

// Makes a rename or a new name durable. Some file systems cannot sync a folder: the file's content is safe by then.
void sync_parent(const std::string& path) {
  const Descriptor folder(open_file(parent_folder(path).string(), O_RDONLY | O_DIRECTORY));
  if (folder.get() >= 0) sync_data(folder.get());
}

// A device or a pipe (/dev/stdout) must be written to, not replaced by a file of that name.
void write_in_place(const std::string& path, std::string_view bytes) {
  Descriptor file(open_file(path, O_WRONLY));
  if (file.get() < 0) fail_to_write(path, errno);
  if (const int error = write_all(file.get(), bytes); error != 0) fail_to_write(path, error);
  if (const int error = file.close(); error != 0) fail_to_write(path, error);
}

struct TemporaryFile {
  std::string path;
  int descriptor;
};

// A new file beside `path` that no other process or thread has.
TemporaryFile create_beside(const std::string& path) {
  for (int n = 0;; ++n) {
    std::string candidate = fmt::format("{}.part-{}-{}", path, ::getpid(), n);
    const int descriptor = open_file(candidate, O_WRONLY | O_CREAT | O_EXCL, 0666);
    if (descriptor >= 0) return {std::move(candidate), descriptor};
    if (errno != EEXIST) fail_to_write(path, errno);
  }
}

// Writes `temporary` and puts it in the place of `path`: 0, or the error number with `path` untouched.
int fill_and_rename(Descriptor& file, const std::string& temporary, const std::string& path, std::string_view bytes,
                    std::optional<mode_t> mode, Durability durability) {
  if (mode && ::fchmod(file.get(), *mode) != 0) return errno;
  if (const int error = write_all(file.get(), bytes); error != 0) return error;
  if (durability == Durability::kSynced)
    if (const int error = sync_data(file.get()); error != 0) return error;
  if (const int error = file.close(); error != 0) return error;
  return ::rename(temporary.c_str(), path.c_str()) == 0 ? 0 : errno;
}

void replace_file(const std::string& path, std::string_view bytes, std::optional<mode_t> mode, Durability durability) {
  const TemporaryFile temporary = create_beside(path);
  Descriptor file(temporary.descriptor);
  if (const int error = fill_and_rename(file, temporary.path, path, bytes, mode, durability); error != 0) {
    ::unlink(temporary.path.c_str());
    fail_to_write(path, error);
  }
  if (durability == Durability::kSynced) sync_parent(path);
}

// Size of the file up to and including its last newline.
off_t complete_size(int descriptor, off_t size) {
  char buffer[4096];
  for (off_t end = size; end > 0;) {
    const off_t begin = std::max<off_t>(0, end - static_cast<off_t>(sizeof buffer));
    const ssize_t count = ::pread(descriptor, buffer, static_cast<std::size_t>(end - begin), begin);
    if (count <= 0) return size;  // unreadable: leave it whole
    const std::size_t newline = std::string_view(buffer, static_cast<std::size_t>(count)).rfind('\n');
    if (newline != std::string_view::npos) return begin + static_cast<off_t>(newline) + 1;
    end = begin;
  }
  return 0;
}

}  // namespace

std::string read_file(const std::string& path, std::int64_t most) {
  const Descriptor file(open_file(path, O_RDONLY));
  if (file.get() < 0) fail_to_read(path, errno);
  std::string bytes;
  struct stat status {};
  const bool regular = ::fstat(file.get(), &status) == 0 && S_ISREG(status.st_mode);
  const std::int64_t limit = regular ? most : std::min(most, kMostStreamBytes);
  if (regular && status.st_size <= limit) bytes.reserve(status.st_size);
  char buffer[1 << 16];
  for (;;) {
    const ssize_t count = ::read(file.get(), buffer, sizeof buffer);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_to_read(path, errno);
    if (count == 0) break;
    bytes.append(buffer, static_cast<std::size_t>(count));
    if (static_cast<std::int64_t>(bytes.size()) > limit)
      throw InputError(fmt::format("cannot read '{}': expected at most {} bytes, found more", path, limit));
  }
  refuse_no_data(path, bytes);
  if (read_observer() != nullptr) read_observer()(path, bytes);
  return bytes;
}

void write_file(const std::string& path, std::string_view bytes, Durability durability) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) {
    create_parent(path);
    return replace_file(path, bytes, std::nullopt, durability);
  }
  if (S_ISDIR(status.st_mode)) fail_to_write(path, EISDIR);
  if (!S_ISREG(status.st_mode)) return write_in_place(path, bytes);
  // Through a link the file that it points to is replaced, not the link.
  replace_file(std::filesystem::canonical(path).string(), bytes, status.st_mode & 07777, durability);
}

std::string join_without_links(const std::string& folder, const std::string& name) {
  namespace fs = std::filesystem;
  fs::path path = folder;
  for (const fs::path& part : fs::path(name)) {
    path /= part;
    std::error_code error;
    if (fs::is_symlink(fs::symlink_status(path, error)))
      fail_to_write((fs::path(folder) / name).string(),
                    fmt::format("'{}' is a symbolic link and may lead out of the folder; remove it", path.string()));
  }
  return path.string();
}

LineAppender::LineAppender(const std::string& path) : path_(path) {
  create_parent(path);
  Descriptor file(open_file(path, O_RDWR | O_CREAT | O_APPEND, 0666));
  if (file.get() < 0) fail_to_write(path, errno);
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) fail_to_write(path, errno);
  regular_ = S_ISREG(status.st_mode);
  if (regular_) {
    size_ = complete_size(file.get(), status.st_size);
    if (size_ != status.st_size && ::ftruncate(file.get(), size_) != 0) fail_to_write(path, errno);
    sync_parent(path);
  }
  descriptor_ = file.release();
}

LineAppender::~LineAppender() { ::close(descriptor_); }

void LineAppender::append(std::string_view line) {
  require(line.find('\n') == std::string_view::npos, "'{}': a line must not hold a newline", path_);
  if (!complete_) cut_back();
  const std::string text = std::string(line) + '\n';
  complete_ = false;
  int error = write_all(descriptor_, text);
  if (error == 0) error = sync_data(descriptor_);
  if (error != 0) {
    if (regular_ && ::ftruncate(descriptor_, size_) == 0) complete_ = true;
    fail_to_write(path_, error);
  }
  complete_ = true;
  size_ += static_cast<std::int64_t>(text.size());
}

std::string LineAppender::read_appended(bool cut) {
  struct stat status {};
  if (!regular_) return "";
  if (::fstat(descriptor_, &status) != 0) fail_to_write(path_, errno);
  if (status.st_nlink == 0) fail_to_write(path_, "it was removed while rows were written to it");
  if (status.st_size < size_) fail_to_write(path_, "it was made shorter while rows were written to it");
  std::string text(static_cast<std::size_t>(status.st_size - size_), '\0');
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count =
        ::pread(descriptor_, text.data() + done, text.size() - done, static_cast<off_t>(size_ + done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail_to_read(path_, errno);
    if (count == 0) text.resize(done);
    done += static_cast<std::size_t>(count);
  }
  const std::size_t whole = text.rfind('\n') + 1;  // 0 where there is none
  if (cut && whole < text.size() && ::ftruncate(descriptor_, size_ + static_cast<off_t>(whole)) != 0)
    fail_to_write(path_, errno);
  text.resize(whole);
  size_ += static_cast<std::int64_t>(whole);
  return text;
}

// A part of a line that could not be cut off when its write failed.
void LineAppender::cut_back() {
  if (regular_ && ::ftruncate(descriptor_, size_) != 0) fail_to_write(path_, errno);
  complete_ = true;
}

namespace {

using std::string_view_literals::operator""sv;

constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";

struct Beginning {
  std::string_view bytes;
  std::string_view fault;
};

constexpr std::string_view kLfs =
    "this is a Git LFS pointer, which stands in the place of the file: `git lfs pull` fetches the file itself";
constexpr std::string_view kAnnex =
    "this is a git-annex pointer, which stands in the place of the file: `git annex get` fetches the file itself";
constexpr std::string_view kOffice =
    "this is a document of an office program: save the table as CSV in UTF-8 and give that";
constexpr std::string_view kMatlab =
    "this is a MATLAB file: write its arrays to an NPZ (docs/file-formats.md has an example) and give that";
constexpr std::string_view kPage =
    "this is an HTML page, such as a server sends in the place of a file: fetch the file itself";
constexpr std::string_view kXmlError =
    "this is an error message of a server in XML, in the place of the file: fetch the file itself";

constexpr std::array<Beginning, 11> kBeginnings = {{{"version https://git-lfs.github.com/spec/", kLfs},
                                                    {"version https://hawser.github.com/spec/", kLfs},
                                                    {"/annex/objects/", kAnnex},
                                                    {"../.git/annex/objects/", kAnnex},
                                                    {".git/annex/objects/", kAnnex},
                                                    {"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", kOffice},
                                                    {"MATLAB 5.0 MAT-file", kMatlab},
                                                    {"MATLAB 7.", kMatlab},
                                                    {"%PDF-", "this is a PDF document, not data"},
                                                    {"Rar!\x1a\x07", "this is a RAR archive: unpack it"},
                                                    {"7z\xbc\xaf\x27\x1c", "this is a 7z archive: unpack it"}}};

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

// The name of the first entry of a zip archive tells OpenDocument and Office Open XML from NPZ and TorchScript.
bool is_office_archive(std::string_view bytes) {
  constexpr std::size_t kNameAt = 30;
  if (!bytes.starts_with("PK\x03\x04") || bytes.size() <= kNameAt) return false;
  const std::string_view name = bytes.substr(kNameAt);
  return name.starts_with("[Content_Types].xml") || name.starts_with("mimetypeapplication/vnd.oasis") ||
         name.starts_with("_rels/.rels");
}

std::string_view page_fault(std::string_view bytes) {
  const std::string text =
      lower(trimmed(bytes.starts_with(kUtf8Mark) ? bytes.substr(kUtf8Mark.size()) : bytes, " \t\r\n"));
  const std::string_view view = text;
  for (const std::string_view tag : {"<!doctype html", "<html", "<head>", "<body"})
    if (view.starts_with(tag)) return kPage;
  if (!view.starts_with("<?xml") && !view.starts_with("<!--")) return {};
  if (view.find("<html") != std::string_view::npos || view.find("<!doctype html") != std::string_view::npos)
    return kPage;
  return view.find("<error>") != std::string_view::npos && view.find("<code>") != std::string_view::npos ? kXmlError
                                                                                                         : ""sv;
}

bool is_plain(char c) { return (c >= ' ' && c <= '~') || c == '\n' || c == '\r' || c == '\t'; }

// Whether the first characters are plain ones of `width` bytes each, the plain byte at `place`, after a mark of as many
// bytes or of none.
bool is_wide_text(std::string_view bytes, std::size_t width, std::size_t place) {
  constexpr std::size_t kCharacters = 4;
  if (bytes.size() < width * kCharacters) return false;
  for (std::size_t i = 0; i < width * kCharacters; ++i)
    if (i % width == place ? !is_plain(bytes[i]) : bytes[i] != '\0') return false;
  return true;
}

std::string_view wide_text(std::string_view bytes) {
  const auto without = [&](std::string_view mark) {
    return bytes.starts_with(mark) ? bytes.substr(mark.size()) : bytes;
  };
  if (is_wide_text(without("\xff\xfe\0\0"sv), 4, 0) || is_wide_text(without("\0\0\xfe\xff"sv), 4, 3)) return "UTF-32";
  if (is_wide_text(without("\xff\xfe"sv), 2, 0) || is_wide_text(without("\xfe\xff"sv), 2, 1)) return "UTF-16";
  return {};
}

}  // namespace

std::string no_data_fault(std::string_view first_bytes) {
  const std::string_view bytes = first_bytes.substr(0, kToldBytes);
  for (const Beginning& known : kBeginnings)
    if (bytes.starts_with(known.bytes)) return std::string(known.fault);
  if (is_office_archive(bytes)) return std::string(kOffice);
  if (const std::string_view encoding = wide_text(bytes); !encoding.empty())
    return "this is text in " + std::string(encoding) + ": expected UTF-8, save it so";
  return std::string(page_fault(bytes));
}

void refuse_no_data(const std::string& path, std::string_view first_bytes) {
  const std::string fault = no_data_fault(first_bytes);
  if (fault.empty() || (fault == kPage && (path.ends_with(".html") || path.ends_with(".htm")))) return;
  throw InputError(fmt::format("'{}': {}", excerpt(path, kShownSentence), fault));
}

std::string_view without_byte_order_mark(std::string_view text) {
  return text.starts_with(kUtf8Mark) ? text.substr(kUtf8Mark.size()) : text;
}

std::string plain_text(std::string text) {
  text.erase(0, text.size() - without_byte_order_mark(text).size());
  std::size_t to = text.find('\r');
  if (to == std::string::npos) return text;
  for (std::size_t from = to; from < text.size(); ++from) {
    if (text[from] != '\r')
      text[to++] = text[from];
    else if (from + 1 == text.size() || text[from + 1] != '\n')
      text[to++] = '\n';
  }
  text.resize(to);
  return text;
}

ReadObserver& read_observer() {
  thread_local ReadObserver observer = nullptr;
  return observer;
}

namespace {

void refuse_empty(const std::string& path, const std::string& bytes) {
  if (bytes.empty()) throw InputError(fmt::format("'{}': the file is empty", excerpt(path, kShownSentence)));
}

}  // namespace

std::string read_data(const std::string& path, std::int64_t most) {
  std::string bytes = read_file(path, most);
  refuse_empty(path, bytes);
  return bytes;
}

std::string read_plain_text(const std::string& path, std::int64_t most) { return plain_text(read_data(path, most)); }

std::string read_head(const std::string& path, std::size_t most) {
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw InputError(
        fmt::format("cannot read '{}': {}", excerpt(path, kShownSentence), std::generic_category().message(errno)));
  std::string bytes(most, '\0');
  file.read(bytes.data(), static_cast<std::streamsize>(most));
  bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return bytes;
}

void require_data(const std::string& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) return;
  const std::string head = read_head(path, kToldBytes);
  refuse_empty(path, head);
  refuse_no_data(path, head);
}

std::string file_context_message(const std::string& path, const std::string& message) {
  return message.find(path) == std::string::npos ? path + ": " + message : message;
}

}  // namespace duet
