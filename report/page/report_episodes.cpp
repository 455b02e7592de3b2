// The episodes of the HTML report, failures that can be watched first, and the replays.
#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string_view>
#include <tuple>

#include "duet/report/page/report_parts.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/report/tables/escape_html.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

std::string scene_of(const EpisodeRow& row) {
  return fmt::format("{}/{}/{}/{}", row.task, row.clip, row.episode, row.perturbation);
}

// The episode's address in a replay: "replay.html#e=0123456789abcdef"; "" where none has it.
std::string address_of(const EpisodeRow& row, const std::vector<ReportReplay>& replays) {
  const auto replay = std::ranges::find_if(
      replays, [&](const ReportReplay& one) { return std::ranges::find(one.keys, row.key) != one.keys.end(); });
  return replay == replays.end() ? "" : fmt::format("{}#e={:.16}", replay->file, row.key);
}

std::string key_cell(const EpisodeRow& row, const std::vector<ReportReplay>& replays) {
  const std::string address = address_of(row, replays);
  if (address.empty()) return fmt::format("<td>{:.16}</td>", escape_html(row.key));
  return fmt::format(R"(<td><a href="{}">{:.16}</a></td>)", escape_html(address), escape_html(row.key));
}

std::string verdict_of(const EpisodeRow& row) {
  if (headline_success(row)) return "success";
  return row.outcome == Outcome::kOk ? "failure" : std::string(to_string(row.outcome));
}

bool failed(const EpisodeRow& row) { return !headline_success(row) && row.arm == "main"; }

}  // namespace

std::string policy_of_episode(const std::string& arm, const std::string& policy) {
  return arm == "main" ? policy : arm == "null" ? "null arm" : policy + " (" + arm + ")";
}

std::string replays_html(const std::vector<ReportReplay>& replays) {
  if (replays.empty()) return "";
  std::string html = R"(<p>In 3-D, where engines and policies agree least:</p><ul class="replays">)";
  for (const ReportReplay& replay : replays)
    html += fmt::format(R"(<li><a href="{}#e={}">{}</a><span class="ci">{} of {} succeed</span></li>)",
                        escape_html(replay.file), escape_html(replay.scene), escape_html(replay.name), replay.successes,
                        replay.judged);
  return html + "</ul>";
}

std::vector<EpisodeRow> listed_episodes(const std::vector<EpisodeRow>& rows, const std::vector<ReportReplay>& replays,
                                        std::size_t most) {
  if (rows.size() <= most) return rows;
  std::set<std::string_view> watched;
  for (const ReportReplay& replay : replays) watched.insert(replay.keys.begin(), replay.keys.end());
  std::vector<EpisodeRow> listed;
  for (const int rank : {0, 1, 2})
    for (const EpisodeRow& row : rows) {
      if (listed.size() == most) return listed;
      if (rank == (watched.contains(row.key) ? 0 : failed(row) ? 1 : 2)) listed.push_back(row);
    }
  return listed;
}

std::string episodes_html(const std::vector<EpisodeRow>& rows, const std::vector<ReportReplay>& replays,
                          std::size_t all) {
  if (rows.empty()) return "";
  std::vector<const EpisodeRow*> order;
  for (const EpisodeRow& row : rows) order.push_back(&row);
  std::ranges::stable_sort(order, {}, [&](const EpisodeRow* row) {
    return std::tuple(!failed(*row), address_of(*row, replays).empty(), scene_of(*row), row->arm, row->policy,
                      row->controller, row->engine);
  });
  std::string html;
  if (all > rows.size())
    html = fmt::format(
        "<p>{} of {} episodes: those with a replay, then failures. <code>duet report RUN --format sqlite</code> has "
        "them "
        "all.</p>",
        rows.size(), all);
  html +=
      R"(<div class="scroll tall" tabindex="0" role="region" aria-label="Episodes"><table class="sortable compact rows"><caption>Failures first. A key leads to the episode's replay, where there is one; <code>duet replay RUN --episodes KEY</code> makes one of any.</caption><thead><tr>)";
  for (const char* title : {"Task", "Clip", "Policy", "Controller", "Engine", "Perturbation", "Verdict", "Key"})
    html += fmt::format(R"(<th scope="col"><button type="button">{}</button></th>)", title);
  html += "</tr></thead><tbody>\n";
  for (const EpisodeRow* row : order) {
    const std::string policy = policy_of_episode(row->arm, row->policy);
    html += "<tr>";
    for (const std::string& cell :
         {row->task, row->episode == 0 ? row->clip : fmt::format("{} {}", row->clip, row->episode), policy,
          row->controller, row->engine, row->perturbation, verdict_of(*row)})
      html += fmt::format("<td>{}</td>", escape_html(cell));
    html += key_cell(*row, replays) + "</tr>\n";
  }
  return html + "</tbody></table></div>";
}

}  // namespace duet
