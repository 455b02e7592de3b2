#include "duet/report/page/html_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <string_view>
#include <tuple>

#include "duet/core/named_table.h"
#include "duet/report/page/html_page.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/report/ranking/ranking.h"
#include "duet/report/tables/line_plot.h"
#include "duet/report/tables/text_table.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr std::size_t kShownKey = 16;  // of an episode's key [characters]

struct Section {
  std::string id, title, body;
  bool open = false;  // at first: what a reader looks at; the others fold
};

std::string text_at(const nlohmann::json& json, std::initializer_list<const char*> keys) {
  const nlohmann::json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return "";
    at = &at->at(key);
  }
  return at->is_string() ? at->get<std::string>() : "";
}

const Analysis* analysis_of(const ReportContent& content, std::string_view name) {
  const auto found = std::ranges::find(content.analyses, name, &Analysis::name);
  return found == content.analyses.end() ? nullptr : &*found;
}

// The sentences of the board: the answer, before anything else.
std::string verdict_html(const ReportContent& content) {
  const Analysis* board = analysis_of(content, kRankingName);
  if (board == nullptr || board->notes.empty()) return "";
  std::string html;
  for (const std::string& sentence : board->notes)
    html += fmt::format("<p{}>{}</p>", html.empty() ? " class=\"first\"" : "", escape_html(sentence));
  return fmt::format("<div class=\"answer\">{}</div>\n", html);
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
  html += verdict_html(content);
  if (!content.notes.empty()) {
    html += fmt::format(R"(<details class="notes"{}><summary>What the figures are: {} notes</summary><ul>)",
                        analysis_of(content, kRankingName) == nullptr ? " open" : "", content.notes.size());
    for (const std::string& note : content.notes) html += fmt::format("<li>{}</li>", escape_html(note));
    html += "</ul></details>";
  }
  return html + "</header>\n";
}

std::string replays_section(const std::vector<ReportReplay>& replays) {
  if (replays.empty()) return "";
  std::string html = R"(<p>In 3-D, where engines and policies agree least:</p><ul class="replays">)";
  for (const ReportReplay& replay : replays)
    html += fmt::format(R"(<li><a href="{}#e={}">{}</a> <span class="ci">{} of {} succeed</span></li>)",
                        escape_html(replay.file), escape_html(replay.scene), escape_html(replay.name), replay.successes,
                        replay.judged);
  return html + "</ul>";
}

bool failed(const EpisodeRow& row) { return !headline_success(row) && row.arm == "main"; }

std::string policy_of(const EpisodeRow& row) {
  return row.arm == "main" ? row.policy : row.arm == "null" ? "null arm" : fmt::format("{} ({})", row.policy, row.arm);
}

std::string verdict_of(const EpisodeRow& row) {
  if (headline_success(row)) return "success";
  return row.outcome == Outcome::kOk ? "failure" : std::string(to_string(row.outcome));
}

std::set<std::string_view> watched_keys(const std::vector<ReportReplay>& replays) {
  std::set<std::string_view> keys;
  for (const ReportReplay& replay : replays) keys.insert(replay.keys.begin(), replay.keys.end());
  return keys;
}

// Failures first, and of those the ones that can be watched.
std::string episodes_section(const ReportContent& content) {
  if (content.episodes.empty()) return "";
  const std::set<std::string_view> watched = watched_keys(content.replays);
  std::vector<const EpisodeRow*> order;
  for (const EpisodeRow& row : content.episodes) order.push_back(&row);
  std::ranges::stable_sort(order, {}, [&](const EpisodeRow* row) {
    return std::tie(row->task, row->clip, row->episode, row->perturbation, row->arm, row->policy, row->controller,
                    row->engine);
  });
  std::ranges::stable_sort(
      order, {}, [&](const EpisodeRow* row) { return std::pair(!failed(*row), !watched.contains(row->key)); });
  TitledTable titled{.caption =
                         "Failures first. A key leads to the episode's replay, where there is one; duet replay RUN "
                         "--episodes KEY makes one of any."};
  titled.table = {.header = {"Task", "Clip", "Policy", "Controller", "Engine", "Perturbation", "Verdict", "Key"},
                  .label_columns = 2};
  for (const EpisodeRow* row : order)
    titled.table.rows.push_back(
        {row->task, row->episode == 0 ? row->clip : fmt::format("{} {}", row->clip, row->episode), policy_of(*row),
         row->controller, row->engine, row->perturbation, verdict_of(*row), row->key.substr(0, kShownKey)});
  if (content.all_episodes > order.size())
    titled.notes = {
        fmt::format("{} of {} episodes: those with a replay, then failures. duet report RUN --format sqlite "
                    "has them all.",
                    order.size(), content.all_episodes)};
  return titled_table_html(titled);
}

// A line per metric, in the order of the catalogue, and a column per set of values.
TitledTable metric_table(const std::vector<std::pair<std::string, std::map<std::string, double>>>& sets,
                         const std::vector<MetricColumn>& columns) {
  TitledTable titled{.table = {.header = {"Metric"}}};
  std::vector<std::string> names = names_of(columns);
  for (const auto& [head, values] : sets) {
    titled.table.header.push_back(head);
    for (const auto& [name, value] : values)
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
  for (const std::string& name : names) {
    std::vector<std::string> cells = {name};
    for (const auto& [head, values] : sets) cells.push_back(values.contains(name) ? significant(values.at(name)) : "-");
    const bool known = std::ranges::any_of(sets, [&](const auto& set) { return set.second.contains(name); });
    if (known) titled.table.rows.push_back(std::move(cells));
  }
  return titled;
}

std::string retargeting_section(const ReportContent& content) {
  if (content.retargeting.empty()) return "";
  std::vector<std::pair<std::string, std::map<std::string, double>>> sets;
  std::vector<std::pair<int, std::string>> tasks;
  tasks.reserve(content.retargeting.size());
  for (const auto& [task, values] : content.retargeting) tasks.emplace_back(task_rank(task), task);
  std::ranges::sort(tasks);
  sets.reserve(tasks.size());
  for (const auto& [rank, task] : tasks)
    sets.emplace_back(task == "all" ? "All tasks" : task_title(task), content.retargeting.at(task));
  TitledTable titled = metric_table(sets, content.columns);
  titled.caption = "Mean over the clips of a task";
  return titled_table_html(titled);
}

LinePlot loss_plot(const std::map<std::string, std::vector<double>>& terms) {
  LinePlot plot{.title = "Loss terms", .x_label = "iteration", .y_label = "loss", .series = {}, .loss = true};
  for (const auto& [name, values] : terms) {
    LineSeries& series = plot.series.emplace_back(LineSeries{.name = name, .x = {}, .y = values});
    for (std::size_t i = 0; i < values.size(); ++i) series.x.push_back(static_cast<double>(i));
  }
  return plot;
}

std::string clips_section(const ReportContent& content, nlohmann::json& drawn) {
  if (content.stories.empty()) return "";
  std::string html =
      "<p>Seen at right angles to the line between the two agents; limbs on the far side are paler. Ground ticks are "
      "0.5 m apart.</p>";
  for (const ClipStory& story : content.stories) {
    const TitledTable metrics = metric_table({{"Value", story.metrics}}, content.columns);
    html += fmt::format(
        "<article class=\"clip\" data-task=\"{}\"><h3>{} <span class=\"tag\">{}</span></h3>{}"
        "<div class=\"details\">{}{}</div></article>\n",
        escape_html(story.task), escape_html(story.title), escape_html(task_title(story.task)),
        key_frames_svg(story.frames), plots_html({loss_plot(story.loss)}, drawn),
        metrics.table.rows.empty() ? "" : titled_table_html(metrics));
  }
  return html;
}

std::string training_section(const ReportContent& content, nlohmann::json& drawn) {
  std::string html;
  for (const TrainingCurves& curves : content.curves)
    html += fmt::format("<h3>{}</h3>", escape_html(curves.title)) + plots_html(curve_plots(curves), drawn);
  return html;
}

std::string environment_section(const ReportContent& content) {
  if (content.environment.is_null() || content.environment.empty()) return "";
  return fmt::format("<details><summary>What these results depend on</summary><pre>{}</pre></details>",
                     escape_html(dumped(content.environment, 2)));
}

std::vector<Section> sections_of(const ReportContent& content, nlohmann::json& drawn) {
  std::vector<Section> sections;
  const auto add = [&](const std::string& id, const std::string& title, std::string body, bool open = false) {
    if (!body.empty()) sections.push_back({id, title, std::move(body), open});
  };
  const auto add_analyses = [&](bool opens) {
    for (const Analysis& analysis : content.analyses)
      if (analysis.opens == opens && analysis.name != kLeaderboardName && analysis.name != kRankingName)
        add(analysis.name, analysis.title, analysis_html(analysis, drawn), opens);
  };
  const Analysis* board = analysis_of(content, kRankingName);
  if (board != nullptr && !board->tables.empty())
    add(kRankingName, "Board", titled_table_html(board->tables.front()), true);
  add_analyses(true);
  add("replays", "Replays", replays_section(content.replays), true);
  add("episodes", "Episodes", episodes_section(content));
  add_analyses(false);
  if (const Analysis* entries = analysis_of(content, kLeaderboardName))
    add(kLeaderboardName, entries->title, analysis_html(*entries, drawn), board == nullptr);
  add("retargeting", "Retargeting", retargeting_section(content));
  add("clips", "Clips", clips_section(content, drawn));
  add("training", "Training", training_section(content, drawn));
  add("environment", "Environment", environment_section(content));
  return sections;
}

std::string body_html(const std::vector<Section>& sections) {
  std::string items, html;
  for (const Section& section : sections) {
    const std::string title = escape_html(section.title);
    items += fmt::format(R"(<li><a href="#{}">{}</a></li>)", section.id, title);
    html += fmt::format(
        "<section id=\"{0}\" aria-labelledby=\"{0}-title\"><details class=\"fold\"{1}><summary><h2 "
        "id=\"{0}-title\">{2}</h2></summary>\n{3}</details></section>\n",
        section.id, section.open ? " open" : "", title, section.body);
  }
  return fmt::format(
      "<nav aria-label=\"Sections\"><ul>{}</ul></nav>\n<main>\n<noscript><p>Plots are drawn by JavaScript, which is "
      "off.</p></noscript>\n{}</main>\n",
      items, html);
}

// The analysis as its JSON file, with the figures that drawings are made of.
nlohmann::json drawn_figures(const Analysis& analysis) {
  Analysis some = analysis;
  std::erase_if(some.estimates, [](const Estimate& figure) {
    return !figure.of.empty() ||
           (figure.name != "mean_success" && figure.name != "success" && figure.name != "null_success");
  });
  return analysis_json(some);
}

// Text within a script element: no '<' of it begins a tag.
std::string page_data(const ReportContent& content, nlohmann::json drawn) {
  nlohmann::json json = {{"schema", "duet.report/1"}, {"plots", std::move(drawn)}};
  std::set<std::pair<int, std::string>> tasks;
  for (const std::string_view name : {std::string_view(kRankingName), std::string_view(kLeaderboardName)})
    if (const Analysis* analysis = analysis_of(content, name)) {
      json[std::string(name)] = drawn_figures(*analysis);
      for (const Estimate& figure : analysis->estimates) tasks.emplace(task_rank(figure.task), figure.task);
    }
  for (const ClipStory& story : content.stories) tasks.emplace(task_rank(story.task), story.task);
  json["tasks"] = nlohmann::json::array();
  for (const auto& [rank, task] : tasks)
    if (!task.empty()) json["tasks"].push_back({{"name", task}, {"title", task_title(task)}});
  for (const MetricColumn& column : content.columns)
    json["metrics"][column.name] = {{"title", column.title}, {"unit", column.unit}, {"direction", column.direction}};
  for (const ReportReplay& replay : content.replays)
    for (const std::string& key : replay.keys) json["replays"][key.substr(0, kShownKey)] = replay.file;
  std::string text;
  for (const char c : dumped(json)) text += c == '<' ? std::string("\\u003c") : std::string{c};
  return text;
}

}  // namespace

std::vector<EpisodeRow> listed_episodes(const std::vector<EpisodeRow>& rows, const std::vector<ReportReplay>& replays,
                                        std::size_t most) {
  if (rows.size() <= most) return rows;
  const std::set<std::string_view> watched = watched_keys(replays);
  std::vector<EpisodeRow> listed;
  for (const int rank : {0, 1, 2})
    for (const EpisodeRow& row : rows) {
      if (listed.size() == most) return listed;
      if (rank == (watched.contains(row.key) ? 0 : failed(row) ? 1 : 2)) listed.push_back(row);
    }
  return listed;
}

std::string html_report(const ReportContent& content, const ViewerBundle& viewer) {
  nlohmann::json drawn = nlohmann::json::array();
  const std::string sections = body_html(sections_of(content, drawn));
  return html_page(content.title, header_html(content) + sections,
                   {"duet-report", "application/json", page_data(content, std::move(drawn))}, viewer);
}

}  // namespace duet
