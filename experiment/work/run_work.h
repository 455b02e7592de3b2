// The episodes that a run has to do, shared with other processes that work in the same folder: each episode is claimed
// before it is run; one that another process is at is looked at again when the rest is done.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "duet/experiment/work/stop_token.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// Progress on standard error: a bar with rate and time left on a terminal, plain lines otherwise, nothing when quiet.
// Thread-safe.

class Progress {
 public:
  enum class Style { kAuto, kBar, kLines, kQuiet };
  explicit Progress(Style style = Style::kAuto);

  // Starts a stage of `total` items ("retargeting", 30, "clips"); ends the stage before.
  void start(const std::string& title, int total, const std::string& unit);
  void advance(int items = 1);
  // How much of the stage's work is done, 0 to 1, where items differ: the time left follows from it and no more from
  // the number of items. NaN: nobody knows yet.
  void set_share(double share);
  // A line of its own, between stages.
  void note(const std::string& sentence);
  // Prints the stage's last line: items, seconds, rate.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  void draw(bool last);
  [[nodiscard]] std::string line(double elapsed) const;

  Style style_;
  std::mutex mutex_;
  std::string title_, unit_;
  int total_ = 0, done_ = 0;
  std::optional<double> share_;
  bool active_ = false;
  Clock::time_point begin_, drawn_;
};

// Writes to standard error; never throws, whatever became of it.
void print_error(const std::string& text);

// "4 s", "2 min 05 s", "1 h 02 min".
std::string format_duration(double seconds);

// Thrown by an episode that was stopped: it leaves no row and runs again on resume.
struct EpisodeInterrupted {};

// The message of a row with outcome `error`, and which episode it is of; "" for another row.
std::string error_text(const EpisodeRow& row);
// The sentence about `count` of them, of which the first said so.
std::string errors_sentence(int count, const std::string& first_error);

class EpisodeDispatcher {
 public:
  EpisodeDispatcher(RunDirectory& run, const StopToken& stop) : run_(run), stop_(stop) {}

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
  const StopToken& stop_;
  std::mutex mutex_;
  std::vector<int> taken_;  // by others
  std::int64_t done_ = 0, others_ = 0;
  std::map<std::string, int> outcomes_;
  std::string first_error_;
};

}  // namespace duet
