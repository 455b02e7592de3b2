// The first screen of the HTML report: the verdict, the ranked board, and what each combination reaches in each task.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/report/page/report_parts.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "duet/report/tables/escape_html.h"

namespace duet {
namespace {

constexpr double kAxisWidth = 300.0, kAxisInset = 8.0, kLane = 7.0;  // [px]

double axis_x(double rate) { return kAxisInset + rate * (kAxisWidth - 2.0 * kAxisInset); }

double axis_height(const BoardRow& row) {
  return kLane * static_cast<double>(std::max<std::size_t>(row.rates.size(), 2)) + 8.0;
}

// A lane for each engine, so that dots at one place are told apart; the mean through them on the shade of its interval.
std::string axis_svg(const BoardRow& row, const std::vector<std::string>& engines) {
  const double height = axis_height(row);
  std::string svg = fmt::format(
      R"(<svg class="axis" viewBox="0 0 {0:.0f} {1:.0f}" width="{0:.0f}" height="{1:.0f}" role="img" aria-label="{2}">)",
      kAxisWidth, height, escape_html(fmt::format("{}: mean {} %", row.name(), percent(row.mean, row.interval))));
  for (const double tick : {0.0, 0.25, 0.5, 0.75, 1.0})
    svg += fmt::format(R"(<line class="g" x1="{0:.1f}" x2="{0:.1f}" y1="0" y2="{1:.0f}"/>)", axis_x(tick), height);
  svg += fmt::format(R"(<rect class="b" x="{:.1f}" y="0" width="{:.1f}" height="{:.0f}"/>)", axis_x(row.interval.low),
                     std::max(1.0, axis_x(row.interval.high) - axis_x(row.interval.low)), height);
  svg += fmt::format(R"(<line class="m" x1="{0:.1f}" x2="{0:.1f}" y1="0" y2="{1:.0f}"/>)", axis_x(row.mean), height);
  if (std::isfinite(row.null_rate))
    svg += fmt::format(
        R"(<line class="null" x1="{0:.1f}" x2="{0:.1f}" y1="0" y2="{1:.0f}"><title>null arm {2} %</title></line>)",
        axis_x(row.null_rate), height, percent(row.null_rate));
  for (std::size_t i = 0; i < row.rates.size(); ++i) {
    const EngineRate& rate = row.rates[i];
    const auto place = std::ranges::find(engines, rate.engine) - engines.begin();
    svg +=
        fmt::format(R"(<circle class="e{}" cx="{:.1f}" cy="{:.1f}" r="3.4"><title>{} {} %, {} of {}</title></circle>)",
                    place % 8 + 1, axis_x(rate.rate), 7.0 + kLane * static_cast<double>(i), escape_html(rate.engine),
                    percent(rate.rate, rate.interval), rate.k, rate.n);
  }
  return svg + "</svg>";
}

// The ranked ones, then the references.
std::vector<const BoardRow*> shown_rows(const Board& board) {
  std::vector<const BoardRow*> rows;
  for (const std::vector<BoardRow>* of : {&board.rows, &board.references})
    for (const BoardRow& row : *of) rows.push_back(&row);
  return rows;
}

std::vector<std::string> engines_of(const Board& board) {
  std::vector<std::string> engines;
  for (const BoardRow* row : shown_rows(board))
    for (const EngineRate& rate : row->rates)
      if (std::ranges::find(engines, rate.engine) == engines.end()) engines.push_back(rate.engine);
  std::ranges::sort(engines);
  return engines;
}

std::string episodes_link(const BoardRow& row, const std::string& task, const std::string& text) {
  return fmt::format(
      R"(<a href="#episodes" data-controller="{}" data-policy="{}" data-perturbation="{}" data-task="{}">{}</a>)",
      escape_html(row.controller), escape_html(policy_of_episode(row.arm, row.policy)), escape_html(row.perturbation),
      escape_html(task), text);
}

std::string contact_cell(const BoardRow& row) {
  if (!row.contact) return R"(<td class="zero" data-v="">-</td>)";
  const double ratio = row.contact->worst_ratio;
  const std::string worst =
      std::isfinite(ratio) ? fmt::format(R"(<span class="ci">at most {:.2f} of a limit</span>)", ratio) : "";
  return fmt::format(R"(<td data-v="{0}"{1}>{0} of {2}{3}</td>)", row.contact->over,
                     row.contact->over > 0 ? R"( class="over")" : "", row.contact->touched, worst);
}

// "replay (knows the motion)", "dstar, push_60n"
std::string policy_html(const BoardRow& row) {
  return escape_html(row.policy + (row.perturbation == "clean" ? "" : ", " + row.perturbation) +
                     (row.role.word.empty() ? "" : fmt::format(" ({})", row.role.word)));
}

// A reference has no rank and sorts below all that have one.
std::string board_row_html(const BoardRow& row, const std::vector<std::string>& engines, bool with_contact) {
  std::string html = fmt::format(
      R"(<tr{}><td class="l rank" data-v="{}">{}</td><th scope="row" class="l">{}<span class="ci">{}</span></th>)",
      row.rank == 0 ? R"( class="control")" : "", row.rank == 0 ? "" : std::to_string(row.rank),
      row.rank == 0 ? "–" : std::to_string(row.rank), policy_html(row), escape_html(row.controller));
  html += fmt::format(
      R"(<td data-v="{:.6f}"><span class="rate big">{}</span><span class="ci">[{}, {}]</span></td><td class="l plotcell">{}</td>)",
      row.mean, percent(row.mean), percent(row.interval.low), percent(row.interval.high), axis_svg(row, engines));
  html += std::isfinite(row.null_rate)
              ? fmt::format(R"(<td data-v="{:.6f}">{}</td>)", row.null_rate, percent(row.null_rate))
              : R"(<td class="zero" data-v="">-</td>)";
  for (const long count : {row.fell, row.unfinished})
    html += fmt::format(R"(<td data-v="{0}"{1}>{0}</td>)", count, count == 0 ? R"( class="zero")" : "");
  if (with_contact) html += contact_cell(row);
  return html +
         fmt::format("<td>{}</td></tr>\n", episodes_link(row, "", fmt::format("{} × {}", row.n, row.rates.size())));
}

std::string axis_legend(const std::vector<std::string>& engines, double level) {
  std::string html = R"(<p class="legend">)";
  for (std::size_t i = 0; i < engines.size(); ++i)
    html += fmt::format(
        R"(<span><svg width="10" height="10" aria-hidden="true"><circle class="e{}" cx="5" cy="5" r="4"/></svg>{}</span>)",
        i % 8 + 1, escape_html(engines[i]));
  return html +
         fmt::format(
             R"(<span><svg width="22" height="12" aria-hidden="true"><rect class="b" width="22" height="12"/><line class="m" x1="11" x2="11" y1="0" y2="12"/></svg>mean over engines with its {:g} % interval</span><span><svg width="8" height="12" aria-hidden="true"><line class="null" x1="4" x2="4" y1="0" y2="12"/></svg>the null arm</span></p>)",
             100.0 * level);
}

// Mean over the row's engines of its success in a task; NaN where it was not run.
double task_rate(const std::vector<LeaderboardEntry>& entries, const BoardRow& row, const std::string& task) {
  double sum = 0.0;
  int count = 0;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != task || entry.arm != row.arm || entry.controller != row.controller ||
        entry.policy != row.policy || entry.perturbation != row.perturbation ||
        std::ranges::find(row.rates, entry.engine, &EngineRate::engine) == row.rates.end())
      continue;
    sum += entry.success;
    ++count;
  }
  return count == 0 ? std::nan("") : sum / count;
}

}  // namespace

std::string verdict_html(const Board& board) {
  const std::vector<std::string> sentences = board_verdict(board);
  if (sentences.empty()) return "";
  std::string html = fmt::format(R"(<div class="answer"><p class="first">{}</p>)", escape_html(sentences.front()));
  for (std::size_t i = 1; i < sentences.size(); ++i) html += fmt::format("<p>{}</p>", escape_html(sentences[i]));
  return html + "</div>\n";
}

std::string board_html(const Board& board) {
  const std::vector<const BoardRow*> rows = shown_rows(board);
  if (rows.empty()) return "";
  const std::vector<std::string> engines = engines_of(board);
  const bool with_contact = std::ranges::any_of(rows, [](const BoardRow* row) { return row->contact.has_value(); });
  std::string html =
      R"(<div class="scroll" tabindex="0" role="region" aria-label="Ranked board"><table class="sortable ranked"><thead><tr>)";
  std::vector<const char*> titles = {
      "#", "Policy, controller", "Success [%]", "0 to 100 %, engine by engine", "Null", "Fell", "Unfinished"};
  if (with_contact) titles.push_back("Touches over a limit");
  titles.push_back("Episodes");
  for (const char* title : titles)
    html += fmt::format(R"(<th scope="col"><button type="button">{}</button></th>)", title);
  html += "</tr></thead><tbody>\n";
  for (const BoardRow* row : rows) html += board_row_html(*row, engines, with_contact);
  return html + "</tbody></table></div>" + axis_legend(engines, board.level);
}

std::string task_map_html(const Board& board, const std::vector<LeaderboardEntry>& entries) {
  const std::vector<std::string> tasks = leaderboard_tasks(entries);
  const std::vector<const BoardRow*> rows = shown_rows(board);
  if (rows.empty() || tasks.empty()) return "";
  std::string html =
      R"(<div class="scroll" tabindex="0" role="region" aria-label="Success by task"><table class="map"><caption>Success in %, mean over engines; a number leads to its episodes</caption><thead><tr><th scope="col" class="l">Policy, controller</th>)";
  for (const std::string& task : tasks)
    html += fmt::format(R"(<th scope="col">{}</th>)", escape_html(task_title(task)));
  html += "</tr></thead><tbody>\n";
  for (const BoardRow* row : rows) {
    html += fmt::format(R"(<tr{}><th scope="row" class="l">{} <span class="unit">{}</span></th>)",
                        row->rank == 0 ? R"( class="control")" : "", policy_html(*row), escape_html(row->controller));
    for (const std::string& task : tasks) {
      const double rate = task_rate(entries, *row, task);
      html += std::isfinite(rate) ? fmt::format(R"(<td class="h{:.0f}">{}</td>)", std::floor(rate * 9.999),
                                                episodes_link(*row, task, percent(rate)))
                                  : R"(<td class="zero">-</td>)";
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>";
}

}  // namespace duet
