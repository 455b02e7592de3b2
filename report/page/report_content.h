// The content of a report.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "duet/report/page/training_curves.h"
#include "duet/report/ranking/board.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/report/tables/analysis.h"
#include "duet/report/tables/metric_column.h"

namespace duet {

struct StickFigure {
  std::string label;                       // "human", "robot", "source"
  std::vector<Eigen::Vector3d> points;     // [m], frame W
  std::vector<std::pair<int, int>> bones;  // indices in points
};
struct KeyFrame {
  std::string label;  // "start", "act", "end", with its time
  std::vector<StickFigure> figures;
};
struct ClipStory {  // one retargeted clip or rolled-out episode
  std::string title, task;
  std::vector<KeyFrame> frames;
  std::map<std::string, std::vector<double>> loss;  // term -> value per iteration
  std::map<std::string, double> metrics;            // catalogue names
};
// A clip that a replay page shows.
struct ReportReplay {
  std::string file, scene, name;  // address of the page as seen from the report, "hug/hug_000/0/clean", "Hug, hug_000"
  int successes = 0, judged = 0;  // of the main arm
  std::vector<std::string> keys;  // of its episodes
};
struct ReportContent {
  std::string title;
  Board board;                        // the first screen
  std::vector<EpisodeRow> episodes;   // section "Episodes": of many those of listed_episodes
  std::size_t all_episodes = 0;       // of which `episodes` are some; 0: they are all
  std::vector<ReportReplay> replays;  // in that section
  nlohmann::json environment;
  std::vector<std::string> notes;  // options and caveats printed with the tables
  std::vector<LeaderboardEntry> entries;
  std::vector<Analysis> analyses;     // a section each, but for the leaderboard, whose table of entries can be sorted
  std::vector<MetricColumn> columns;  // how to head metric columns
  std::map<std::string, std::map<std::string, double>> retargeting;  // task -> metric -> mean ("all" included)
  std::vector<ClipStory> stories;
  std::vector<TrainingCurves> curves;  // section "Training"
};

// The most episodes that a page lists: its size is bounded whatever the run has.
inline constexpr std::size_t kMostListedEpisodes = 10'000;  // some 250 bytes each
// All episodes, or as many: those first that can be watched, failures before others, each in the order of the rows.
std::vector<EpisodeRow> listed_episodes(const std::vector<EpisodeRow>& rows, const std::vector<ReportReplay>& replays,
                                        std::size_t most = kMostListedEpisodes);

}  // namespace duet
