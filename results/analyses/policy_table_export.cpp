// Policy tables as text and for other programs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "duet/core/task.h"
#include "duet/results/analyses/comparison_parts.h"
#include "duet/results/analyses/cross_engine.h"
#include "duet/results/analyses/policy_table.h"
#include "duet/results/rows/json_fields.h"
#include "duet/results/statistics/row_groups.h"

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

std::string plain(const PolicyFigure& figure, double value) {
  if (!std::isfinite(value)) return "-";
  if (figure.share) return percent(value);
  return fmt::format("{:.{}f}", value, std::abs(value) >= 100.0 ? 0 : 2);
}

std::string figure_cell(const PolicyFigure& figure, const PolicyFigures& figures) {
  if (figure.name == "success") return rate_cell(figures.success);
  if (figure.name == "paper_success") return rate_cell(figures.paper);
  if (figure.name == "lift") return points(figures.lift.difference, figures.lift.interval);
  return plain(figure, figure.value(figures));
}

void add_column(const std::string& header, TitledTable& titled, const std::function<std::string(std::size_t)>& cell) {
  titled.table.header.push_back(header);
  for (std::size_t i = 0; i < titled.table.rows.size(); ++i) titled.table.rows[i].push_back(cell(i));
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
  add_column("n", titled, [&](std::size_t i) { return fmt::format("{}", figures(i).success.n); });
  for (const PolicyFigure& figure : kPolicyFigures)
    if (has_figure(table, figure))
      add_column(std::string(figure.title), titled, [&](std::size_t i) { return figure_cell(figure, figures(i)); });
  return titled;
}

void add_over_engines(const PolicyTable& table, const PolicyFigure& figure, TitledTable& titled) {
  const auto over = [&](std::size_t i) { return over_engines(table.lines[i], figure); };
  add_column("Mean", titled, [&](std::size_t i) {
    const PolicyLine& line = table.lines[i];
    return figure.name == "success" ? percent(line.mean_success, line.mean_interval) : plain(figure, over(i).mean);
  });
  add_column("Spread", titled, [&](std::size_t i) { return plain(figure, over(i).range); });
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
      "is none. The interval of the mean success is over clips and says nothing of other engines.");
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
      cells.push_back(std::isfinite(value) ? fmt::format("{:.1f}", value) : "-");
    }
  }
  titled.notes = {
      paper_detector_sentence(),
      "The paper's rows are Table S9 as printed: 126 episodes, as its percentages imply, of other clips, in "
      "a simulator that it does not name."};
}

TitledTable pairs_table(const PolicyTable& table) {
  return {.title = "Policies against each other",
          .caption = "",
          .table = comparison_table(table.pairs),
          .notes = {fmt::format(
              "The same episodes of one engine and controller under two policies, headline detector. A - B: points "
              "with Newcombe's paired {:g} % interval; by clip: bootstrap over clips. p: exact McNemar; p (Holm): "
              "corrected for the {} comparisons here. MDE: the smallest difference, in points, that so many pairs with "
              "so much disagreement show in 80 % of runs.",
              100.0 * table.level, table.pairs.size())}};
}

std::string no_policies() { return "No policy but replay ran."; }

void add_lines(const PolicyFigures& figures, TextTable& lines) {
  const auto line = [&](const std::string& task, const char* figure, long n, double value, const Interval& interval) {
    add_figure_line("duet", figures.key, task, figure, n, value, interval, lines);
  };
  for (const auto& [task, rate] : figures.by_task) line(task, "success", rate.n, rate.rate, rate.interval);
  for (const auto& [task, rate] : figures.by_task_paper)
    if (rate.n > 0) line(task, "paper_success", rate.n, rate.rate, rate.interval);
  line("all", "lift", figures.lift.pairs, figures.lift.difference, figures.lift.interval);
  line("all", "falls", figures.falls.n, figures.falls.rate, figures.falls.interval);
  line("all", "violations", figures.violations.n, figures.violations.rate, figures.violations.interval);
  line("all", "dof_jerk", figures.success.n, figures.dof_jerk, kNoInterval);
}

nlohmann::json json_of(const TaskRates& rates) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [task, rate] : rates)
    if (rate.n > 0) json[task] = json_of(rate);
  return json;
}

nlohmann::json json_of(const PolicyFigures& figures) {
  return {{"engine", figures.key.engine},
          {"success", json_of(figures.by_task)},
          {"paper_success", json_of(figures.by_task_paper)},
          {"lift",
           {{"pairs", figures.lift.pairs},
            {"difference", number_or_null(figures.lift.difference)},
            {"interval", json_of(figures.lift.interval)}}},
          {"falls", json_of(figures.falls)},
          {"violations", json_of(figures.violations)},
          {"dof_jerk", number_or_null(figures.dof_jerk)}};
}

nlohmann::json json_of(const PolicyLine& line) {
  nlohmann::json engines = nlohmann::json::array();
  for (const PolicyFigures& figures : line.engines) engines.push_back(json_of(figures));
  nlohmann::json over = nlohmann::json::object();
  for (const PolicyFigure& figure : kPolicyFigures) {
    const OverEngines of = over_engines(line, figure);
    if (of.engines > 0)
      over[std::string(figure.name)] = {
          {"engines", of.engines}, {"mean", of.mean}, {"range", of.range}, {"worst", of.worst}};
  }
  return {{"controller", line.controller},
          {"arm", line.arm},
          {"policy", line.policy},
          {"engines", std::move(engines)},
          {"over_engines", std::move(over)},
          {"mean_success", number_or_null(line.mean_success)},
          {"mean_success_interval", json_of(line.mean_interval)}};
}

nlohmann::json json_of(const PaperPolicy& paper) {
  nlohmann::json tasks = {{"all", paper.overall}};
  for (const auto& [task, percent] : paper.tasks) tasks[std::string(to_string(task))] = percent;
  return {{"name", paper.name}, {"success_percent", std::move(tasks)}};
}

}  // namespace

std::string paper_detector_sentence() {
  return "The paper's detectors watch the human and this suite's \"robot\" detectors the robot, so only success under "
         "the paper's detectors (paper/paper) can be held against the paper's figures.";
}

std::vector<TitledTable> policy_tables(const PolicyTable& table) {
  if (table.lines.empty()) return {};
  std::vector<TitledTable> tables = headline_tables(table);
  tables.push_back(task_table(table, "Policies by task: headline detector", &PolicyFigures::by_task));
  if (has_figure(table, kPolicyFigures[1])) {
    tables.push_back(
        task_table(table, "Policies by task: the paper's detectors (Table S9)", &PolicyFigures::by_task_paper));
    add_paper_rows(table, tables.back());
  }
  if (!table.pairs.empty()) tables.push_back(pairs_table(table));
  return tables;
}

std::string policy_table_markdown(const PolicyTable& table) {
  return table.lines.empty() ? no_policies() + "\n" : tables_markdown(policy_tables(table));
}

std::string policy_table_csv(const PolicyTable& table) {
  TextTable lines = figure_lines("task");
  for (const PolicyFigures* figures : all_figures(table)) add_lines(*figures, lines);
  if (table.lines.empty()) return csv_table(lines);
  for (const PaperPolicy& paper : paper_policies()) {
    if (!paper.family.empty()) continue;
    for (const std::string& task : tasks_of(table))
      lines.rows.push_back({"paper", "", "", "", std::string(paper.name), task, "paper_success", "",
                            number_cell(paper_value(paper, task) / 100.0), "", ""});
  }
  return csv_table(lines);
}

std::string policy_table_latex(const PolicyTable& table) {
  return table.lines.empty() ? fmt::format("% {}\n", no_policies()) : tables_latex(policy_tables(table));
}

nlohmann::json policy_table_json(const PolicyTable& table) {
  nlohmann::json lines = nlohmann::json::array();
  nlohmann::json paper = nlohmann::json::array();
  for (const PolicyLine& line : table.lines) lines.push_back(json_of(line));
  for (const PaperPolicy& row : paper_policies())
    if (row.family.empty()) paper.push_back(json_of(row));
  return {{"schema", "duet.policy_table/1"},
          {"level", table.level},
          {"lines", std::move(lines)},
          {"pairs", comparison_json(table.pairs).at("comparisons")},
          {"could_not_run", table.could_not_run},
          {"faults", table.faults},
          {"paper", std::move(paper)},
          {"note", paper_detector_sentence()}};
}

}  // namespace duet
