#include "duet/bench/cli/tables.h"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "duet/bench/story.h"
#include "duet/results/rows/certificate.h"

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

std::vector<Analysis> analyses_of(const Tables& tables) {
  std::vector<Analysis> analyses = {{.name = "leaderboard",
                                     .markdown = [&] { return leaderboard_markdown(tables.leaderboard); },
                                     .csv = [&] { return leaderboard_csv(tables.leaderboard); },
                                     .latex = [&] { return leaderboard_latex(tables.leaderboard); },
                                     .json = [&] { return leaderboard_json(tables.leaderboard); }}};
  if (tables.has_people())
    analyses.push_back(analysis_of("people", tables.people, people_table_markdown, people_table_csv, people_table_latex,
                                   people_table_json));
  if (tables.has_levels())
    analyses.push_back(analysis_of("levels", tables.levels, levels_markdown, levels_csv, levels_latex, levels_json));
  if (tables.has_engines()) {
    analyses.push_back(analysis_of("engines", tables.engines, cross_engine_markdown, cross_engine_csv,
                                   cross_engine_latex, cross_engine_json));
    analyses.back().markdown = [&] {
      return cross_engine_markdown(tables.engines) + "\n" +
             certificate_markdown(tables.certificate, tables.engines.engines);
    };
  }
  if (tables.has_controllers())
    analyses.push_back(analysis_of("controllers", tables.controllers, controller_table_markdown, controller_table_csv,
                                   controller_table_latex, controller_table_json));
  if (tables.has_walking())
    analyses.push_back(
        analysis_of("walking", tables.walking, walk_table_markdown, walk_table_csv, walk_table_latex, walk_table_json));
  if (tables.has_contacts())
    analyses.push_back(analysis_of("contacts", tables.contacts, contact_table_markdown, contact_table_csv,
                                   contact_table_latex, contact_table_json));
  return analyses;
}

}  // namespace duet::cli
