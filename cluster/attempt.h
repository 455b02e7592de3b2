// An attempt: what one worker did for one shard. It writes two files of its own and nobody else ever writes to them, so
// that nothing has to be locked: attempts/SHARD/NODE-PID-NUMBER.jsonl with its rows, each on disk before the next
// episode ends, and a journal of that name (.log) that begins with a header and says which episodes it was at and how
// it ended.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/file.h"
#include "duet/rows/episode_row.h"

namespace duet {

struct AttemptHeader {
  std::int64_t shard = 0;
  std::string node;  // of the cluster, or the machine's name
  std::int64_t pid = 0;
  std::string plan;        // shard_plan_digest
  std::string started_at;  // UTC, by the clock of the node
  nlohmann::json environment;
};

// One that began now, in this process.
AttemptHeader new_attempt(std::int64_t shard, const std::string& plan);

// $SLURMD_NODENAME, or the host's name.
std::string node_name();

// Thread-safe. Throws StorageError where the disk does not take it.
class AttemptWriter {
 public:
  // Creates both files in the run directory.
  AttemptWriter(const std::string& run, const AttemptHeader& header);
  ~AttemptWriter();
  AttemptWriter(const AttemptWriter&) = delete;
  AttemptWriter& operator=(const AttemptWriter&) = delete;

  void began(const std::string& key);
  // On disk when it returns.
  void append(const EpisodeRow& row);
  // Records a result without a row: a training.
  void did(const std::string& key, const std::string& outcome, double seconds);
  // `how`: "complete", "stopped", "storage".
  void ended(const std::string& how);
  [[nodiscard]] const std::string& journal() const { return journal_; }
  // The journal's file descriptor, for attempt.h.
  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  void say(const std::string& line);

  std::mutex mutex_;
  std::string journal_, rows_file_;
  int descriptor_ = -1;
  std::unique_ptr<LineAppender> rows_;  // with the first row
};

struct AttemptRecord {
  struct Done {
    std::string key, outcome;
    double seconds = 0.0;
  };
  struct Crash {
    std::string key, signal;
  };
  AttemptHeader header;
  std::string rows_file, journal;  // paths
  std::vector<std::string> open;   // begun, not done, not crashed
  std::vector<Done> done;
  std::vector<Crash> crashes;
  std::string end;           // empty: it works still, or was killed
  std::int64_t changed = 0;  // when the journal was written to last, by the clock of the file system [s]
};

// The lines of a journal. A line that is no whole one of its words is left out: a worker may be killed while it writes.
// None where the header is not whole: nothing came after it. Throws InputError for a header of something else.
std::optional<AttemptRecord> parse_journal(std::string_view text, const std::string& path);

// All attempts at a shard, by the names of their files; none where nobody began. An attempt whose journal has no whole
// header, or is gone, has rows and nothing else.
std::vector<AttemptRecord> read_attempts(const std::string& run, std::int64_t shard);

// Paths of the rows of all of a shard's attempts; those without a row have no such file.
std::vector<std::string> rows_files(const std::string& run, std::int64_t shard);

// Numbers of the shards that have a folder, sorted.
std::vector<std::int64_t> attempted_shards(const std::string& run);

// Now, by the clock of the file system that the run is on: that of a node may be an hour off. That of this machine
// where the folder takes no file. [s]
std::int64_t file_system_time(const std::string& run);

// Whether the attempt may be at work still: it has not ended, its process is there or on another node, and its journal
// was written to less than `silence` seconds before `now`.
bool may_be_alive(const AttemptRecord& attempt, std::int64_t now, double silence);

// The last note of a worker that crashes: which episode its thread was at, and the signal. A handler can reach nothing
// but globals, and there is one for the process.

// From now on SIGSEGV, SIGBUS, SIGFPE, SIGILL and SIGABRT append "crashed KEY SIGNAL" to this file before they end the
// program as they would; -1: they do not any more.
void note_crashes_in(int descriptor);

// This thread is at an episode, as long as the object lives. Also a stack for the handler, so that a stack that
// overflows is noted.
class CrashScope {
 public:
  explicit CrashScope(std::string_view key);
  ~CrashScope();
  CrashScope(const CrashScope&) = delete;
  CrashScope& operator=(const CrashScope&) = delete;
};

}  // namespace duet
