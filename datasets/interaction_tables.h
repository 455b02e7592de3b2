// How two people interact, task by task: the statistics of a set of clips, alone or beside another set's.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "duet/core/task.h"
#include "duet/metrics/clip_statistics.h"
#include "duet/report/tables/text_table.h"

namespace duet {

// Statistics of the clips of a set, in the order of its clips.
struct InteractionSet {
  std::string name;  // heads its column
  std::vector<Task> tasks;
  std::vector<InteractionStatistics> clips;                    // as long as `tasks`
  std::vector<std::vector<std::vector<double>>> windows = {};  // likewise: motion_windows() of each; or empty

  [[nodiscard]] std::vector<InteractionStatistics> of(Task task) const;
};

// One row a statistic, one column a set: 5, 50 and 95 % over the clips of a task, the mean of a share.
TextTable interaction_table(std::span<const InteractionSet> sets, Task task);
// Both sets side by side, the ratio of the middles (the difference of shares), and "*" where they do not agree
// (kAgreement). "-" where one of them has no value.
TextTable interaction_table(const InteractionSet& set, const InteractionSet& against, Task task);

// How many statistics of a task both sets have, and in how many they agree.
struct InteractionAgreement {
  int compared = 0, agreeing = 0;
};
InteractionAgreement interaction_agreement(const InteractionSet& set, const InteractionSet& against, Task task);

// How well a classifier (statistics/told_apart.h) tells the clips of the first set from those of all others together,
// and, as controls, each other set from the rest and one half of the others from the other half (in brackets the least
// and the largest of several draws): by the statistics of a clip (but for the rate of the recording, which nobody
// sees), and by short windows of either person's motion. "-" where one side has fewer than kFewestToTell clips.
TextTable told_apart_table(std::span<const InteractionSet> sets, Task task);
// The features by which the first set is known: a sentence each of statistics and windows; "" where nothing was
// compared.
std::string told_by(std::span<const InteractionSet> sets, Task task);

}  // namespace duet
