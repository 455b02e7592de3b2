// The clips' part of the HTML report: key frames as stick figures, loss curves, figures.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "duet/experiment/suite/suite.h"
#include "duet/report/page/html_report.h"
#include "duet/report/page/run_analyses.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/scoring/motion_scores.h"

namespace duet {

class Progress;

// People as in the clip, the adapted partner and the robot at the start, in mid-act and at the end.
ClipStory clip_story(const PairedMotion& motion, const ClipScore& score, const RobotModel& robot);

// Which of a run's policies are references: what its suite says that they use, and, for those of other runs that were
// united with it, the digest of what made their rows.
PolicyRoles roles_of(const RunInfo& info);
// How its tables call the suite, with a warning where it only bears the name of one that ships.
RankingSuite board_suite(const RunInfo& info);

// The tables for the analyses of a run; the metrics are the catalogue's, and the 18 of retargeting those that drift.
// The rows are the run's, which may be lean.
RunTables tables_of(std::vector<EpisodeRow> rows, const Run& run);

inline constexpr std::size_t kMostStories = 1000;  // clips that are drawn: some 20 kB each

// Throws InputError for a file that is broken.
std::vector<TrainingCurves> training_curves(const std::vector<std::string>& files);

// Everything that the report says of runs: their analyses, notes, retargeting figures and stories of their clips, which
// are made again from the first run's suite (`with_clips`), on `threads` threads. The rows of `run` are not looked at.
ReportContent report_content(const Run& run, const RunTables& tables, std::vector<Analysis> analyses,
                             std::vector<ReportReplay> replays, bool with_clips,
                             const std::vector<std::string>& curve_files, int threads, Progress& progress);

}  // namespace duet
