// A run on disk, append-only and resumable: run.json, env.json, suite.yaml, episodes.jsonl and, where a run was
// resumed, resumed.jsonl (when, command line and environment of each resumption); everything else is derived.
// docs/architecture.md, 9. Several processes may work in one folder: each claims its episodes, rows are appended under
// a lock.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "duet/core/file.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/folder/run_files.h"
#include "duet/rows/folder/run_info.h"
#include "duet/rows/folder/run_rows.h"
#include "duet/rows/row_file.h"

namespace duet {

// The state of an episode: for this process to run now, in the folder by now, or another process is at it.
enum class Claim { kMine, kDone, kTaken };

class RunDirectory {
 public:
  // Creates the folder, or opens it to resume. An episode that timed out before counts as not there; with
  // `retry_errors` one that ended with an error does too. `replaced`: policies that may be others than those of the
  // folder; the rows and recordings of the old ones are removed then, while nobody else works in the folder. Throws
  // InputError: the folder holds a run of another suite (names both) or with another policy or controller under one
  // name (names it and both digests), is not a run and not empty, is published, has two rows of one episode that
  // differ; StorageError: it cannot be written, a link in it.
  static RunDirectory open(const std::string& path, const RunInfo& info, bool retry_errors = false,
                           const std::vector<std::string>& replaced = {});

  [[nodiscard]] const std::string& path() const { return path_; }
  // Whether the folder has the episode, as far as this process has looked.
  [[nodiscard]] bool has(const std::string& key) const;
  [[nodiscard]] std::size_t size() const { return keys_.size(); }
  // Why processes cannot share this folder: its file system has no locks. Empty where they can.
  [[nodiscard]] const std::string& lock_refusal() const { return lock_->refusal(); }

  // Looks into the folder first. A claim is given back by append(), by release() or by the end of the process.
  Claim claim(const std::string& key);
  void release(const std::string& key);
  // True: on disk when it returns. False: the folder has the episode by now, and this row is left out; where processes
  // share a folder without locks, another may have appended it before or after this one has looked.
  // Throws StorageError (a full disk); the file then ends with the last whole row. std::invalid_argument for a key that
  // is empty and for a row of another suite. Not thread-safe.
  bool append(const EpisodeRow& row);

  // Notes in run.json that this part of a suite of `episodes` is asked for; `count` counts what all parts have.
  void ask_for(const EpisodeFilter& part, std::int64_t episodes,
               const std::function<std::int64_t(const std::vector<EpisodeFilter>&)>& count);
  // Whether every episode is here that was ever asked for.
  [[nodiscard]] bool is_finished();

 private:
  struct Known {
    Outcome outcome = Outcome::kOk;
    bool from_before = false;  // in the folder when this process opened it
  };
  RunDirectory() = default;
  void read_rows(const RunInfo& info);
  void replace(RunInfo& found, const RunInfo& wanted, const std::vector<std::string>& policies, bool alone);
  void read_appended(bool cut);
  [[nodiscard]] bool may_run_again(const Known& known) const {
    if (!known.from_before) return false;
    return known.outcome == Outcome::kTimedOut || (retry_errors_ && known.outcome == Outcome::kError);
  }

  std::string path_, suite_hash_;
  bool retry_errors_ = false;
  std::unordered_map<std::string, Known> keys_;
  std::unique_ptr<FolderLock> lock_;
  std::unique_ptr<LineAppender> lines_;
};

struct Run {
  std::string path;  // the folder
  RunInfo info;
  std::vector<EpisodeRow> rows;  // in file order, last incomplete line dropped, each episode once
  RowFile file;                  // of lean rows (rows/row_file.h)
  int dropped_lines = 0;
  std::vector<std::string> warnings;  // sentences: rows that were left out because an equal one is there
};

// Throws InputError: not a run directory, a file of it that is a link (rows/folder/run_files.h), a broken row (file
// and line), a key that is not the row's, an episode twice with rows that differ, a row of another suite or of another
// policy or controller under one name, a published run that is not what was published (rows/folder/run_directory.h).
// Lean rows are for tables alone; Run::file has what they lack.
Run load_run(const std::string& path, RowExtent extent = RowExtent::kWhole);

// The same without its rows, which are not looked at.
Run load_run_head(const std::string& path);

// Whether episodes are missing that were asked for.
bool is_partial(const Run& run);
// "76 of 400 episodes: partial"; "100 of 400 episodes: the part that was asked for"; empty for a whole run and for one
// that does not say how many episodes it is to have.
std::string completeness(const Run& run);

// A run that others rely on: its rows without the traces that only plots of single episodes need, and a manifest with
// the SHA-256 of every file. A run directory like any other to read; what is in it can neither change unnoticed nor
// grow.

// Additions to the published rows, suite and environment: files of the run, named from its folder, and texts that stand
// under such a name.
struct PublishedInputs {
  std::set<std::string> files = {};
  std::map<std::string, std::string> texts = {};
};

// Writes `folder` at once: it is there whole or not at all. Files that the run names by their places on its machine are
// named from the working folder. Nothing else of the run is copied. Throws InputError for what is no run or a run
// without rows, for a file that is a link, and where `folder` is there already.
void publish_run(const std::string& run, const std::string& folder, const PublishedInputs& inputs = {});

}  // namespace duet
