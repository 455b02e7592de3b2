// Progress on standard error: a bar with rate and time left on a terminal, plain lines otherwise, nothing when quiet.
// Thread-safe.
#pragma once

#include <chrono>
#include <mutex>
#include <optional>
#include <string>

namespace duet {

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

}  // namespace duet
