#include "duet/experiment/work/run_work.h"

#include <fmt/format.h>

#include <chrono>
#include <numeric>
#include <thread>
#include <utility>

#include "duet/core/parallel.h"

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

void SharedWork::run(int count, int threads, const std::function<std::string(int)>& key_at,
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

void SharedWork::take(int i, const std::string& key, const std::function<EpisodeRow(int)>& run_at) {
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

Claim SharedWork::claim(const std::string& key) {
  const std::lock_guard lock(mutex_);
  return run_.claim(key);
}

void SharedWork::record(const EpisodeRow& row) {
  const std::lock_guard lock(mutex_);
  if (!run_.append(row)) {
    ++others_;
    return;
  }
  ++done_;
  ++outcomes_[std::string(to_string(row.outcome))];
  if (first_error_.empty()) first_error_ = error_text(row);
}

}  // namespace duet
