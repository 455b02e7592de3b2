#include "results/interval_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "results/leaderboard_rows.h"
#include "results/report_parts.h"

namespace duet {
namespace {

constexpr int kRowHeight = 26;
constexpr int kPlotWidth = 300;
constexpr int kTop = 30;

constexpr const char* kStyle = R"(<style>
text{font:13px system-ui,sans-serif;fill:#1d2024}.s{fill:#5b626b;font-size:11px}.g{stroke:#d5d8dc}
.b{stroke:#2a66a8;stroke-width:7;stroke-linecap:round;opacity:.35}.d{fill:#2a66a8}.n{stroke:#b4531b;stroke-width:2.5}
.c .b{stroke:#8a9099}.c .d{fill:#8a9099}
@media(prefers-color-scheme:dark){text{fill:#e7e8ea}.s{fill:#a6adb6}.g{stroke:#3a4048}.b{stroke:#74aef0}.d{fill:#74aef0}
.n{stroke:#f0965a}}
</style>)";

struct Line {
  std::string label;
  const LeaderboardEntry* entry;
  bool is_control;
};

std::vector<Line> lines_of(const std::vector<LeaderboardRow>& rows, const std::string& task) {
  const RowLabels labels = row_labels(rows);
  std::vector<Line> lines;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::string label;
    for (const std::string& cell : labels.cells[i]) label.append(label.empty() ? "" : " / ").append(cell);
    if (const LeaderboardEntry* entry = rows[i].find(task)) lines.push_back({label, entry, rows[i].arm != "main"});
  }
  return lines;
}

std::string axis(int left, int height) {
  std::string svg;
  for (int tick = 0; tick <= 100; tick += 25) {
    const int x = left + tick * kPlotWidth / 100;
    svg += fmt::format(R"(<line class="g" x1="{0}" x2="{0}" y1="{1}" y2="{2}"/>)", x, kTop - 6, height - 8);
    svg += fmt::format(R"(<text class="s" x="{}" y="{}" text-anchor="middle">{}{}</text>)", x, kTop - 12, tick,
                       tick == 100 ? " %" : "");
  }
  return svg;
}

std::string drawn(const Line& line, int left, int y) {
  const auto x = [&](double fraction) { return left + fraction * kPlotWidth; };
  const LeaderboardEntry& entry = *line.entry;
  std::string svg = fmt::format(R"(<g class="{}"><text x="{}" y="{}" text-anchor="end">{}</text>)",
                                line.is_control ? "c" : "m", left - 14, y + 4, escape_html(line.label));
  svg += fmt::format(R"(<line class="b" x1="{:.1f}" x2="{:.1f}" y1="{}" y2="{}"/>)", x(entry.interval.low),
                     x(entry.interval.high), y, y);
  svg += fmt::format(R"(<circle class="d" cx="{:.1f}" cy="{}" r="4.5"/>)", x(entry.success), y);
  if (std::isfinite(entry.null_success)) {
    svg += fmt::format(R"(<line class="n" x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}"/>)", x(entry.null_success), y - 8,
                       y + 8);
  }
  return svg + fmt::format(R"(<text x="{}" y="{}">{}</text></g>)", left + kPlotWidth + 16, y + 4,
                           escape_html(percent(entry.success, entry.interval)));
}

}  // namespace

std::string interval_plot_svg(const std::vector<LeaderboardEntry>& entries, const std::string& task) {
  const std::vector<LeaderboardRow> rows = leaderboard_rows(entries);
  const std::vector<Line> lines = lines_of(rows, task);
  std::size_t longest = 6;
  for (const Line& line : lines) longest = std::max(longest, line.label.size());
  // No font metrics here: 7.2 px a character is a little more than the average of common fonts at 13 px.
  const int left = 24 + static_cast<int>(7.2 * static_cast<double>(longest));
  const int height = kTop + kRowHeight * static_cast<int>(lines.size()) + 8;
  const int width = left + kPlotWidth + 140;
  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}" role="img" aria-label="{2}: success with intervals">)",
      width, height, escape_html(task_title(task)));
  svg += kStyle + axis(left, height);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    svg += drawn(lines[i], left, kTop + kRowHeight / 2 + kRowHeight * static_cast<int>(i));
  }
  return svg + "</svg>\n";
}

}  // namespace duet
