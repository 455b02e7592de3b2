// Bringing rows together: the identity of an episode, the order in which sums are taken, the paired table of two arms.
#pragma once

#include <compare>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/results/rows/episode_row.h"

namespace duet {

// One episode whatever runs in it.
struct EpisodeId {
  std::string task, clip;
  int episode = 0;
  auto operator<=>(const EpisodeId&) const = default;
};
EpisodeId episode_id(const EpisodeRow& row);

// The place of a task in the order of all_tasks; others after them, "all" last.
int task_rank(std::string_view task);

// The suite's headline verdict; false for any outcome but ok and fell and where no detector ruled.
bool headline_success(const EpisodeRow& row);

// Rows by task, clip and episode, so that sums do not depend on the order in which episodes ended.
std::vector<const EpisodeRow*> in_episode_order(const std::vector<EpisodeRow>& rows);

// Throws InputError that names both: results are comparable only within one suite version and one version of the
// detectors, and each policy, controller and engine's profile is one.
void require_one_suite(const std::vector<EpisodeRow>& rows);
// Throws InputError where two rows of one group are the same episode.
void require_distinct(const EpisodeRow& a, const EpisodeRow& b);

// Numbers for clips in the order in which they come, the clusters of every bootstrap over clips. A clip in either role
// is one clip: "-A" and "-B" (motion/interaction_clip.h, set_reactor) are left out.
class ClipNumbers {
 public:
  int of(const std::string& task, std::string clip) {
    if (clip.ends_with("-A") || clip.ends_with("-B")) clip.resize(clip.size() - 2);
    return numbers_.try_emplace({task, std::move(clip)}, static_cast<int>(numbers_.size())).first->second;
  }
  int of(const EpisodeId& id) { return of(id.task, id.clip); }
  [[nodiscard]] std::size_t size() const { return numbers_.size(); }

 private:
  std::map<std::pair<std::string, std::string>, int> numbers_;
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

}  // namespace duet
