#include "bench/cli/tables.h"

#include "bench/story.h"
#include "results/certificate.h"

namespace duet::cli {

Tables make_tables(const std::vector<EpisodeRow>& rows, const nlohmann::json& certificate) {
  return {leaderboard(rows), across_engines(rows), contact_table(rows), controller_table(rows), certificate};
}

std::string tables_text(const Tables& tables) {
  std::string text = leaderboard_markdown(tables.leaderboard, !tables.has_engines());
  if (tables.has_controllers()) text += "\n" + controller_table_markdown(tables.controllers);
  if (tables.has_engines())
    text += "\n" + cross_engine_markdown(tables.engines) + "\n" +
            certificate_markdown(tables.certificate, tables.engines.engines);
  if (tables.has_contacts()) text += "\n" + contact_table_markdown(tables.contacts);
  return text;
}

void add_tables(const Tables& tables, nlohmann::json& json) {
  json["leaderboard"] = leaderboard_json(tables.leaderboard);
  if (tables.has_engines()) json["engines"] = cross_engine_json(tables.engines);
  if (tables.has_controllers()) json["controllers"] = controller_table_json(tables.controllers);
  if (tables.has_contacts()) json["contacts"] = contact_table_json(tables.contacts);
}

}  // namespace duet::cli
