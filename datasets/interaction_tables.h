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
  std::vector<InteractionStatistics> clips;  // as long as `tasks`

  [[nodiscard]] std::vector<InteractionStatistics> of(Task task) const;
};

// One row a statistic: 10, 50 and 90 % over the clips of a task, the mean of a share.
TextTable interaction_table(const InteractionSet& set, Task task);
// Both sets side by side, the ratio of the middles (the difference of shares), and "*" where they do not agree
// (kAgreement). "-" where one of them has no value.
TextTable interaction_table(const InteractionSet& set, const InteractionSet& against, Task task);

// How many statistics of a task both sets have, and in how many they agree.
struct InteractionAgreement {
  int compared = 0, agreeing = 0;
};
InteractionAgreement interaction_agreement(const InteractionSet& set, const InteractionSet& against, Task task);

}  // namespace duet
