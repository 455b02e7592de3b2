#include "duet/report/studies/controller_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "duet/report/tables/cells.h"
#include "duet/rows/groups/distinct_episodes.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

struct ControllerKey {
  bool perturbed = false;  // clean first
  std::string perturbation, policy, controller, engine;
  auto operator<=>(const ControllerKey&) const = default;
};

using RowList = std::vector<const EpisodeRow*>;

// A row of Table S4 as the supplement prints it; `values` as in kControllerFigures, `before` its first three.
struct PaperController {
  std::string_view policy, controller;
  std::array<double, 7> values;
  std::array<double, 3> before;
};

// Source: supplement A.4.6, Table S4.
constexpr std::array<double, 3> kBeforeDstar = {0.162, 286.2, 115.6};
constexpr std::array<double, 3> kBeforeDiffusion = {0.165, 180.0, 119.3};
constexpr std::array<PaperController, 6> kPaperControllers = {
    {{"D-STAR", "WBC-Sim", {0.614, 2259.5, 227.6, 0.031, 13.8, 0.304, 1.558}, kBeforeDstar},
     {"D-STAR", "HOMIE", {0.297, 827.4, 171.2, 0.349, 52.6, 0.370, 0.644}, kBeforeDstar},
     {"D-STAR", "TWIST2", {0.203, 499.3, 120.0, 0.367, 48.7, 0.249, 0.436}, kBeforeDstar},
     {"DP", "WBC-Sim", {0.591, 2146.1, 201.0, 0.034, 9.9, 0.242, 1.479}, kBeforeDiffusion},
     {"DP", "HOMIE", {0.285, 833.5, 175.8, 0.391, 50.0, 0.348, 0.634}, kBeforeDiffusion},
     {"DP", "TWIST2", {0.195, 498.0, 126.2, 0.358, 47.5, 0.226, 0.446}, kBeforeDiffusion}}};

Estimate estimate(const RowList& rows, const std::string& metric, ClusterBootstrap& bootstrap, double level) {
  std::vector<double> values;
  std::vector<int> clips;
  ClipNumbers numbers;
  for (const EpisodeRow* row : rows) {
    const auto found = row->metrics.find(metric);
    if (found == row->metrics.end()) continue;
    values.push_back(found->second);
    clips.push_back(numbers.of(episode_id(*row)));
  }
  Estimate result;
  if (values.empty()) return result;
  double sum = 0.0;
  for (const double value : values) sum += value;
  result.n = static_cast<long>(values.size());
  result.mean = sum / static_cast<double>(result.n);
  if (numbers.size() >= 2) result.interval = bootstrap.mean(values, clips, level);
  return result;
}

void count(const EpisodeRow& row, ControllerEntry& entry) {
  if (row.outcome == Outcome::kUnsupported) {
    ++entry.unsupported;
    return;
  }
  ++entry.n;
  if (row.outcome == Outcome::kOk && !row.fell) ++entry.survived;
  if (row.faults.any()) ++entry.faulty;
  if (row.faults.stopped) ++entry.stopped;
}

ControllerEntry summarise(const ControllerKey& key, const RowList& rows, ClusterBootstrap& bootstrap, double level) {
  ControllerEntry entry;
  std::tie(entry.perturbation, entry.policy, entry.controller, entry.engine) =
      std::tie(key.perturbation, key.policy, key.controller, key.engine);
  for (const EpisodeRow* row : rows) count(*row, entry);
  entry.survival = wilson(entry.survived, entry.n, level);
  for (const ControllerFigure& figure : kControllerFigures) {
    for (const std::string_view metric : {figure.metric, figure.before})
      if (!metric.empty()) entry.figures.emplace(metric, estimate(rows, std::string(metric), bootstrap, level));
  }
  return entry;
}

bool has_figures(const ControllerEntry& entry) {
  return std::any_of(entry.figures.begin(), entry.figures.end(),
                     [](const auto& figure) { return figure.second.n > 0; });
}

constexpr const char* kPaperEngine = "the paper's";
constexpr std::size_t kJitterFigures = 3;  // of kControllerFigures, those that the reference has too

const Estimate& estimate_of(const ControllerEntry& entry, std::string_view metric) {
  return entry.figures.find(metric)->second;
}

double survival_of(const ControllerEntry& entry) {
  return entry.n == 0 ? std::nan("") : static_cast<double>(entry.survived) / static_cast<double>(entry.n);
}

// The columns that say of what a row is, of our rows and of the paper's.
TitledTable controller_rows(const ControllerTable& table, const char* title) {
  TitledTable titled =
      labelled_table(title, row_labels({label_column("Perturbation", table.entries, &ControllerEntry::perturbation),
                                        label_column("Policy", table.entries, &ControllerEntry::policy, true),
                                        label_column("Controller", table.entries, &ControllerEntry::controller, true),
                                        label_column("Engine", table.entries, &ControllerEntry::engine, true)}));
  for (const PaperController& paper : kPaperControllers) {
    std::vector<std::string>& cells = titled.table.rows.emplace_back(titled.table.label_columns - 3, "-");
    cells.insert(cells.end(), {std::string(paper.policy), std::string(paper.controller), kPaperEngine});
  }
  return titled;
}

// Appends a column: of our entries, then of the paper's rows.
template <typename Ours, typename Papers>
void add_controller_column(const ControllerTable& table, const std::string& header, const Ours& ours,
                           const Papers& papers, TitledTable& titled) {
  add_column(header, titled, [&](std::size_t row) {
    return row < table.entries.size() ? ours(table.entries[row])
                                      : papers(kPaperControllers[row - table.entries.size()]);
  });
}

std::string estimate_cell(const ControllerEntry& entry, std::string_view metric) {
  const Estimate& estimate = estimate_of(entry, metric);
  return short_number(estimate.mean, estimate.interval);
}

std::string controller_heading(std::string_view title, std::string_view unit) {
  return unit == "1" ? std::string(title) : fmt::format("{} [{}]", title, unit);
}

void add_episodes(const ControllerTable& table, TitledTable& titled) {
  add_controller_column(
      table, "n", [](const ControllerEntry& entry) { return count_cell(entry.n); },
      [](const PaperController&) { return std::string("-"); }, titled);
}

std::string paper_controllers_sentence() {
  return "The rows marked \"the paper's\" are Table S4 as printed, and another experiment: its policies (D-STAR, "
         "Diffusion Policy) and Inter-X recordings are not the policies and clips of this suite, its WBC-Sim was never "
         "published, and it names neither its simulator nor the units and norms of jerk and errors. What can be held "
         "against it is the order of the controllers, not the values.";
}

std::string how_sentence(const ControllerTable& table) {
  return fmt::format(
      "Means over episodes with {:g} % intervals, clips drawn again. Before: of the reference that the controller is "
      "given. An episode that ends early counts with what it has. Lower is better throughout, but for survival.",
      100.0 * table.level);
}

TitledTable jitter_table(const ControllerTable& table) {
  TitledTable titled = controller_rows(table, "Controllers: jitter before and after (Table S4)");
  add_episodes(table, titled);
  for (std::size_t i = 0; i < kJitterFigures; ++i) {
    const ControllerFigure& figure = kControllerFigures[i];
    add_controller_column(
        table, controller_heading(fmt::format("{}, before", figure.title), figure.unit),
        [&](const ControllerEntry& entry) { return estimate_cell(entry, figure.before); },
        [&](const PaperController& paper) { return short_number(paper.before[i]); }, titled);
    add_controller_column(
        table, controller_heading(figure.title, figure.unit),
        [&](const ControllerEntry& entry) { return estimate_cell(entry, figure.metric); },
        [&](const PaperController& paper) { return short_number(paper.values[i]); }, titled);
  }
  titled.notes = {how_sentence(table) + " HF ratio: share of the joint-velocity energy above 5 Hz.",
                  paper_controllers_sentence()};
  return titled;
}

std::string faults_cell(const ControllerEntry& entry) {
  if (entry.stopped == 0) return count_cell(entry.faulty);
  return fmt::format("{} ({} stopped)", entry.faulty, entry.stopped);
}

TitledTable tracking_table(const ControllerTable& table) {
  TitledTable titled = controller_rows(table, "Controllers: tracking, survival and faults (Table S4)");
  add_episodes(table, titled);
  for (std::size_t i = kJitterFigures; i < kControllerFigures.size(); ++i) {
    const ControllerFigure& figure = kControllerFigures[i];
    add_controller_column(
        table, controller_heading(figure.title, figure.unit),
        [&](const ControllerEntry& entry) { return estimate_cell(entry, figure.metric); },
        [&](const PaperController& paper) { return short_number(paper.values[i]); }, titled);
  }
  const auto nothing = [](const PaperController&) { return std::string("-"); };
  add_controller_column(
      table, "Survival [%]", [](const ControllerEntry& entry) { return percent(survival_of(entry), entry.survival); },
      nothing, titled);
  add_controller_column(table, "Faults", faults_cell, nothing, titled);
  titled.notes = {
      "e_root and e_dof: distance of the executed root and joints from the reference. Survival: episodes that ended as "
      "planned and not by a fall, with Wilson intervals. Faults: episodes in which the controller met or made a number "
      "that is not finite, and those it ended with a safe stop."};
  long unsupported = 0;
  for (const ControllerEntry& entry : table.entries) unsupported += entry.unsupported;
  if (unsupported > 0)
    titled.notes.push_back(fmt::format(
        "{} episodes could not run on this machine and are in no figure; their rows say why.", unsupported));
  return titled;
}

void add_controller_figures(const ControllerEntry& entry, std::vector<Figure>& into) {
  const FiguresOf figures{{.engine = entry.engine,
                           .controller = entry.controller,
                           .policy = entry.policy,
                           .perturbation = entry.perturbation},
                          into};
  for (const ControllerFigure& figure : kControllerFigures) {
    for (const std::string_view metric : {figure.before, figure.metric}) {
      if (metric.empty()) continue;
      const Estimate& estimate = estimate_of(entry, metric);
      figures.add(metric, estimate.n, estimate.mean, estimate.interval, figure.unit);
    }
  }
  figures.rate("survival", {entry.n, entry.survived, survival_of(entry), entry.survival});
  figures.count("faulty", entry.n, entry.faulty);
  figures.count("stopped", entry.n, entry.stopped);
  figures.count("unsupported", {}, entry.unsupported);
}

void add_controller_figures(const PaperController& paper, std::vector<Figure>& into) {
  const FiguresOf figures{
      {.source = "paper", .controller = std::string(paper.controller), .policy = std::string(paper.policy)}, into};
  for (std::size_t i = 0; i < kControllerFigures.size(); ++i) {
    const ControllerFigure& figure = kControllerFigures[i];
    if (!figure.before.empty()) figures.add(figure.before, {}, paper.before[i], kNoInterval, figure.unit);
    figures.add(figure.metric, {}, paper.values[i], kNoInterval, figure.unit);
  }
}

}  // namespace

ControllerTable controller_table(const std::vector<EpisodeRow>& rows, const IntervalOptions& options,
                                 const std::string& arm) {
  std::map<ControllerKey, RowList> groups;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm != arm || row->engine == kPlaybackEngine) continue;
    RowList& group =
        groups[{row->perturbation != "clean", row->perturbation, row->policy, row->controller, row->engine}];
    if (!group.empty()) require_distinct(*group.back(), *row);
    group.push_back(row);
  }
  ControllerTable table{.level = options.level, .entries = {}};
  ClusterBootstrap bootstrap(options.resamples, options.seed);
  for (const auto& [key, members] : groups) table.entries.push_back(summarise(key, members, bootstrap, options.level));
  // Without one figure there is nothing to show; with some, those that could not run are shown too.
  if (std::none_of(table.entries.begin(), table.entries.end(), has_figures)) table.entries.clear();
  return table;
}

Analysis controller_analysis(const ControllerTable& table) {
  Analysis analysis{.name = "controllers", .title = "Controllers", .level = table.level};
  if (table.entries.empty()) {
    analysis.notes = {"No episode ran under a controller in a physics engine."};
    return analysis;
  }
  analysis.tables = {jitter_table(table), tracking_table(table)};
  for (const ControllerEntry& entry : table.entries) add_controller_figures(entry, analysis.figures);
  for (const PaperController& paper : kPaperControllers) add_controller_figures(paper, analysis.figures);
  return analysis;
}

}  // namespace duet
