#include "duet/rows/folder/run_files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>
#include <system_error>
#include <utility>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::array kRunFiles = {"run.json", "env.json",      "suite.yaml", "episodes.jsonl", "resumed.jsonl",
                                  "lock",     "manifest.json", "hosts.json", "plan.json",      "decision.json"};
constexpr std::array kRunFolders = {"inputs", "trajectories", "prepared", "clips", "attempts", "slurm", "trainings"};

// A name that is gone by now is no fault: others may work in the folder.
void require_plain(const fs::path& path, const fs::file_status& status) {
  using Type = fs::file_type;
  const Type type = status.type();
  if (type == Type::regular || type == Type::directory || type == Type::not_found || type == Type::none) return;
  throw InputError(fmt::format(
      "'{}' is {}: expected a file or a folder of the run's own", excerpt(path.string(), 400),
      type == Type::symlink ? "a symbolic link, which may lead out of the folder" : "a device, a pipe or a socket"));
}

void require_plain_below(const fs::path& folder) {
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code gone;
    require_plain(entry->path(), entry->symlink_status(gone));
  }
}

}  // namespace

void require_plain_file(const std::string& run, const std::string& name) {
  fs::path path = run;
  for (const fs::path& part : fs::path(name)) {
    path /= part;
    std::error_code error;
    require_plain(path, fs::symlink_status(path, error));
  }
}

void require_plain_files(const std::string& run) {
  for (const char* name : kRunFiles) require_plain_file(run, name);
  for (const char* name : kRunFolders) {
    require_plain_file(run, name);
    require_plain_below(fs::path(run) / name);
  }
}

namespace {

constexpr std::string_view kMark = ".part-";

bool is_alive(pid_t process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

// The process that wrote a half-written file; 0 for any other name.
pid_t writer_of(std::string_view name) {
  const std::size_t mark = name.rfind(kMark);
  if (mark == std::string_view::npos) return 0;
  name.remove_prefix(mark + kMark.size());
  pid_t process = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), process);
  return error == std::errc() && process > 0 ? process : 0;
}

void remove_from(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(folder, error))) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const pid_t writer = writer_of(entry.path().filename().string());
    if (writer != 0 && !is_alive(writer)) fs::remove(entry.path(), error);
  }
}

}  // namespace

void remove_litter(const std::string& folder) {
  for (const char* name : {".", "trajectories", "prepared"}) remove_from(fs::path(folder) / name);
}

namespace {

constexpr const char* kPublishedSchema = "duet.published/1";
constexpr const char* kManifest = "manifest.json";
constexpr const char* kPublishedRows = "episodes.jsonl";

std::string file_of(const std::string& folder, const std::string& name) {
  return (std::filesystem::path(folder) / name).string();
}

// A path that leads nowhere but below the folder.
bool stays_below(const std::filesystem::path& path) {
  return !path.empty() && path.is_relative() && std::ranges::find(path, std::filesystem::path("..")) == path.end();
}

}  // namespace

void write_manifest(const std::string& folder, nlohmann::json about) {
  nlohmann::json files = nlohmann::json::object();
  for (const std::filesystem::directory_entry& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[entry.path().lexically_relative(folder).generic_string()] = sha256_file(entry.path().string());
  about["schema"] = kPublishedSchema;
  about["files"] = std::move(files);
  write_file(file_of(folder, kManifest), dumped(about, 2) + "\n");
}

bool is_published(const std::string& folder) { return std::filesystem::exists(file_of(folder, kManifest)); }

void check_published(const std::string& folder) {
  if (!is_published(folder)) return;
  const std::string path = file_of(folder, kManifest);
  const nlohmann::json json = parse_document(read_text(path), path, kPublishedSchema);
  const auto files = json_at<std::map<std::string, std::string>>(JsonNode(json, path), "files");
  if (!files.contains(kPublishedRows))
    throw InputError(fmt::format("{}: key 'files': expected the SHA-256 of {} and others", path, kPublishedRows));
  for (const auto& [name, digest] : files) {
    if (!stays_below(name))
      throw InputError(
          fmt::format("{}: key 'files': expected names of files in the folder, found '{}'", path, excerpt(name)));
    require_plain_file(folder, name);
    const std::string found = sha256_file(file_of(folder, name));
    if (digest != found)
      throw InputError(fmt::format("{}: SHA-256 expected {}, found {}: not what was published", file_of(folder, name),
                                   excerpt(digest), found));
  }
}

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
