// The self-contained HTML report: opens from disk, no network; interval bars, loss curves, key frames as stick figures.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "results/contact_table.h"
#include "results/controller_table.h"
#include "results/cross_engine.h"
#include "results/leaderboard.h"
#include "results/line_plot.h"
#include "results/metric_column.h"
#include "results/policy_report.h"
#include "results/training_curves.h"

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
struct ReportContent {
  std::string title;
  nlohmann::json environment;
  std::vector<std::string> notes;  // options and caveats printed with the tables
  std::vector<LeaderboardEntry> entries;
  std::vector<MetricColumn> columns;                                 // how to head metric columns
  std::map<std::string, std::map<std::string, double>> retargeting;  // task -> metric -> mean ("all" included)
  std::vector<ClipStory> stories;
  std::optional<CrossEngine> cross_engine;  // section "Across engines"
  ContactTable contacts;                    // section "Contact with people", where it has groups
  ControllerTable controllers;              // section "Controllers", where it has entries
  std::vector<LinePlot> foot_plots;         // in that section
  PolicyReport policies;                    // sections "Policies", "Perturbations", "Reactivity"
  std::vector<TrainingCurves> curves;       // section "Training"
  nlohmann::json certificate;               // parity certificate, shown in that section; null where none is attached
};

// Heights of both soles over time in one episode of each controller that has one: of its first by task, clip and
// number, one that ended well and was clean before others.
std::vector<LinePlot> foot_plots(const std::vector<EpisodeRow>& rows);

std::string html_report(const ReportContent& content);

}  // namespace duet
