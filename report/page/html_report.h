// The HTML report: opens from disk, no network. All its tables stand in it as tables, for readers without a script,
// too; viewer/src/report.ts makes them sortable and searchable and draws plots from the data of the page: schema
// `duet.report/1`, with figures as `duet report -f json` writes them (docs/file-formats.md, "Report page").
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "duet/report/page/html_page.h"
#include "duet/report/page/key_frames.h"
#include "duet/report/page/training_curves.h"
#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"

namespace duet {

// The content of a report.

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
  std::vector<EpisodeRow> episodes;   // section "Episodes": of many those of listed_episodes
  std::size_t all_episodes = 0;       // of which `episodes` are some; 0: they are all
  std::vector<ReportReplay> replays;  // in that section
  nlohmann::json environment;
  std::vector<std::string> notes;     // options and caveats printed with the tables
  std::vector<Analysis> analyses;     // a section each; the board first, with its sentences in the header
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

// `viewer`: load_viewer("report"), or an empty one for plain tables.
std::string html_report(const ReportContent& content, const ViewerBundle& viewer);

}  // namespace duet
