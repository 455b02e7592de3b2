// The pieces of the HTML report, each a fragment of HTML or SVG: internal to html_report.cpp and its tests.
#pragma once

#include <string>
#include <string_view>

#include "duet/report/page/report_content.h"
#include "duet/report/tables/escape_html.h"

namespace duet {

// Style sheet and script of the report.
std::string_view report_style();
std::string_view report_script();

// The first screen; "" for a board without rows.
std::string verdict_html(const Board& board);
std::string board_html(const Board& board);
// Success by task (columns) and combination, in the board's order.
std::string task_map_html(const Board& board, const std::vector<LeaderboardEntry>& entries);

// "" where there are none.
std::string replays_html(const std::vector<ReportReplay>& replays);
std::string policy_of_episode(const std::string& arm, const std::string& policy);  // as the list calls it
// `all`: how many there are where `rows` are some of them.
std::string episodes_html(const std::vector<EpisodeRow>& rows, const std::vector<ReportReplay>& replays,
                          std::size_t all = 0);

// A table cell's drawing: the interval as a bar on [0, 1], the rate as a dot, the null arm (NaN: none) as a tick.
std::string interval_bar_svg(double rate, const Interval& interval, double null_rate, int width_px);

// The key frames of a clip side by side, seen at right angles to the line between the two agents; "" where there are
// no points. Points that are not finite are left out, with their bones.
std::string key_frames_svg(const std::vector<KeyFrame>& frames);

// Loss terms over iterations, on a logarithmic axis where the positive values span more than a factor 20; "" where
// there are none.
std::string loss_plot_svg(const std::map<std::string, std::vector<double>>& loss);

// Notes, plots, tables with headings of level 3. A cell that ends with an asterisk is over a limit and stands out.
std::string analysis_html(const Analysis& analysis);

// The drawing of engine_plot_svg within the report, styled by it.
std::string engine_plot_html(const CrossEngine& result);
// Plots side by side, each under its title; those without a point are left out.
std::string plots_html(const std::vector<LinePlot>& plots);

std::string leaderboard_html(const std::vector<LeaderboardEntry>& entries);
std::string detector_table_html(const std::vector<LeaderboardEntry>& entries);  // "" without other verdicts
std::string episode_metrics_html(const ReportContent& content);                 // "" without metrics
std::string retargeting_html(const ReportContent& content);                     // "" without metrics
std::string story_html(const ClipStory& story, const std::vector<MetricColumn>& columns);

}  // namespace duet
