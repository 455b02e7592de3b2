// Controller tables as text and for other programs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/results/analyses/controller_table_parts.h"
#include "duet/results/analyses/leaderboard_rows.h"
#include "duet/results/analyses/text_table.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

constexpr const char* kPaperEngine = "the paper's";
constexpr std::size_t kJitterFigures = 3;  // of kControllerFigures, those that the reference has too

// Three significant digits as far as they are decimals; "-" for NaN.
std::string number(double value) {
  if (!std::isfinite(value)) return "-";
  const double size = std::abs(value);
  return fmt::format("{:.{}f}", value, size >= 100.0 ? 0 : size >= 10.0 ? 1 : size >= 1.0 ? 2 : 3);
}

std::string cell(const Estimate& estimate) {
  if (!std::isfinite(estimate.interval.low)) return number(estimate.mean);
  return fmt::format("{} [{}, {}]", number(estimate.mean), number(estimate.interval.low),
                     number(estimate.interval.high));
}

const Estimate& estimate_of(const ControllerEntry& entry, std::string_view metric) {
  return entry.figures.find(metric)->second;
}

bool perturbations_differ(const ControllerTable& table) {
  return std::any_of(table.entries.begin(), table.entries.end(), [&](const ControllerEntry& entry) {
    return entry.perturbation != table.entries.front().perturbation;
  });
}

// The columns that say of what a row is, of our rows and of the paper's.
TitledTable labelled_table(const ControllerTable& table, const char* title) {
  const bool perturbed = perturbations_differ(table);
  TitledTable titled{.title = title,
                     .caption = perturbed ? "" : fmt::format("Perturbation {}.", table.entries.front().perturbation),
                     .table = {},
                     .notes = {}};
  if (perturbed) titled.table.header.emplace_back("Perturbation");
  for (const char* column : {"Policy", "Controller", "Engine"}) titled.table.header.emplace_back(column);
  titled.table.label_columns = titled.table.header.size();
  for (const ControllerEntry& entry : table.entries) {
    std::vector<std::string>& cells = titled.table.rows.emplace_back();
    if (perturbed) cells.push_back(entry.perturbation);
    cells.insert(cells.end(), {entry.policy, entry.controller, entry.engine});
  }
  for (const PaperController& paper : paper_controllers()) {
    std::vector<std::string>& cells = titled.table.rows.emplace_back();
    if (perturbed) cells.emplace_back("-");
    cells.insert(cells.end(), {std::string(paper.policy), std::string(paper.controller), kPaperEngine});
  }
  return titled;
}

// Appends a column: of our entries, then of the paper's rows.
template <typename Ours, typename Papers>
void add_column(const ControllerTable& table, const std::string& header, const Ours& ours, const Papers& papers,
                TitledTable& titled) {
  titled.table.header.push_back(header);
  std::size_t row = 0;
  for (const ControllerEntry& entry : table.entries) titled.table.rows[row++].push_back(ours(entry));
  for (const PaperController& paper : paper_controllers()) titled.table.rows[row++].push_back(papers(paper));
}

std::string head(std::string_view title, std::string_view unit) {
  return unit == "1" ? std::string(title) : fmt::format("{} [{}]", title, unit);
}

void add_episodes(const ControllerTable& table, TitledTable& titled) {
  add_column(
      table, "n", [](const ControllerEntry& entry) { return fmt::format("{}", entry.n); },
      [](const PaperController&) { return std::string("-"); }, titled);
}

std::string paper_sentence() {
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
  TitledTable titled = labelled_table(table, "Controllers: jitter before and after (Table S4)");
  add_episodes(table, titled);
  for (std::size_t i = 0; i < kJitterFigures; ++i) {
    const ControllerFigure& figure = kControllerFigures[i];
    add_column(
        table, head(fmt::format("{}, before", figure.title), figure.unit),
        [&](const ControllerEntry& entry) { return cell(estimate_of(entry, figure.before)); },
        [&](const PaperController& paper) { return number(paper.before[i]); }, titled);
    add_column(
        table, head(figure.title, figure.unit),
        [&](const ControllerEntry& entry) { return cell(estimate_of(entry, figure.metric)); },
        [&](const PaperController& paper) { return number(paper.values[i]); }, titled);
  }
  titled.notes = {how_sentence(table) + " HF ratio: share of the joint-velocity energy above 5 Hz.", paper_sentence()};
  return titled;
}

std::string faults_cell(const ControllerEntry& entry) {
  if (entry.stopped == 0) return fmt::format("{}", entry.faulty);
  return fmt::format("{} ({} stopped)", entry.faulty, entry.stopped);
}

TitledTable tracking_table(const ControllerTable& table) {
  TitledTable titled = labelled_table(table, "Controllers: tracking, survival and faults (Table S4)");
  add_episodes(table, titled);
  for (std::size_t i = kJitterFigures; i < kControllerFigures.size(); ++i) {
    const ControllerFigure& figure = kControllerFigures[i];
    add_column(
        table, head(figure.title, figure.unit),
        [&](const ControllerEntry& entry) { return cell(estimate_of(entry, figure.metric)); },
        [&](const PaperController& paper) { return number(paper.values[i]); }, titled);
  }
  const auto nothing = [](const PaperController&) { return std::string("-"); };
  add_column(
      table, "Survival [%]",
      [](const ControllerEntry& entry) {
        return entry.n == 0
                   ? "-"
                   : percent(static_cast<double>(entry.survived) / static_cast<double>(entry.n), entry.survival);
      },
      nothing, titled);
  add_column(table, "Faults", faults_cell, nothing, titled);
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

std::string plain(double value) { return std::isfinite(value) ? fmt::format("{}", value) : ""; }

void add_lines(const ControllerEntry& entry, TextTable& lines) {
  const auto line = [&](std::string_view figure, std::string_view unit, long n, double value,
                        const Interval& interval) {
    lines.rows.push_back({"duet", entry.perturbation, entry.policy, entry.controller, entry.engine, std::string(figure),
                          std::string(unit), fmt::format("{}", n), plain(value), plain(interval.low),
                          plain(interval.high)});
  };
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  for (const ControllerFigure& figure : kControllerFigures) {
    for (const std::string_view metric : {figure.before, figure.metric}) {
      if (metric.empty()) continue;
      const Estimate& estimate = estimate_of(entry, metric);
      line(metric, figure.unit, estimate.n, estimate.mean, estimate.interval);
    }
  }
  line("survival", "1", entry.n,
       entry.n > 0 ? static_cast<double>(entry.survived) / static_cast<double>(entry.n) : kNone, entry.survival);
  line("faulty", "1", entry.n, static_cast<double>(entry.faulty), {kNone, kNone});
  line("stopped", "1", entry.n, static_cast<double>(entry.stopped), {kNone, kNone});
}

void add_lines(const PaperController& paper, TextTable& lines) {
  for (std::size_t i = 0; i < kControllerFigures.size(); ++i) {
    const ControllerFigure& figure = kControllerFigures[i];
    const auto line = [&](std::string_view metric, double value) {
      lines.rows.push_back({"paper", "", std::string(paper.policy), std::string(paper.controller), "",
                            std::string(metric), std::string(figure.unit), "", plain(value), "", ""});
    };
    if (!figure.before.empty()) line(figure.before, paper.before[i]);
    line(figure.metric, paper.values[i]);
  }
}

nlohmann::json json_of(const ControllerEntry& entry) {
  nlohmann::json figures = nlohmann::json::object();
  for (const auto& [metric, estimate] : entry.figures)
    figures[metric] = {{"n", estimate.n},
                       {"mean", number_or_null(estimate.mean)},
                       {"ci_low", number_or_null(estimate.interval.low)},
                       {"ci_high", number_or_null(estimate.interval.high)}};
  return {{"perturbation", entry.perturbation},
          {"policy", entry.policy},
          {"controller", entry.controller},
          {"engine", entry.engine},
          {"n", entry.n},
          {"survived", entry.survived},
          {"survival_ci", {number_or_null(entry.survival.low), number_or_null(entry.survival.high)}},
          {"faulty", entry.faulty},
          {"stopped", entry.stopped},
          {"unsupported", entry.unsupported},
          {"figures", std::move(figures)}};
}

nlohmann::json json_of(const PaperController& paper) {
  nlohmann::json figures = nlohmann::json::object();
  for (std::size_t i = 0; i < kControllerFigures.size(); ++i) {
    const ControllerFigure& figure = kControllerFigures[i];
    figures[std::string(figure.metric)] = paper.values[i];
    if (!figure.before.empty()) figures[std::string(figure.before)] = paper.before[i];
  }
  return {{"policy", paper.policy}, {"controller", paper.controller}, {"figures", std::move(figures)}};
}

}  // namespace

std::vector<TitledTable> controller_tables(const ControllerTable& table) {
  if (table.entries.empty()) return {};
  return {jitter_table(table), tracking_table(table)};
}

std::string no_controllers() { return "No episode ran under a controller in a physics engine."; }

std::string controller_table_markdown(const ControllerTable& table) {
  if (table.entries.empty()) return no_controllers() + "\n";
  std::string text;
  for (const TitledTable& titled : controller_tables(table))
    text.append(text.empty() ? "" : "\n").append(markdown_of(titled));
  return text;
}

std::string controller_table_csv(const ControllerTable& table) {
  TextTable lines;
  lines.header = {"source", "perturbation", "policy", "controller", "engine", "figure", "unit",
                  "n",      "value",        "ci_low", "ci_high"};
  for (const ControllerEntry& entry : table.entries) add_lines(entry, lines);
  if (!table.entries.empty())
    for (const PaperController& paper : paper_controllers()) add_lines(paper, lines);
  return csv_table(lines);
}

std::string controller_table_latex(const ControllerTable& table) {
  if (table.entries.empty()) return fmt::format("% {}\n", no_controllers());
  std::string text = "% \\usepackage{booktabs}\n";
  for (const TitledTable& titled : controller_tables(table)) text.append("\n").append(latex_of(titled));
  return text;
}

nlohmann::json controller_table_json(const ControllerTable& table) {
  nlohmann::json entries = nlohmann::json::array(), paper = nlohmann::json::array();
  for (const ControllerEntry& entry : table.entries) entries.push_back(json_of(entry));
  for (const PaperController& row : paper_controllers()) paper.push_back(json_of(row));
  return {{"schema", "duet.controller_table/1"},
          {"level", table.level},
          {"entries", std::move(entries)},
          {"paper", std::move(paper)},
          {"note", paper_sentence()}};
}

}  // namespace duet
