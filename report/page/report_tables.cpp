// The tables of the HTML report.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "duet/report/page/report_parts.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/report/tables/escape_html.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

std::string heading(const std::string& title, const char* classes) {
  return fmt::format(R"(<th scope="col"{}><button type="button">{}</button></th>)", classes, escape_html(title));
}

std::string sortable_heading(const std::string& title) { return heading(title, ""); }

// The last label is the policy, which heads the row. On a narrow screen the others give up their columns and stand
// below it (report_style), so that the success is in sight.
std::string label_headings(const std::vector<std::string>& titles) {
  std::string html;
  for (std::size_t i = 0; i < titles.size(); ++i)
    html += heading(titles[i], i + 1 == titles.size() ? R"( class="l")" : R"( class="l context")");
  return html;
}

std::string label_cells(const std::vector<std::string>& cells) {
  std::string html, where;
  for (std::size_t i = 0; i + 1 < cells.size(); ++i) {
    const std::string text = escape_html(cells[i]);
    html += fmt::format(R"(<td class="l context">{}</td>)", text);
    where.append(where.empty() ? "" : ", ").append(text);
  }
  if (!where.empty()) where = fmt::format(R"(<span class="where">{}</span>)", where);
  return html + fmt::format(R"(<th scope="row" class="l">{}{}</th>)", escape_html(cells.back()), where);
}

std::string success_cell(const LeaderboardEntry* entry, int width_px) {
  if (entry == nullptr) return R"(<td class="zero" data-v="">-</td>)";
  const std::string tip =
      fmt::format("{} of {} episodes; null arm {} %", entry->k, entry->n, percent(entry->null_success));
  return fmt::format(
      R"(<td data-v="{:.6f}" title="{}"><span class="rate">{}</span><span class="ci">[{}, {}]</span>{}</td>)",
      entry->success, escape_html(tip), percent(entry->success), percent(entry->interval.low),
      percent(entry->interval.high), interval_bar_svg(entry->success, entry->interval, entry->null_success, width_px));
}

std::string lift_cell(const LeaderboardEntry* entry) {
  if (entry == nullptr || !std::isfinite(entry->lift)) return R"(<td class="zero" data-v="">-</td>)";
  const std::string text = points(entry->lift, entry->lift_interval);
  const std::size_t space = text.find(' ');
  const bool above_null = entry->lift_interval.low > 0.0;
  return fmt::format(R"(<td data-v="{:.6f}"><span class="rate{}">{}</span><span class="ci">{}</span></td>)",
                     entry->lift, above_null ? " gain" : "", text.substr(0, space), text.substr(space + 1));
}

std::string count_cell(const LeaderboardEntry* entry, long LeaderboardEntry::*field) {
  const long count = entry != nullptr ? entry->*field : 0;
  return fmt::format(R"(<td data-v="{0}"{1}>{0}</td>)", count, count == 0 ? R"( class="zero")" : "");
}

// Sorted by the number of plans.
std::string plans_cell(const LeaderboardEntry* entry) {
  if (entry == nullptr) return R"(<td class="zero" data-v="0">0</td>)";
  const long count = entry->plans_late + entry->plans_invalid + entry->policy_dead;
  return fmt::format(R"(<td data-v="{}"{}>{}</td>)", count, count == 0 ? R"( class="zero")" : "", plans_lost(*entry));
}

const MetricColumn* column_of(const std::vector<MetricColumn>& columns, const std::string& name) {
  for (const MetricColumn& column : columns) {
    if (column.name == name) return &column;
  }
  return nullptr;
}

// "Joint position error [m] ↓", the arrow telling which way is better.
std::string metric_heading(const std::vector<MetricColumn>& columns, const std::string& name) {
  const MetricColumn* column = column_of(columns, name);
  if (column == nullptr) return escape_html(name);
  const bool has_unit = !column->unit.empty() && column->unit != "1";
  const char* arrow = column->direction == "lower"    ? R"( <span class="unit" title="lower is better">&#8595;</span>)"
                      : column->direction == "higher" ? R"( <span class="unit" title="higher is better">&#8593;</span>)"
                                                      : "";
  return fmt::format(
      R"(<span title="{}">{}</span>{}{})", escape_html(name), escape_html(column->title.empty() ? name : column->title),
      has_unit ? fmt::format(R"( <span class="unit">[{}]</span>)", escape_html(column->unit)) : "", arrow);
}

// Metrics in the order of the columns given, others after them.
std::vector<std::string> ordered(const std::set<std::string>& names, const std::vector<MetricColumn>& columns) {
  std::vector<std::string> list;
  for (const MetricColumn& column : columns) {
    if (names.contains(column.name)) list.push_back(column.name);
  }
  for (const std::string& name : names) {
    if (column_of(columns, name) == nullptr) list.push_back(name);
  }
  return list;
}

using Values = std::map<std::string, double>;

std::string value_cell(const Values* values, const std::string& name) {
  const bool known = values != nullptr && values->contains(name);
  if (!known) return R"(<td class="zero">-</td>)";
  return fmt::format("<td>{}</td>", significant(values->at(name)));
}

// One line per metric, one column per set of values.
std::string metric_table(const std::string& caption, const std::vector<std::string>& heads,
                         const std::vector<const Values*>& sets, const std::vector<MetricColumn>& columns) {
  std::set<std::string> names;
  for (const Values* values : sets) {
    for (const auto& [name, value] : *values) names.insert(name);
  }
  if (names.empty()) return "";
  std::string html = fmt::format(
      R"(<div class="scroll" tabindex="0"><table class="compact">{}<thead><tr><th scope="col" class="l">Metric</th>)",
      caption.empty() ? "" : fmt::format("<caption>{}</caption>", escape_html(caption)));
  for (const std::string& head : heads) html += fmt::format(R"(<th scope="col">{}</th>)", escape_html(head));
  html += "</tr></thead><tbody>";
  for (const std::string& name : ordered(names, columns)) {
    html += fmt::format(R"(<tr><th scope="row">{}</th>)", metric_heading(columns, name));
    for (const Values* values : sets) html += value_cell(values, name);
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>";
}

std::string joined_labels(const std::vector<std::string>& cells) {
  std::string text;
  for (const std::string& cell : cells) text.append(text.empty() ? "" : " / ").append(cell);
  return text;
}

std::string bar_legend(double level) {
  return fmt::format(
      R"(<p class="legend"><span><svg class="bar" width="56" height="16" aria-hidden="true"><line class="range" x1="10" x2="46" y1="8" y2="8"/><circle class="dot" cx="30" cy="8" r="4"/></svg>success with its {:g} % interval on 0 to 100 %</span><span><svg class="bar" width="10" height="16" aria-hidden="true"><line class="null" x1="5" x2="5" y1="1" y2="15"/></svg>the same episodes under the null arm</span><span>Fell, diverged, timed out, ended in an error: episodes</span></p>)",
      100.0 * level);
}

}  // namespace

std::string interval_bar_svg(double rate, const Interval& interval, double null_rate, int width_px) {
  constexpr double kInset = 5.0;
  const auto x = [&](double fraction) { return kInset + fraction * (width_px - 2.0 * kInset); };
  std::string svg =
      fmt::format(R"(<svg class="bar" width="{0}" height="16" viewBox="0 0 {0} 16" aria-hidden="true">)", width_px);
  svg += fmt::format(R"(<line class="track" x1="{:.0f}" x2="{:.0f}" y1="8" y2="8"/>)", x(0.0), x(1.0));
  svg +=
      fmt::format(R"(<line class="range" x1="{:.1f}" x2="{:.1f}" y1="8" y2="8"/>)", x(interval.low), x(interval.high));
  if (std::isfinite(null_rate)) {
    svg += fmt::format(R"(<line class="null" x1="{0:.1f}" x2="{0:.1f}" y1="1" y2="15"/>)", x(null_rate));
  }
  return svg + fmt::format(R"(<circle class="dot" cx="{:.1f}" cy="8" r="4"/></svg>)", x(rate));
}

std::string leaderboard_html(const std::vector<LeaderboardEntry>& entries) {
  const std::vector<LeaderboardRow> rows = leaderboard_rows(entries);
  if (rows.empty()) return "<p>No episodes.</p>";
  const RowLabels labels = row_labels(rows);
  const std::vector<std::string> tasks = leaderboard_tasks(entries);
  std::string html =
      fmt::format(R"(<div class="scroll" tabindex="0"><table class="sortable board"><caption>{}</caption><thead><tr>)",
                  escape_html(labels.caption));
  html += label_headings(labels.columns);
  for (const char* title : {"n", "Overall", "Lift"}) html += sortable_heading(title);
  for (const std::string& task : tasks) html += sortable_heading(task_title(task));
  for (const char* title : {"Fell", "Div.", "Time", "Err."}) html += sortable_heading(title);
  const bool with_plans = loses_plans(entries);
  if (with_plans) html += sortable_heading(kPlansLost);
  html += "</tr></thead><tbody>\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const LeaderboardEntry* overall = rows[i].find("all");
    html += fmt::format("<tr{}>", rows[i].arm == "main" ? "" : R"( class="control")") + label_cells(labels.cells[i]);
    html += count_cell(overall, &LeaderboardEntry::n) + success_cell(overall, 116) + lift_cell(overall);
    for (const std::string& task : tasks) html += success_cell(rows[i].find(task), 72);
    for (const auto field : {&LeaderboardEntry::fell, &LeaderboardEntry::diverged, &LeaderboardEntry::timed_out,
                             &LeaderboardEntry::errors}) {
      html += count_cell(overall, field);
    }
    if (with_plans) html += plans_cell(overall);
    html += "</tr>\n";
  }
  html += "</tbody></table></div>" + bar_legend(entries.front().level);
  for (const std::string& note : leaderboard_notes(entries)) html += fmt::format("<p>{}</p>", escape_html(note));
  return html;
}

std::string detector_table_html(const std::vector<LeaderboardEntry>& entries) {
  const std::vector<std::string> names = other_verdicts(entries);
  if (names.empty()) return "";
  const std::vector<LeaderboardRow> rows = leaderboard_rows(entries);
  const RowLabels labels = row_labels(rows);
  std::string html =
      R"(<div class="scroll" tabindex="0"><table class="sortable compact"><caption>Success in % under each detector version / threshold set, all tasks</caption><thead><tr>)";
  html += label_headings(labels.columns);
  for (const std::string& name : names) html += sortable_heading(name);
  html += "</tr></thead><tbody>\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    html += fmt::format("<tr{}>", rows[i].arm == "main" ? "" : R"( class="control")") + label_cells(labels.cells[i]);
    const LeaderboardEntry* overall = rows[i].find("all");
    for (const std::string& name : names) {
      const bool known = overall != nullptr && overall->other_success.contains(name);
      html += known ? fmt::format(R"(<td data-v="{:.6f}">{}</td>)", overall->other_success.at(name),
                                  percent(overall->other_success.at(name)))
                    : R"(<td class="zero" data-v="">-</td>)";
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>";
}

std::string episode_metrics_html(const ReportContent& content) {
  const std::vector<std::vector<LeaderboardRow>> engines = rows_by_engine(leaderboard_rows(content.entries));
  std::string html;
  for (const std::vector<LeaderboardRow>& rows : engines) {
    const RowLabels labels = row_labels(rows);
    std::vector<std::string> heads;
    std::vector<const Values*> sets;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const LeaderboardEntry* overall = rows[i].find("all");
      if (overall == nullptr) continue;
      heads.push_back(joined_labels(labels.cells[i]));
      sets.push_back(&overall->metrics);
    }
    const std::string table =
        metric_table("Mean over the episodes that have the metric, all tasks", heads, sets, content.columns);
    if (table.empty()) continue;
    html += engines.size() == 1 ? table
                                : fmt::format("<details><summary>Engine {}</summary>{}</details>\n",
                                              escape_html(rows.front().engine), table);
  }
  return html;
}

std::string retargeting_html(const ReportContent& content) {
  std::vector<std::pair<int, std::string>> tasks;
  for (const auto& [task, values] : content.retargeting) tasks.emplace_back(task_rank(task), task);
  std::sort(tasks.begin(), tasks.end());
  std::vector<std::string> heads;
  std::vector<const Values*> sets;
  for (const auto& [rank, task] : tasks) {
    heads.push_back(task == "all" ? "All tasks" : task_title(task));
    sets.push_back(&content.retargeting.at(task));
  }
  return metric_table("Mean over the clips of a task; an arrow shows which way is better", heads, sets,
                      content.columns);
}

std::string story_html(const ClipStory& story, const std::vector<MetricColumn>& columns) {
  std::string html =
      fmt::format(R"(<article class="clip" data-task="{}"><h3>{}<span class="tag">{}</span></h3>)",
                  escape_html(story.task), escape_html(story.title), escape_html(task_title(story.task)));
  html += key_frames_svg(story.frames);
  const std::string plot = loss_plot_svg(story.loss);
  const std::string metrics = metric_table("", {"Value"}, {&story.metrics}, columns);
  if (!plot.empty() || !metrics.empty()) {
    html += fmt::format(R"(<div class="details"><div>{}</div><div>{}</div></div>)", plot, metrics);
  }
  return html + "</article>\n";
}

}  // namespace duet
