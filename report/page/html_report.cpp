#include "duet/report/page/html_report.h"

#include <fmt/format.h>

#include <set>

#include "duet/core/text.h"
#include "duet/report/page/report_parts.h"
#include "duet/report/page/training_curves.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/report/tables/escape_html.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

// Open: what a reader looks at first; the others fold.
struct Section {
  std::string id, title, body;
  bool open = false;
};

std::string text_at(const nlohmann::json& json, std::initializer_list<const char*> keys) {
  const nlohmann::json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return "";
    at = &at->at(key);
  }
  return at->is_string() ? at->get<std::string>() : "";
}

std::string header_html(const ReportContent& content) {
  std::string html = fmt::format("<header><h1>{}</h1>", escape_html(content.title));
  std::string machine = text_at(content.environment, {"machine"});
  if (const std::string version = text_at(content.environment, {"build", "version"}); !version.empty()) {
    const std::string commit = text_at(content.environment, {"build", "commit"});
    machine += fmt::format("{}duet {}{}", machine.empty() ? "" : " · ", version,
                           commit.empty() ? "" : fmt::format(" ({})", commit.substr(0, 10)));
  }
  if (!machine.empty()) html += fmt::format(R"(<p class="machine">{}</p>)", escape_html(machine));
  html += verdict_html(content.board);
  if (!content.notes.empty()) {
    html += fmt::format(R"(<details class="notes"{}><summary>What the figures are: {} notes</summary><ul>)",
                        content.board.rows.empty() ? " open" : "", content.notes.size());
    for (const std::string& note : content.notes) html += fmt::format("<li>{}</li>", escape_html(note));
    html += "</ul></details>";
  }
  return html + "</header>\n";
}

std::string leaderboard_section(const ReportContent& content) {
  if (content.entries.empty()) return "";
  std::string html = leaderboard_html(content.entries);
  if (const std::string table = detector_table_html(content.entries); !table.empty()) {
    html += "<h3>Every detector</h3>" + table;
  }
  if (const std::string table = episode_metrics_html(content); !table.empty()) {
    html += "<h3>Episode metrics</h3>" + table;
  }
  return html;
}

// Buttons that show one task; hidden until the script that serves them runs.
std::string filter_html(const std::vector<ClipStory>& stories) {
  std::set<std::pair<int, std::string>> tasks;
  for (const ClipStory& story : stories) tasks.emplace(task_rank(story.task), story.task);
  if (tasks.size() < 2) return "";
  std::string html =
      R"(<div class="filter" role="group" aria-label="Show clips of" hidden><button type="button" data-task="" aria-pressed="true">All</button>)";
  for (const auto& [rank, task] : tasks) {
    html += fmt::format(R"(<button type="button" data-task="{}" aria-pressed="false">{}</button>)", escape_html(task),
                        escape_html(task_title(task)));
  }
  return html + "</div>";
}

std::string stories_section(const ReportContent& content) {
  if (content.stories.empty()) return "";
  std::string html = filter_html(content.stories);
  html +=
      "<p>Seen at right angles to the line between the two agents; limbs on the far side are paler. Ground ticks are "
      "0.5 m apart.</p>";
  for (const ClipStory& story : content.stories) html += story_html(story, content.columns);
  return html;
}

std::string training_section(const ReportContent& content) {
  std::string html;
  for (const TrainingCurves& curves : content.curves)
    html += fmt::format("<h3>{}</h3>", escape_html(curves.title)) + plots_html(curve_plots(curves));
  return html;
}

std::string environment_section(const ReportContent& content) {
  if (content.environment.is_null() || content.environment.empty()) return "";
  const std::string text = dumped(content.environment, 2);
  return fmt::format("<details><summary>What these results depend on</summary><pre>{}</pre></details>",
                     escape_html(text));
}

std::string navigation(const std::vector<Section>& sections) {
  std::string html = R"(<nav aria-label="Sections"><ul>)";
  for (const Section& section : sections) {
    html += fmt::format(R"(<li><a href="#{}">{}</a></li>)", section.id, section.title);
  }
  return html + "</ul></nav>\n";
}

}  // namespace

namespace {

std::vector<Section> sections_of(const ReportContent& content) {
  std::vector<Section> sections;
  const auto add = [&](const std::string& id, const std::string& title, std::string body, bool open = false) {
    if (!body.empty()) sections.push_back({id, title, std::move(body), open});
  };
  const auto add_analyses = [&](bool opens) {
    for (const Analysis& analysis : content.analyses)
      if (analysis.opens == opens && analysis.name != kLeaderboardName && analysis.name != kBoardName)
        add(analysis.name, analysis.title, analysis_html(analysis), opens);
  };
  add("board", "Board", board_html(content.board), true);
  add_analyses(true);
  add("tasks", "Tasks", task_map_html(content.board, content.entries), true);
  add("replays", "Replays", replays_html(content.replays), true);
  add("episodes", "Episodes", episodes_html(content.episodes, content.replays, content.all_episodes));
  add_analyses(false);
  add("leaderboard", "Every engine and task", leaderboard_section(content), content.board.rows.empty());
  add("retargeting", "Retargeting", retargeting_html(content));
  add("clips", "Clips", stories_section(content));
  add("training", "Training", training_section(content));
  add("environment", "Environment", environment_section(content));
  return sections;
}

std::string section_html(const Section& section) {
  return fmt::format(
      "<section id=\"{0}\" aria-labelledby=\"{0}-title\"><details class=\"fold\"{1}><summary><h2 "
      "id=\"{0}-title\">{2}</h2></summary>\n{3}</details></section>\n",
      section.id, section.open ? " open" : "", section.title, section.body);
}

}  // namespace

std::string html_report(const ReportContent& content) {
  const std::vector<Section> sections = sections_of(content);
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">"
      "<meta name=\"color-scheme\" content=\"light dark\"><title>{}</title>\n<style>{}</style></head>\n<body>",
      escape_html(content.title), report_style());
  html += header_html(content) + navigation(sections) + "<main>\n";
  for (const Section& section : sections) html += section_html(section);
  return html + fmt::format("</main>\n<script>{}</script>\n</body></html>\n", report_script());
}

}  // namespace duet
