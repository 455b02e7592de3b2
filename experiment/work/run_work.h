// The episodes that a run has to do, shared with other processes that work in the same folder: each episode is claimed
// before it is run; one that another process is at is looked at again when the rest is done.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "duet/experiment/work/progress.h"
#include "duet/experiment/work/stop_sign.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// Thrown by an episode that was stopped: it leaves no row and runs again on resume.
struct EpisodeInterrupted {};

// The message of a row with outcome `error`, and which episode it is of; "" for another row.
std::string error_text(const EpisodeRow& row);
// The sentence about `count` of them, of which the first said so.
std::string errors_sentence(int count, const std::string& first_error);

class SharedWork {
 public:
  SharedWork(RunDirectory& run, const StopSign& stop) : run_(run), stop_(stop) {}

  // Episodes 0 to count - 1 by `run_at`, on `threads` threads. Returns when all have rows, or after the sign. Throws
  // what run_at and RunDirectory::append throw.
  void run(int count, int threads, const std::function<std::string(int)>& key_at,
           const std::function<EpisodeRow(int)>& run_at, Progress& progress);

  [[nodiscard]] std::int64_t done() const { return done_; }
  [[nodiscard]] std::int64_t done_by_others() const { return others_; }
  [[nodiscard]] const std::map<std::string, int>& outcomes() const { return outcomes_; }  // of those done here
  [[nodiscard]] const std::string& first_error() const { return first_error_; }  // error_text of the first; "" for none

 private:
  Claim claim(const std::string& key);
  void take(int i, const std::string& key, const std::function<EpisodeRow(int)>& run_at);
  void record(const EpisodeRow& row);

  RunDirectory& run_;
  const StopSign& stop_;
  std::mutex mutex_;
  std::vector<int> taken_;  // by others
  std::int64_t done_ = 0, others_ = 0;
  std::map<std::string, int> outcomes_;
  std::string first_error_;
};

}  // namespace duet
