// Policies as tables and figures.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "duet/core/task.h"
#include "duet/report/ranking/comparison_parts.h"
#include "duet/report/ranking/policy_table.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

PolicyKey line_key(const PolicyLine& line, const std::string& engine = "") {
  return {.engine = engine, .controller = line.controller, .arm = line.arm, .policy = line.policy};
}

const PolicyFigures* in_engine(const PolicyLine& line, const std::string& engine) {
  for (const PolicyFigures& figures : line.engines)
    if (figures.key.engine == engine) return &figures;
  return nullptr;
}

// Physics engines by name, then playback.
std::vector<std::string> engines_of(const PolicyTable& table) {
  std::set<std::string> engines;
  for (const PolicyLine& line : table.lines)
    for (const PolicyFigures& figures : line.engines) engines.insert(figures.key.engine);
  const bool playback = engines.erase(std::string(kPlaybackEngine)) > 0;
  std::vector<std::string> list(engines.begin(), engines.end());
  if (playback) list.emplace_back(kPlaybackEngine);
  return list;
}

bool has_figure(const PolicyTable& table, const PolicyFigure& figure) {
  return std::any_of(table.lines.begin(), table.lines.end(), [&](const PolicyLine& line) {
    return std::any_of(line.engines.begin(), line.engines.end(),
                       [&](const PolicyFigures& figures) { return std::isfinite(figure.value(figures)); });
  });
}

std::string figure_number(const PolicyFigure& figure, double value) {
  if (!std::isfinite(value)) return "-";
  if (figure.share) return percent(value);
  return fmt::format("{:.{}f}", value, std::abs(value) >= 100.0 ? 0 : 2);
}

std::string figure_cell(const PolicyFigure& figure, const PolicyFigures& figures) {
  if (figure.name == "success") return rate_cell(figures.success);
  if (figure.name == "paper_success") return rate_cell(figures.paper);
  if (figure.name == "lift") return points(figures.lift.difference, figures.lift.interval);
  return figure_number(figure, figure.value(figures));
}

std::string meaning(const PolicyTable& table) {
  return fmt::format(
      "Success in % of episodes without perturbation under the suite's headline detector, with {:g} % Wilson "
      "intervals. Lift: success minus that of the same episodes under the null arm, with Newcombe's paired interval. "
      "Over a contact limit: of the episodes with a solid partner whose contact forces were measured.",
      100.0 * table.level);
}

void add_notes(const PolicyTable& table, TitledTable& titled) {
  titled.notes = {meaning(table), paper_detector_sentence()};
  for (const auto& [policy, episodes] : table.could_not_run)
    titled.notes.push_back(
        fmt::format("{} could not run ({} episodes) and is in no figure; its rows say why.", policy, episodes));
  titled.notes.insert(titled.notes.end(), table.faults.begin(), table.faults.end());
}

// One engine: a column per figure.
TitledTable one_engine_table(const PolicyTable& table) {
  std::vector<PolicyKey> keys;
  for (const PolicyLine& line : table.lines) keys.push_back(line.engines.front().key);
  TitledTable titled = labelled_table("Policies", policy_labels(keys));
  const auto figures = [&](std::size_t i) -> const PolicyFigures& { return table.lines[i].engines.front(); };
  add_column("n", titled, [&](std::size_t i) { return count_cell(figures(i).success.n); });
  for (const PolicyFigure& figure : kPolicyFigures)
    if (has_figure(table, figure))
      add_column(std::string(figure.title), titled, [&](std::size_t i) { return figure_cell(figure, figures(i)); });
  return titled;
}

void add_over_engines(const PolicyTable& table, const PolicyFigure& figure, TitledTable& titled) {
  const auto over = [&](std::size_t i) { return over_engines(table.lines[i], figure); };
  add_column("Mean", titled, [&](std::size_t i) {
    const PolicyLine& line = table.lines[i];
    return figure.name == "success" ? percent(line.mean_success, line.mean_interval)
                                    : figure_number(figure, over(i).mean);
  });
  add_column("Spread", titled, [&](std::size_t i) { return figure_number(figure, over(i).range); });
  add_column("Worst", titled, [&](std::size_t i) { return over(i).range > 0.0 ? over(i).worst : "-"; });
}

// Several engines: a table per figure, a column per engine.
TitledTable figure_table(const PolicyTable& table, const std::vector<std::string>& engines,
                         const PolicyFigure& figure) {
  std::vector<PolicyKey> keys;
  for (const PolicyLine& line : table.lines) keys.push_back(line_key(line));
  TitledTable titled = labelled_table(fmt::format("Policies: {}", figure.title), policy_labels(keys));
  for (const std::string& engine : engines) {
    add_column(engine, titled, [&](std::size_t i) {
      const PolicyFigures* figures = in_engine(table.lines[i], engine);
      return figures == nullptr ? "-" : figure_cell(figure, *figures);
    });
  }
  const auto physics = std::count_if(engines.begin(), engines.end(),
                                     [](const std::string& engine) { return engine != kPlaybackEngine; });
  if (physics > 1) add_over_engines(table, figure, titled);
  return titled;
}

std::vector<TitledTable> headline_tables(const PolicyTable& table) {
  const std::vector<std::string> engines = engines_of(table);
  if (engines.size() == 1) {
    std::vector<TitledTable> tables = {one_engine_table(table)};
    add_notes(table, tables.front());
    return tables;
  }
  std::vector<TitledTable> tables;
  for (const PolicyFigure& figure : kPolicyFigures)
    if (has_figure(table, figure)) tables.push_back(figure_table(table, engines, figure));
  add_notes(table, tables.front());
  tables.front().notes.emplace_back(
      "Mean, spread (highest minus lowest) and worst are over the physics engines, each counting the same; playback "
      "is none. The interval of the mean success is Wilson's over clips and says nothing of other engines.");
  return tables;
}

std::vector<const PolicyFigures*> all_figures(const PolicyTable& table) {
  std::vector<const PolicyFigures*> all;
  for (const PolicyLine& line : table.lines)
    for (const PolicyFigures& figures : line.engines) all.push_back(&figures);
  std::stable_sort(all.begin(), all.end(),
                   [](const PolicyFigures* a, const PolicyFigures* b) { return a->key < b->key; });
  return all;
}

std::vector<std::string> tasks_of(const PolicyTable& table) {
  std::set<std::pair<int, std::string>> ranked;
  for (const PolicyFigures* figures : all_figures(table))
    for (const auto& [task, rate] : figures->by_task)
      if (task != "all") ranked.emplace(task_rank(task), task);
  std::vector<std::string> tasks = {"all"};
  for (const auto& [rank, task] : ranked) tasks.push_back(task);
  return tasks;
}

double paper_value(const PaperPolicy& paper, const std::string& task) {
  if (task == "all") return paper.overall;
  for (const auto& [of, percent] : paper.tasks)
    if (to_string(of) == task) return percent;
  return std::numeric_limits<double>::quiet_NaN();
}

using TaskRates = std::map<std::string, Rate>;

TitledTable task_table(const PolicyTable& table, const std::string& title, TaskRates PolicyFigures::*rates) {
  const std::vector<const PolicyFigures*> all = all_figures(table);
  std::vector<PolicyKey> keys;
  keys.reserve(all.size());
  for (const PolicyFigures* figures : all) keys.push_back(figures->key);
  TitledTable titled = labelled_table(title, policy_labels(keys));
  for (const std::string& task : tasks_of(table)) {
    add_column(task_title(task), titled, [&](std::size_t i) {
      const auto found = (all[i]->*rates).find(task);
      return found == (all[i]->*rates).end() ? "-" : rate_cell(found->second);
    });
  }
  return titled;
}

void add_paper_rows(const PolicyTable& table, TitledTable& titled) {
  for (const PaperPolicy& paper : paper_policies()) {
    if (!paper.family.empty()) continue;
    std::vector<std::string>& cells = add_paper_row(std::string(paper.name), titled);
    for (const std::string& task : tasks_of(table)) {
      const double value = paper_value(paper, task);
      cells.push_back(decimals(value, 1));
    }
  }
  titled.notes = {
      paper_detector_sentence(),
      "The paper's rows are Table S9 as printed: 126 episodes, as its percentages imply, of other clips, in "
      "a simulator that it does not name."};
}

TitledTable pairs_table(const PolicyTable& table) {
  TitledTable titled = comparison_table(table.pairs);
  titled.title = "Policies against each other";
  titled.notes = {fmt::format(
      "The same episodes of one engine and controller under two policies, headline detector. A - B: points "
      "with Newcombe's paired {:g} % interval; by clip: bootstrap over clips, nowhere narrower than Newcombe's over "
      "so many clips. {} p (Holm): "
      "corrected for the {} comparisons here. MDE: the smallest difference, in points, that so many pairs with "
      "so much disagreement show in 80 % of runs.",
      100.0 * table.level, kPairedTests, table.pairs.size())};
  return titled;
}

void add_policy_figures(const PolicyFigures& of, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(of.key, into);
  figures.keys.perturbation = kClean;
  for (const auto& [task, rate] : of.by_task) {
    figures.keys.task = task;
    figures.rate("success", rate);
  }
  for (const auto& [task, rate] : of.by_task_paper) {
    figures.keys.task = task;
    if (rate.n > 0) figures.rate("paper_success", rate);
  }
  figures.keys.task = "all";
  add_difference("lift", of.lift, figures);
  figures.rate("falls", of.falls);
  figures.rate("violations", of.violations);
  for (const PolicyFigure& figure : kPolicyFigures)
    if (!figure.share) figures.add(figure.name, of.success.n, figure.value(of), kNoInterval, figure.unit);
}

// Adds the figures over physics engines.
void add_line_figures(const PolicyLine& line, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(line_key(line, "all"), into);
  figures.keys.perturbation = kClean;
  figures.keys.task = "all";
  figures.add("mean_success", {}, line.mean_success, line.mean_interval);
  for (const PolicyFigure& figure : kPolicyFigures) {
    const OverEngines over = over_engines(line, figure);
    if (over.engines == 0) continue;
    figures.keys.engine = "all";
    figures.add(fmt::format("{}_mean", figure.name), over.engines, over.mean, kNoInterval, figure.unit);
    figures.add(fmt::format("{}_range", figure.name), over.engines, over.range, kNoInterval, figure.unit);
    figures.keys.engine = over.worst;
    figures.add(fmt::format("{}_worst", figure.name), over.engines, figure.value(*in_engine(line, over.worst)),
                kNoInterval, figure.unit);
  }
}

void add_paper_policies(std::vector<Figure>& into) {
  for (const PaperPolicy& paper : paper_policies()) {
    if (!paper.family.empty()) continue;
    FiguresOf figures = paper_figures_of(paper.name, into);
    figures.keys.task = "all";
    figures.add("paper_success", {}, paper.overall / 100.0);
    for (const PaperTaskRate& of : paper.tasks) {
      figures.keys.task = to_string(of.task);
      figures.add("paper_success", {}, of.percent / 100.0);
    }
  }
}

}  // namespace

std::string paper_detector_sentence() {
  return "The paper's detectors watch the human and this suite's \"robot\" detectors the robot, so only success under "
         "the paper's detectors (paper/paper) can be held against the paper's figures.";
}

Analysis policy_analysis(const PolicyTable& table) {
  Analysis analysis{.name = "policies", .title = "Policies", .level = table.level};
  if (table.lines.empty()) {
    analysis.notes = {"No policy but replay ran."};
    return analysis;
  }
  analysis.tables = headline_tables(table);
  analysis.tables.push_back(task_table(table, "Policies by task: headline detector", &PolicyFigures::by_task));
  if (has_figure(table, kPolicyFigures[1])) {
    analysis.tables.push_back(
        task_table(table, "Policies by task: the paper's detectors (Table S9)", &PolicyFigures::by_task_paper));
    add_paper_rows(table, analysis.tables.back());
  }
  if (!table.pairs.empty()) analysis.tables.push_back(pairs_table(table));
  for (const PolicyFigures* figures : all_figures(table)) add_policy_figures(*figures, analysis.figures);
  for (const PolicyLine& line : table.lines) add_line_figures(line, analysis.figures);
  for (const Comparison& pair : table.pairs) add_comparison_figures(pair, kFivePoints, analysis.figures);
  for (const auto& [policy, episodes] : table.could_not_run)
    FiguresOf{{.policy = policy}, analysis.figures}.count("could_not_run", {}, episodes);
  add_paper_policies(analysis.figures);
  return analysis;
}

}  // namespace duet
