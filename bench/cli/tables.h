// The tables of a run as `duet run` and `duet report` print them.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/results/analyses/analysis.h"
#include "duet/results/analyses/board.h"
#include "duet/results/analyses/contact_table.h"
#include "duet/results/analyses/controller_table.h"
#include "duet/results/analyses/cross_engine.h"
#include "duet/results/analyses/leaderboard.h"
#include "duet/results/analyses/level_table.h"
#include "duet/results/analyses/people_table.h"
#include "duet/results/analyses/walk_table.h"

namespace duet::cli {

struct Tables {
  Board board;
  std::vector<LeaderboardEntry> leaderboard;
  CrossEngine engines;
  ContactTable contacts;
  ControllerTable controllers;
  WalkTable walking;
  PeopleTable people;
  std::vector<LevelTable> levels;
  nlohmann::json certificate;  // null: none is attached

  [[nodiscard]] bool has_engines() const { return engines.engines.size() > 1; }
  [[nodiscard]] bool has_contacts() const { return !contacts.groups.empty(); }
  [[nodiscard]] bool has_controllers() const { return !controllers.entries.empty(); }
  [[nodiscard]] bool has_people() const { return !people.entries.empty(); }
  [[nodiscard]] bool has_levels() const { return !levels.empty(); }
  [[nodiscard]] bool has_walking() const { return !walking.entries.empty(); }
};

Tables make_tables(const std::vector<EpisodeRow>& rows, const nlohmann::json& certificate);

// Markdown for a terminal, in the order of the HTML report: the verdict and the board first. Where robots walk by
// command how they do, and nothing of acts; else, with several engines the metrics of each are left to the files; their
// drift is shown.
std::string tables_text(const Tables& tables);
// "leaderboard", and where there are any "people", "levels", "engines", "controllers", "walking" and "contacts". They
// refer to the tables.
std::vector<Analysis> analyses_of(const Tables& tables);

}  // namespace duet::cli
