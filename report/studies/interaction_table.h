// The rule `interaction` (docs/detectors.md) as a run's rows hold it: success of every arm by task beside the detectors
// `robot` with the paper's thresholds, false starts, and for each condition of the rule how many episodes failed it.
// Clean episodes of every engine, the null arm too; nothing depends on the order of rows.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/analysis.h"

namespace duet {

// A robot that begins by more than this before its partner has made a false start. [s]
inline constexpr double kFalseStart = 0.3;

// By how much the robot begins before its partner, withdrawn beginnings included [s]: by the verdict of the rule where
// the row has it, else by `onset_s` and `partner_onset_s`. Nothing where one of the two never begins, or where nobody
// has to wait.
std::optional<double> lead_of(const EpisodeRow& row);

// The conditions in the order of the table, as the rule's verdict calls them.
inline constexpr std::array<const char*, 7> kInteractionParts = {"act",  "alone", "touch", "force",
                                                                 "body", "reply", "stands"};

struct InteractionEntry {
  PolicyKey key;
  std::string task;                    // "all" or one
  Rate success;                        // under the rule
  Rate before;                         // robot/paper; n = 0 where no row has it
  long fell = 0, unjudged = 0;         // unjudged: the rule cannot judge the episode, or it did not end
  std::map<std::string, long> failed;  // by condition: episodes that it was asked of and that do not meet it
  long led = 0, false_starts = 0;      // episodes in which both begin; of those, false starts
};

struct InteractionTable {
  double level = 0.95;
  std::vector<InteractionEntry> entries;  // arms by success, best first; of each all tasks and then every one
};

// Empty where no row has a verdict of the rule. Throws InputError as rows_of_policies.
InteractionTable interaction_table(const std::vector<EpisodeRow>& rows, double level = 0.95);

Analysis interaction_analysis(const InteractionTable& table);

}  // namespace duet
