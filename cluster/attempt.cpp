#include "duet/cluster/attempt.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <random>
#include <set>
#include <system_error>
#include <utility>
#include <vector>

#include "duet/core/require.h"
#include "duet/execution/experiment.h"
#include "duet/rows/folder/environment.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kAttemptSchema = "duet.attempt/1";

std::string shard_folder(std::int64_t shard) { return fmt::format("attempts/{:06}", shard); }

// A name that may stand in a file's.
std::string plain(const std::string& name) {
  std::string text = name.substr(0, 64);
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '.' && c != '_') c = '_';
  return text.empty() ? "node" : text;
}

}  // namespace

template <>
const JsonSchema<AttemptHeader>& json_schema<AttemptHeader>() {
  using H = AttemptHeader;
  static const JsonSchema<H> schema = {{{"shard"}, &H::shard},
                                       {{"node"}, &H::node},
                                       {{"pid"}, &H::pid},
                                       {{"plan"}, &H::plan},
                                       {{"started_at"}, &H::started_at},
                                       {{"environment"},
                                        "object or null",
                                        [](const H& header) { return header.environment; },
                                        [](const JsonNode& node, H& header) { header.environment = node.value(); }}};
  return schema;
}

namespace {

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t begin = 0; begin < line.size();) {
    const std::size_t end = std::min(line.find(' ', begin), line.size());
    if (end > begin) words.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

void take_line(std::string_view line, AttemptRecord& record) {
  const std::vector<std::string_view> words = words_of(line);
  if (words.size() < 2) return;
  const std::string key(words[1]);
  if (words[0] == "began" && words.size() == 2) {
    record.open.push_back(key);
  } else if (words[0] == "did" && words.size() == 4) {
    const std::optional<double> seconds = parse_number(std::string(words[3]));
    if (!seconds) return;
    record.done.push_back({key, std::string(words[2]), *seconds});
    std::erase(record.open, key);
  } else if (words[0] == "crashed" && words.size() == 3) {
    record.crashes.push_back({key, std::string(words[2])});
    std::erase(record.open, key);
  } else if (words[0] == "ended" && words.size() == 2) {
    record.end = key;
  }
}

bool runs_here(const AttemptHeader& header) {
  if (header.node != node_name()) return true;  // of another node nothing is known
  return ::kill(static_cast<pid_t>(header.pid), 0) == 0 || errno != ESRCH;
}

// Opens a new file of the folder to write, without a name: a process that is killed leaves nothing. -1 where the folder
// takes none.
int open_nameless(const std::string& folder) {
  const int nameless = ::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
  if (nameless >= 0) return nameless;
  // A file system that has no such files.
  const std::string probe =
      (fs::path(folder) / fmt::format("clock.part-{}-{:08x}", ::getpid(), std::random_device()())).string();
  const int named = ::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (named >= 0) ::unlink(probe.c_str());
  return named;
}

std::int64_t change_time(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 ? static_cast<std::int64_t>(status.st_mtim.tv_sec) : 0;
}

std::vector<std::string> names_in_folder(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    names.push_back(entry->path().filename().string());
  std::ranges::sort(names);
  return names;
}

}  // namespace

std::string node_name() {
  if (const char* node = std::getenv("SLURMD_NODENAME"); node != nullptr && *node != '\0') return node;
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "node";
}

AttemptHeader new_attempt(std::int64_t shard, const std::string& plan) {
  return {.shard = shard,
          .node = node_name(),
          .pid = ::getpid(),
          .plan = plan,
          .started_at = utc_now(),
          .environment = capture_environment()};
}

AttemptWriter::AttemptWriter(const std::string& run, const AttemptHeader& header) {
  const std::string name = fmt::format("{}/{}-{}-{:08x}", shard_folder(header.shard), plain(header.node), header.pid,
                                       std::random_device()());
  journal_ = join_without_links(run, name + ".log");
  rows_file_ = join_without_links(run, name + ".jsonl");
  std::error_code error;
  fs::create_directories(fs::path(journal_).parent_path(), error);
  if (error) throw StorageError(fmt::format("cannot write '{}': {}", journal_, error.message()));
  descriptor_ = ::open(journal_.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0)
    throw StorageError(fmt::format("cannot write '{}': {}", journal_, std::generic_category().message(errno)));
  say(dumped(json_document(kAttemptSchema, header)));
}

AttemptWriter::~AttemptWriter() { ::close(descriptor_); }

// Not synced: it says what a process did that was killed, and a machine that lost power knows nothing of its processes.
void AttemptWriter::say(const std::string& line) {
  const std::string text = line + '\n';
  ssize_t written = -1;
  do written = ::write(descriptor_, text.data(), text.size());
  while (written < 0 && errno == EINTR);
  if (written != static_cast<ssize_t>(text.size()))
    throw StorageError(fmt::format("cannot write '{}': {}", journal_,
                                   written < 0 ? std::generic_category().message(errno) : "the disk is full"));
}

void AttemptWriter::began(const std::string& key) {
  const std::lock_guard lock(mutex_);
  say("began " + key);
}

void AttemptWriter::append(const EpisodeRow& row) {
  const std::lock_guard lock(mutex_);
  if (!rows_) rows_ = std::make_unique<LineAppender>(rows_file_);
  rows_->append(dumped(to_json(row)));
  say(fmt::format("did {} {} {:.3f}", row.key, to_string(row.outcome), row.wall_s));
}

void AttemptWriter::did(const std::string& key, const std::string& outcome, double seconds) {
  const std::lock_guard lock(mutex_);
  say(fmt::format("did {} {} {:.3f}", key, outcome, seconds));
}

void AttemptWriter::ended(const std::string& how) {
  const std::lock_guard lock(mutex_);
  say("ended " + how);
}

std::optional<AttemptRecord> parse_journal(std::string_view text, const std::string& path) {
  const std::size_t first = text.find('\n');
  if (first == std::string_view::npos) return std::nullopt;
  AttemptRecord record;
  record.header = read_document<AttemptHeader>(text.substr(0, first), path + ":1", kAttemptSchema);
  for (std::size_t begin = first + 1; begin < text.size();) {
    const std::size_t end = text.find('\n', begin);
    if (end == std::string_view::npos) break;
    take_line(text.substr(begin, end - begin), record);
    begin = end + 1;
  }
  return record;
}

std::vector<AttemptRecord> read_attempts(const std::string& run, std::int64_t shard) {
  const fs::path folder = fs::path(run) / shard_folder(shard);
  std::vector<AttemptRecord> attempts;
  std::set<std::string> names;  // a worker may have neither row nor, where somebody removed it, journal
  for (const std::string& name : names_in_folder(folder.string()))
    if (name.ends_with(".log") || name.ends_with(".jsonl")) names.insert(fs::path(name).stem().string());
  for (const std::string& name : names) {
    const std::string path = (folder / (name + ".log")).string();
    std::optional<AttemptRecord> record;
    if (fs::exists(path)) record = parse_journal(read_file(path), path);
    if (!record) record.emplace();
    record->journal = path;
    record->rows_file = (folder / (name + ".jsonl")).string();
    record->changed = change_time(path);
    attempts.push_back(std::move(*record));
  }
  return attempts;
}

std::vector<std::string> rows_files(const std::string& run, std::int64_t shard) {
  const fs::path folder = fs::path(run) / shard_folder(shard);
  std::vector<std::string> paths;
  for (const std::string& name : names_in_folder(folder.string()))
    if (name.ends_with(".jsonl")) paths.push_back((folder / name).string());
  return paths;
}

std::vector<std::int64_t> attempted_shards(const std::string& run) {
  std::vector<std::int64_t> shards;
  for (const std::string& name : names_in_folder((fs::path(run) / "attempts").string())) {
    std::int64_t shard = -1;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), shard);
    if (error == std::errc() && end == name.data() + name.size() && shard >= 0) shards.push_back(shard);
  }
  std::ranges::sort(shards);
  return shards;
}

std::int64_t file_system_time(const std::string& run) {
  const int descriptor = open_nameless(run);
  if (descriptor < 0) return static_cast<std::int64_t>(std::time(nullptr));
  static_cast<void>(!::write(descriptor, "\n", 1));
  static_cast<void>(::fsync(descriptor));  // over a network the server's clock stands in it only then
  struct stat status {};
  const bool known = ::fstat(descriptor, &status) == 0;
  ::close(descriptor);
  return static_cast<std::int64_t>(known ? status.st_mtim.tv_sec : std::time(nullptr));
}

bool may_be_alive(const AttemptRecord& attempt, std::int64_t now, double silence) {
  if (attempt.header.pid <= 0 || !attempt.end.empty() || !attempt.crashes.empty() || !runs_here(attempt.header))
    return false;
  return static_cast<double>(now - attempt.changed) < silence;
}

namespace {

constexpr std::size_t kKeyBytes = 64;
constexpr std::array<std::pair<int, const char*>, 5> kCrashes = {
    {{SIGSEGV, "SIGSEGV"}, {SIGBUS, "SIGBUS"}, {SIGFPE, "SIGFPE"}, {SIGILL, "SIGILL"}, {SIGABRT, "SIGABRT"}}};

std::atomic<int> note_descriptor{-1};
thread_local std::array<char, kKeyBytes> key_of_thread{};  // zero bytes: at none

const char* name_of_crash(int signal) {
  for (const auto& [number, name] : kCrashes)
    if (number == signal) return name;
  return "signal";
}

// Only what POSIX allows in a handler: write and raise. A line of its own, whatever was half-written before it.
void on_crash(int signal) {
  const int descriptor = note_descriptor.exchange(-1);
  if (descriptor >= 0 && key_of_thread[0] != '\0') {
    std::array<char, kKeyBytes + 32> line{};
    char* end = std::copy_n("\ncrashed ", 9, line.begin());
    end = std::copy_if(key_of_thread.begin(), key_of_thread.end(), end, [](char c) { return c != '\0'; });
    *end++ = ' ';
    const char* name = name_of_crash(signal);
    end = std::copy_n(name, std::strlen(name), end);
    *end++ = '\n';
    static_cast<void>(!::write(descriptor, line.data(), static_cast<std::size_t>(end - line.data())));
  }
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

// A stack for the handler, once a thread.
class HandlerStack {
 public:
  HandlerStack() : bytes_(std::size_t{64} << 10) {
    const stack_t stack = {.ss_sp = bytes_.data(), .ss_flags = 0, .ss_size = bytes_.size()};
    ::sigaltstack(&stack, nullptr);
  }
  ~HandlerStack() {
    const stack_t none = {.ss_sp = nullptr, .ss_flags = SS_DISABLE, .ss_size = 0};
    ::sigaltstack(&none, nullptr);
  }
  HandlerStack(const HandlerStack&) = delete;
  HandlerStack& operator=(const HandlerStack&) = delete;
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }

 private:
  std::vector<char> bytes_;
};

}  // namespace

void note_crashes_in(int descriptor) {
  note_descriptor = descriptor;
  struct sigaction action {};
  action.sa_handler = descriptor >= 0 ? on_crash : SIG_DFL;
  action.sa_flags = SA_ONSTACK;
  ::sigemptyset(&action.sa_mask);
  for (const auto& [signal, name] : kCrashes) ::sigaction(signal, &action, nullptr);
}

CrashScope::CrashScope(std::string_view key) {
  thread_local const HandlerStack stack;
  static_cast<void>(stack.size());  // made now
  key_of_thread.fill('\0');
  std::copy_n(key.begin(), std::min(key.size(), kKeyBytes), key_of_thread.begin());
}

CrashScope::~CrashScope() { key_of_thread.fill('\0'); }

}  // namespace duet
