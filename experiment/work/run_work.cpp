#include "duet/experiment/work/run_work.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numeric>
#include <thread>
#include <utility>

#include "duet/core/machine.h"

namespace duet {
namespace {

constexpr std::chrono::milliseconds kPatience(100);  // between two looks at episodes of other processes

}  // namespace

std::string error_text(const EpisodeRow& row) {
  if (row.outcome != Outcome::kError) return "";
  return fmt::format("{} {} of {}/{}/{}: {}", row.clip, row.episode, row.engine, row.controller, row.policy,
                     row.message.empty() ? "no message" : row.message);
}

std::string errors_sentence(int count, const std::string& first_error) {
  return fmt::format("{} episode{} ended with an error; the first, {}", count, count == 1 ? "" : "s", first_error);
}

void EpisodeDispatcher::run(int count, int threads, const std::function<std::string(int)>& key_at,
                            const std::function<EpisodeRow(int)>& run_at, Progress& progress) {
  std::vector<int> left(count);
  std::iota(left.begin(), left.end(), 0);
  bool waited = false;
  while (!left.empty() && !stop_.asked()) {
    parallel_for_each(static_cast<int>(left.size()), threads, [&](int i) {
      if (stop_.asked()) return;
      take(left[i], key_at(left[i]), run_at);
      progress.advance();
    });
    progress.advance(-static_cast<int>(taken_.size()));
    const bool waits = taken_.size() == left.size();
    left = std::exchange(taken_, {});
    if (waits && !std::exchange(waited, true))
      progress.start("waiting for another process", static_cast<int>(left.size()), "episodes");
    if (waits) std::this_thread::sleep_for(kPatience);
  }
}

void EpisodeDispatcher::take(int i, const std::string& key, const std::function<EpisodeRow(int)>& run_at) {
  switch (claim(key)) {
    case Claim::kTaken: {
      const std::lock_guard lock(mutex_);
      taken_.push_back(i);
      return;
    }
    case Claim::kDone: {
      const std::lock_guard lock(mutex_);
      ++others_;
      return;
    }
    case Claim::kMine:
      break;
  }
  try {
    record(run_at(i));
  } catch (const EpisodeInterrupted&) {
    const std::lock_guard lock(mutex_);
    run_.release(key);
  }
}

Claim EpisodeDispatcher::claim(const std::string& key) {
  const std::lock_guard lock(mutex_);
  return run_.claim(key);
}

void EpisodeDispatcher::record(const EpisodeRow& row) {
  const std::lock_guard lock(mutex_);
  if (!run_.append(row)) {
    ++others_;
    return;
  }
  ++done_;
  ++outcomes_[std::string(to_string(row.outcome))];
  if (first_error_.empty()) first_error_ = error_text(row);
}

namespace {

constexpr double kBarInterval = 0.1;    // [s] between redraws of the bar
constexpr double kLineInterval = 10.0;  // [s] between plain lines
constexpr int kBarWidth = 24;

double seconds_between(std::chrono::steady_clock::time_point a, std::chrono::steady_clock::time_point b) {
  return std::chrono::duration<double>(b - a).count();
}

// A bar moves the cursor: not where somebody has asked for plain text (no-color.org).
bool draws_on_terminal() {
  const char* plain = std::getenv("NO_COLOR");
  return isatty(STDERR_FILENO) != 0 && (plain == nullptr || *plain == '\0');
}

}  // namespace

void print_error(const std::string& text) {
  std::fputs(text.c_str(),
             stderr);  // nobody may be there to read it: the terminal is gone, the disk of the log is full
  std::fflush(stderr);
}

std::string format_duration(double seconds) {
  const long whole = std::lround(seconds);
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {:02d} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02d} min", whole / 3600, whole / 60 % 60);
}

Progress::Progress(Style style) : style_(style) {
  if (style_ == Style::kAuto) style_ = draws_on_terminal() ? Style::kBar : Style::kLines;
}

void Progress::start(const std::string& title, int total, const std::string& unit) {
  finish();
  const std::lock_guard lock(mutex_);
  title_ = title;
  unit_ = unit;
  total_ = total;
  done_ = 0;
  share_.reset();
  active_ = true;
  begin_ = drawn_ = Clock::now();
  if (style_ == Style::kLines) print_error(fmt::format("{}: {} {}\n", title_, total_, unit_));
}

void Progress::advance(int items) {
  const std::lock_guard lock(mutex_);
  done_ += items;
  draw(false);
}

void Progress::set_share(double share) {
  const std::lock_guard lock(mutex_);
  share_ = share;
}

void Progress::finish() {
  const std::lock_guard lock(mutex_);
  if (!active_) return;
  draw(true);
  active_ = false;
}

void Progress::note(const std::string& sentence) {
  const std::lock_guard lock(mutex_);
  if (style_ != Style::kQuiet) print_error(sentence + "\n");
}

std::string Progress::line(double elapsed) const {
  const double rate = elapsed > 0.0 ? done_ / elapsed : 0.0;
  std::string text = fmt::format("{}: {}/{} {}", title_, done_, total_, unit_);
  if (done_ > 0) text += fmt::format(", {:.3g}/s", rate);
  if (done_ == 0 || done_ >= total_) return text;
  const double share = share_.value_or(static_cast<double>(done_) / total_);
  if (share > 0.0) text += fmt::format(", {} left", format_duration(elapsed * (1.0 - share) / share));
  return text;
}

void Progress::draw(bool last) {
  if (style_ == Style::kQuiet || !active_) return;
  const Clock::time_point now = Clock::now();
  const double interval = style_ == Style::kBar ? kBarInterval : kLineInterval;
  if (!last && seconds_between(drawn_, now) < interval) return;
  drawn_ = now;
  const double elapsed = seconds_between(begin_, now);
  if (style_ == Style::kLines) {
    print_error(fmt::format("{}{}\n", line(elapsed), last ? fmt::format(" in {}", format_duration(elapsed)) : ""));
    return;
  }
  const int filled = total_ > 0 ? kBarWidth * done_ / total_ : kBarWidth;
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  print_error(fmt::format("\r[{}] {}\x1b[K{}", bar, line(elapsed), last ? "\n" : ""));
}

}  // namespace duet
