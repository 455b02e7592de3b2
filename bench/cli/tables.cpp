#include "duet/bench/cli/tables.h"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "duet/bench/story.h"
#include "duet/results/certificate.h"

namespace duet::cli {

Tables make_tables(const std::vector<EpisodeRow>& rows, const nlohmann::json& certificate) {
  std::vector<LeaderboardEntry> entries = leaderboard(rows);
  CrossEngine engines = across_engines(rows);
  ContactTable contacts = contact_table(rows);
  Board first = board(rows, entries, engines, contacts);
  return {.board = std::move(first),
          .leaderboard = std::move(entries),
          .engines = std::move(engines),
          .contacts = std::move(contacts),
          .controllers = controller_table(rows),
          .walking = walk_table(rows),
          .people = people_table(rows),
          .levels = level_tables(rows),
          .certificate = certificate};
}

std::string tables_text(const Tables& tables) {
  const std::string levels = levels_markdown(tables.levels);
  if (tables.has_walking()) return levels + (levels.empty() ? "" : "\n") + walk_table_markdown(tables.walking);
  std::vector<std::string> parts;
  if (!tables.board.rows.empty()) parts.push_back(board_markdown(tables.board));
  parts.push_back(leaderboard_markdown(tables.leaderboard, !tables.has_engines()));
  if (tables.has_people()) parts.push_back(people_table_markdown(tables.people));
  if (tables.has_levels()) parts.push_back(levels);
  if (tables.has_controllers()) parts.push_back(controller_table_markdown(tables.controllers));
  if (tables.has_engines()) {
    parts.push_back(cross_engine_markdown(tables.engines));
    parts.push_back(certificate_markdown(tables.certificate, tables.engines.engines));
  }
  if (tables.has_contacts()) parts.push_back(contact_table_markdown(tables.contacts));
  return fmt::format("{}", fmt::join(parts, "\n"));
}

void add_tables(const Tables& tables, nlohmann::json& json) {
  json["leaderboard"] = leaderboard_json(tables.leaderboard);
  if (tables.has_people()) json["people"] = people_table_json(tables.people);
  if (tables.has_levels()) json["levels"] = levels_json(tables.levels);
  if (tables.has_engines()) json["engines"] = cross_engine_json(tables.engines);
  if (tables.has_controllers()) json["controllers"] = controller_table_json(tables.controllers);
  if (tables.has_walking()) json["walking"] = walk_table_json(tables.walking);
  if (tables.has_contacts()) json["contacts"] = contact_table_json(tables.contacts);
}

}  // namespace duet::cli
