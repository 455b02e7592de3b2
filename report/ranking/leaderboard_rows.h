// How leaderboard entries are laid out in tables: one row per (engine, controller, perturbation, policy), tasks as
// columns. Shared by the Markdown, LaTeX and HTML writers.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/ranking/leaderboard.h"
#include "duet/report/tables/text_table.h"

namespace duet {

struct LeaderboardRow {
  std::string engine, controller, policy, perturbation, arm;
  std::map<std::string, const LeaderboardEntry*> by_task;  // "all" included

  [[nodiscard]] const LeaderboardEntry* find(const std::string& task) const;
};

// Rows by engine, controller, perturbation; then the main arm by policy, the shuffled, and the null arm last.
std::vector<LeaderboardRow> leaderboard_rows(const std::vector<LeaderboardEntry>& entries);

// Rows of one engine after those of another, each engine's apart: for tables with a column per row, which would be too
// wide with many engines.
std::vector<std::vector<LeaderboardRow>> rows_by_engine(const std::vector<LeaderboardRow>& rows);

// Tasks that occur, in the order of all_tasks(), others after them by name; without "all".
std::vector<std::string> leaderboard_tasks(const std::vector<LeaderboardEntry>& entries);
// Names of other verdicts, or of metrics, that occur in any entry.
std::vector<std::string> other_verdicts(const std::vector<LeaderboardEntry>& entries);
std::vector<std::string> metric_names(const std::vector<LeaderboardEntry>& entries);

// "Engine", "Controller" and "Perturbation" as far as they differ, and "Policy".
RowLabels row_labels(const std::vector<LeaderboardRow>& rows);

// Sentences that belong under a leaderboard: what the figures are, small samples, episodes without a null pair,
// policies that did not play.
std::vector<std::string> leaderboard_notes(const std::vector<LeaderboardEntry>& entries);

// Whether any policy left out a plan or died: only then do tables have a column for it, under this title.
inline constexpr const char* kPlansLost = "Plans lost";
bool loses_plans(const std::vector<LeaderboardEntry>& entries);
std::string plans_lost(const LeaderboardEntry& entry);  // "13 late, 2 invalid, dead in 4", "0" where none is

// A sentence for each policy that left out a plan or died, with the first message of it; none where none did.
std::vector<std::string> policy_fault_notes(const std::vector<LeaderboardEntry>& entries);

}  // namespace duet
