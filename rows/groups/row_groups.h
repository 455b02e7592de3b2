// Bringing rows together: the identity of an episode, the order in which sums are taken, the paired table of two arms.
#pragma once

#include <algorithm>
#include <compare>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "duet/rows/episode_row.h"
#include "duet/statistics/clustered.h"

namespace duet {

// The task of rows of robots that walk by command; their clip is the command.
inline constexpr std::string_view kWalkRows = "walk";

// One episode whatever runs in it.
struct EpisodeId {
  std::string task, clip;
  int episode = 0;
  std::string recording = {};  // kRecordingTag of its rows; no two ids differ by it alone

  auto operator<=>(const EpisodeId& other) const {
    return std::tie(task, clip, episode) <=> std::tie(other.task, other.clip, other.episode);
  }
  bool operator==(const EpisodeId& other) const { return (*this <=> other) == 0; }
};
EpisodeId episode_id(const EpisodeRow& row);

// The place of a task in the order of all_tasks; others after them, "all" last.
int task_rank(std::string_view task);

// Success under one detector, and under the suite's headline: only an episode that ended well may have it. One that
// fell, diverged, timed out or met an error has failed under every detector, whatever its verdict says.
bool verdict_success(const EpisodeRow& row, const Verdict& verdict);
bool headline_success(const EpisodeRow& row);  // false where no detector ruled, too

// Rows by task, clip and episode, so that sums do not depend on the order in which episodes ended.
std::vector<const EpisodeRow*> in_episode_order(const std::vector<EpisodeRow>& rows);

// Throws InputError that names both: results are comparable only within one suite version and one version of the
// detectors, and each policy, controller and engine's profile is one.
void require_one_suite(const std::vector<EpisodeRow>& rows);
// Throws InputError where two rows of one group are the same episode.
void require_distinct(const EpisodeRow& a, const EpisodeRow& b);

// Numbers for clips in the order in which they come, the clusters of every bootstrap over clips. A recording in either
// role is one clip, as its rows' tags say.
class ClipNumbers {
 public:
  int of(const std::string& task, const std::string& clip) {
    return numbers_.try_emplace({task, clip}, static_cast<int>(numbers_.size())).first->second;
  }
  int of(const EpisodeId& id) { return of(id.task, id.recording.empty() ? id.clip : id.recording); }
  [[nodiscard]] std::size_t size() const { return numbers_.size(); }

 private:
  std::map<std::pair<std::string, std::string>, int> numbers_;
};

// Success of episodes, or its mean over engines, with what clip each is of. They are added in the order of their ids.
class SuccessByClip {
 public:
  void add(const EpisodeId& id, double success);
  [[nodiscard]] long episodes() const { return static_cast<long>(values_.size()); }
  [[nodiscard]] long successes() const { return static_cast<long>(std::ranges::count(values_, 1.0)); }
  [[nodiscard]] long clips() const { return static_cast<long>(numbers_.size()); }
  [[nodiscard]] double mean() const { return mean_of(values_); }
  // wilson_by_clip; needs an episode.
  [[nodiscard]] Interval by_clip(double level) const { return wilson_by_clip(values_, clips_, level); }
  // Wilson's over the episodes, each a success or not; by clip where a clip has several.
  [[nodiscard]] Interval of_episodes(double level) const;
  // Draws or roles: some clip has more than one episode.
  [[nodiscard]] bool several_a_clip() const { return clips() < episodes(); }

 private:
  std::vector<double> values_;
  std::vector<int> clips_;
  ClipNumbers numbers_;
};

struct PairedTable {
  long both = 0, only_a = 0, only_b = 0, neither = 0;

  void add(bool a, bool b) { ++(a ? (b ? both : only_a) : (b ? only_b : neither)); }
  [[nodiscard]] long pairs() const { return both + only_a + only_b + neither; }
  [[nodiscard]] double rate_b() const { return static_cast<double>(both + only_b) / static_cast<double>(pairs()); }
  [[nodiscard]] double difference() const {
    return static_cast<double>(only_a - only_b) / static_cast<double>(pairs());
  }
};

// The same episodes under two arms, by their headline success. They are added in the order of their ids.
class EpisodePairs {
 public:
  void add(const EpisodeRow& a, const EpisodeRow& b);
  [[nodiscard]] const PairedTable& table() const { return table_; }
  [[nodiscard]] long clips() const { return static_cast<long>(numbers_.size()); }
  [[nodiscard]] bool several_a_clip() const { return clips() < table_.pairs(); }
  // Intervals by clip; both need a pair. `p`: sign_flip_exact.
  [[nodiscard]] Interval by_clip(double level) const { return newcombe_by_clip(a_, b_, clips_, level); }
  [[nodiscard]] Interval bootstrap(const IntervalOptions& options) const;  // never narrower than by_clip
  // Newcombe's over the pairs; by clip where a clip has several.
  [[nodiscard]] Interval of_episodes(double level) const;
  [[nodiscard]] double p() const;

 private:
  PairedTable table_;
  std::vector<double> a_, b_;
  std::vector<int> clips_;
  ClipNumbers numbers_;
};

// The one door through which rows enter statistics. Where policy, controller and start draw no random number, several
// episodes of one clip are one and the same, bit for bit; counted as independent they would make every interval and
// test narrower than it is. They count once.

// Rows by task, clip and episode, of repeats of one episode (equal in every field but key, number, seed and wall times)
// the one of the lowest number. Rows without a state hash repeat nothing. Throws as require_one_suite
// (rows/groups/row_groups.h).
std::vector<const EpisodeRow*> distinct_episodes(const std::vector<EpisodeRow>& rows);

// "8 of 12 episodes repeat another one bit for bit ... and count once (mujoco/vmc/replay clean: 8)"; "" where none
// does.
std::string repeats_note(const std::vector<EpisodeRow>& rows);

}  // namespace duet
