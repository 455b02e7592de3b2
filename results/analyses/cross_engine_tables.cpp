#include "duet/results/analyses/cross_engine_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "duet/results/analyses/leaderboard_rows.h"

namespace duet {
namespace {

std::string rate_cell(const EngineRate* rate) { return rate != nullptr ? percent(rate->rate, rate->interval) : "-"; }

const EngineRate* find(const std::vector<EngineRate>& rates, const std::string& engine) {
  const auto found =
      std::find_if(rates.begin(), rates.end(), [&](const EngineRate& rate) { return rate.engine == engine; });
  return found != rates.end() ? &*found : nullptr;
}

std::string count(long value) { return fmt::format("{}", value); }

std::string left_out_note(const std::vector<EngineSuccess>& success) {
  long left_out = 0;
  for (const EngineSuccess& entry : success) left_out += entry.left_out;
  if (left_out == 0) return "";
  return fmt::format("{} episodes that only some of the engines ran are left out here; the leaderboard counts them.",
                     left_out);
}

TitledTable success_table(const CrossEngine& result, const CombinationLabels& labels) {
  TitledTable titled{.title = "Success per engine",
                     .caption = labels.caption,
                     .table = {.header = labels.columns, .rows = {}, .label_columns = labels.columns.size()},
                     .notes = {}};
  titled.table.header.emplace_back("n");
  for (const RunEngine& engine : result.engines) titled.table.header.push_back(engine.name);
  if (result.has_playback) titled.table.header.emplace_back(kPlaybackEngine);
  for (std::size_t i = 0; i < result.success.size(); ++i) {
    const EngineSuccess& entry = result.success[i];
    std::vector<std::string> cells = labels.cells[i];
    cells.push_back(count(entry.n));
    for (const RunEngine& engine : result.engines) cells.push_back(rate_cell(find(entry.engines, engine.name)));
    if (result.has_playback) cells.push_back(rate_cell(entry.playback.has_value() ? &*entry.playback : nullptr));
    titled.table.rows.push_back(std::move(cells));
  }
  titled.notes = {
      fmt::format("Success in % of the episodes that all engines of the row ran, with {:g} % Wilson "
                  "intervals.{}",
                  100.0 * result.level, result.has_playback ? " Playback has no physics and is in no mean." : "")};
  if (std::string note = left_out_note(result.success); !note.empty()) titled.notes.push_back(std::move(note));
  return titled;
}

std::string points_cell(double value) { return percent(value); }

TitledTable spread_table(const CrossEngine& result, const CombinationLabels& labels) {
  TitledTable titled{.title = "Spread between engines",
                     .caption = labels.caption,
                     .table = {.header = labels.columns, .rows = {}, .label_columns = labels.columns.size()},
                     .notes = {}};
  for (const char* title : {"Engines", "Mean", "SD", "Range", "Noise SD", "Beyond noise"})
    titled.table.header.emplace_back(title);
  for (std::size_t i = 0; i < result.success.size(); ++i) {
    const EngineSuccess& entry = result.success[i];
    std::vector<std::string> cells = labels.cells[i];
    cells.push_back(count(static_cast<long>(entry.engines.size())));
    cells.push_back(percent(entry.mean, entry.mean_interval));
    for (const double value : {entry.sd, entry.range, entry.noise_sd, entry.excess_sd})
      cells.push_back(points_cell(value));
    titled.table.rows.push_back(std::move(cells));
  }
  titled.notes = {
      fmt::format("Mean over engines in %, each engine counting the same. Its {:g} % interval draws clips again, the "
                  "same clips in all engines: it covers which clips were taken, not which engines; those are the ones "
                  "at hand.",
                  100.0 * result.level),
      "In points: SD, the sample standard deviation of the engines' rates; range, the highest minus the lowest; noise "
      "SD, what chance in so many episodes gives if engines do not differ; beyond noise, the SD that is left when "
      "chance is taken off (tau by the method of moments, not below 0). Engines share their episodes, so chance is "
      "smaller than assumed and what is left errs low."};
  return titled;
}

std::string tau_cell(double tau_b) { return std::isfinite(tau_b) ? fmt::format("{:.2f}", tau_b) : "not defined"; }

std::string rank_sentence(const RankStability& ranks) {
  if (ranks.items < 2) return fmt::format("Ranks of {}: not defined with fewer than two of them.", ranks.of);
  const std::string tau =
      ranks.defined > 0 ? fmt::format("mean tau-b {:.2f} over {} pairs of engines", ranks.mean_tau_b, ranks.defined)
                        : "tau-b is not defined for any two engines (all tied)";
  return fmt::format("Ranks of {}: {}; {} of {} pairs swap their order between some two engines.", ranks.of, tau,
                     ranks.swapped, ranks.item_pairs);
}

std::string reliability_sentence(const RankStability& ranks) {
  const auto limits = [](const Interval& interval, double scale, int digits) {
    if (!std::isfinite(interval.low)) return std::string("no interval");
    return fmt::format("[{:.{}f}, {:.{}f}]", scale * interval.low + 0.0, digits, scale * interval.high + 0.0, digits);
  };
  return fmt::format(
      "Of {}, with intervals that draw clips again: mean tau-b {} {}; mean maximum rank violation {:.1f} points {}; "
      "the "
      "winner changes between two engines with probability {:.2f} {}.",
      ranks.of, tau_cell(ranks.mean_tau_b), limits(ranks.tau_interval, 1.0, 2), 100.0 * ranks.rank_violation,
      limits(ranks.violation_interval, 100.0, 1), ranks.winner_changes, limits(ranks.winner_interval, 1.0, 2));
}

TitledTable rank_table(const CrossEngine& result) {
  TitledTable titled{.title = "Stability of ranks",
                     .caption = "",
                     .table = {.header = {"Engines"}, .rows = {}, .label_columns = 1},
                     .notes = {}};
  std::vector<const RankStability*> shown;
  for (const RankStability& ranks : result.ranks) {
    titled.notes.push_back(rank_sentence(ranks));
    if (ranks.items < 2) continue;
    if (std::isfinite(ranks.rank_violation)) titled.notes.push_back(reliability_sentence(ranks));
    shown.push_back(&ranks);
    titled.table.header.push_back("tau-b of " + ranks.of);
    titled.table.header.emplace_back("Swapped");
  }
  if (shown.empty()) return titled;
  for (std::size_t i = 0; i < shown.front()->engines.size(); ++i) {
    const EnginePairRanks& pair = shown.front()->engines[i];
    std::vector<std::string> cells = {pair.engine_a + ", " + pair.engine_b};
    for (const RankStability* ranks : shown) {
      cells.push_back(tau_cell(ranks->engines[i].tau_b));
      cells.push_back(fmt::format("{} of {}", ranks->engines[i].swapped, ranks->engines[i].pairs));
    }
    titled.table.rows.push_back(std::move(cells));
  }
  titled.notes.emplace_back(
      "By success; combinations are of controller and policy. tau-b (Kendall): 1 the same order in both engines, 0 "
      "none in common, -1 the reverse; not defined where all are tied. Swapped: pairs in opposite order in the two "
      "engines.");
  return titled;
}

std::string drift_cell(const MetricDrift* drift) {
  if (drift == nullptr) return "-";
  return fmt::format("{:+.3g} [{:.3g}, {:.3g}]", drift->mean + 0.0, drift->interval.low + 0.0,
                     drift->interval.high + 0.0);
}

// The drifts of one metric under one controller by engine.
using DriftRow = std::map<std::string, const MetricDrift*>;

std::vector<std::string> drift_cells(const MetricColumn& metric, const DriftRow& row, const CrossEngine& result) {
  double playback = 0.0;
  long most = 0;
  long fewest = row.begin()->second->pairs;
  for (const auto& [engine, drift] : row) {
    if (drift->pairs > most) playback = drift->playback;
    most = std::max(most, drift->pairs);
    fewest = std::min(fewest, drift->pairs);
  }
  std::vector<std::string> cells = {
      metric.title.empty() ? metric.name : metric.title, metric.unit.empty() ? "1" : metric.unit,
      fewest == most ? count(most) : fmt::format("{}-{}", fewest, most), significant(playback)};
  for (const RunEngine& engine : result.engines) {
    const auto found = row.find(engine.name);
    cells.push_back(drift_cell(found != row.end() ? found->second : nullptr));
  }
  return cells;
}

TitledTable drift_table(const CrossEngine& result, const std::string& controller) {
  TitledTable titled{
      .title = "Drift of metrics from playback",
      .caption = fmt::format("Controller {}.", controller),
      .table = {.header = {"Metric", "Unit", "Pairs", "playback"}, .rows = {}, .label_columns = 2},
      .notes = {fmt::format("Mean of engine minus playback over the same episodes, with a {:g} % interval that draws "
                            "clips again. Playback: its own mean.",
                            100.0 * result.level)}};
  for (const RunEngine& engine : result.engines) titled.table.header.push_back(engine.name);
  for (const MetricColumn& metric : result.metrics) {
    DriftRow row;
    for (const MetricDrift& drift : result.drift) {
      if (drift.controller == controller && drift.metric == metric.name) row[drift.engine] = &drift;
    }
    if (!row.empty()) titled.table.rows.push_back(drift_cells(metric, row, result));
  }
  return titled;
}

std::string reached(double time) { return std::isfinite(time) ? fmt::format("{:.2f}", time) : "not reached"; }

TitledTable parting_table(const CrossEngine& result, bool with_controller) {
  TitledTable titled{.title = "Time until engines part", .caption = "", .table = {}, .notes = {}};
  if (with_controller) titled.table.header.emplace_back("Controller");
  titled.table.header.emplace_back("Engines");
  titled.table.label_columns = titled.table.header.size();
  for (const char* title : {"Episodes", "First quartile [s]", "Median [s]", "Third quartile [s]", "Never part [%]"})
    titled.table.header.emplace_back(title);
  long without_trace = 0;
  for (const EngineParting& parting : result.parting) {
    without_trace += parting.without_trace;
    if (parting.pairs == 0) continue;
    std::vector<std::string> cells;
    if (with_controller) cells.push_back(parting.controller);
    cells.push_back(parting.engine_a + ", " + parting.engine_b);
    cells.push_back(count(parting.pairs));
    for (const double time : {parting.lower_quartile, parting.median, parting.upper_quartile})
      cells.push_back(reached(time));
    cells.push_back(percent(static_cast<double>(parting.pairs - parting.parted) / static_cast<double>(parting.pairs)));
    titled.table.rows.push_back(std::move(cells));
  }
  if (titled.table.rows.empty()) {
    titled.notes = {"No episode has traces of two engines that can be compared."};
    return titled;
  }
  titled.notes = {fmt::format(
      "First time at which a traced point (root, hands) is more than {:g} cm away from where it is in the other engine "
      "in the same episode, or at which the robot falls or diverges in one engine alone. Quartiles by Kaplan and "
      "Meier: an episode that ends before that counts for as long as it lasted.",
      100.0 * result.parting_distance)};
  if (without_trace > 0) {
    titled.notes.push_back(fmt::format("{} pairs without comparable traces are left out.", without_trace));
  }
  return titled;
}

TitledTable force_table(const CrossEngine& result) {
  TitledTable titled{
      .title = "Agreement of contact forces",
      .caption = "",
      .table = {.header = {"Force", "Unit", "Episodes", "Typical", "Spread [%]"}, .rows = {}, .label_columns = 2},
      .notes = {}};
  for (const RunEngine& engine : result.engines) titled.table.header.push_back(engine.name);
  for (const ForceAgreement& force : result.forces) {
    std::vector<std::string> cells = {force.name, force.unit, count(force.episodes), significant(force.typical),
                                      percent(force.spread)};
    for (const RunEngine& engine : result.engines) {
      const auto found = force.ratio.find(engine.name);
      cells.push_back(found != force.ratio.end() ? fmt::format("{:.3f}", found->second) : "-");
    }
    titled.table.rows.push_back(std::move(cells));
  }
  titled.notes = {titled.table.rows.empty()
                      ? "No episode has a contact force in two engines."
                      : "Medians over the episodes in which some engine has the force. Typical: the engines' median. "
                        "Spread: highest minus lowest over the mean of the engines. Below an engine: its force over "
                        "the engines' median."};
  return titled;
}

bool has_one(const std::vector<EngineSuccess>& success, std::string EngineSuccess::*field) {
  return std::all_of(success.begin(), success.end(),
                     [&](const EngineSuccess& entry) { return entry.*field == success.front().*field; });
}

std::string joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : ", ").append(word);
  return text;
}

}  // namespace

CombinationLabels combination_labels(const std::vector<EngineSuccess>& success) {
  CombinationLabels labels;
  labels.cells.resize(success.size());
  if (success.empty()) return labels;
  std::vector<std::string> constants;
  const auto add = [&](const char* title, const char* word, std::string EngineSuccess::*field, bool always) {
    if (!always && has_one(success, field)) {
      constants.push_back(fmt::format("{} {}", word, success.front().*field));
      return;
    }
    labels.columns.emplace_back(title);
    for (std::size_t i = 0; i < success.size(); ++i) labels.cells[i].push_back(success[i].*field);
  };
  add("Controller", "controller", &EngineSuccess::controller, false);
  add("Perturbation", "perturbation", &EngineSuccess::perturbation, false);
  add("Policy", "policy", &EngineSuccess::policy, true);
  if (constants.empty()) return labels;
  labels.caption = joined(constants) + ".";
  labels.caption.front() -= 'a' - 'A';
  return labels;
}

std::vector<TitledTable> cross_engine_tables(const CrossEngine& result) {
  if (result.engines.size() < 2) return {};
  const CombinationLabels labels = combination_labels(result.success);
  std::vector<TitledTable> tables = {success_table(result, labels), spread_table(result, labels), rank_table(result)};
  std::set<std::string> drifting;
  for (const MetricDrift& drift : result.drift) drifting.insert(drift.controller);
  for (const std::string& controller : drifting) tables.push_back(drift_table(result, controller));
  if (drifting.empty()) {
    tables.push_back({.title = "Drift of metrics from playback",
                      .caption = "",
                      .table = {},
                      .notes = {"No episode was also run by the engine playback, so there is no drift to show."}});
  }
  const bool several = std::any_of(result.parting.begin(), result.parting.end(), [&](const EngineParting& parting) {
    return parting.controller != result.parting.front().controller;
  });
  tables.push_back(parting_table(result, several));
  tables.push_back(force_table(result));
  return tables;
}

std::string too_few_engines(const CrossEngine& result) {
  return fmt::format(
      "Nothing to compare across engines: these results have {}.",
      result.engines.empty() ? "no physics engine" : "one physics engine, " + result.engines.front().name);
}

std::string markdown_of(const TitledTable& titled) {
  std::string text = "### " + escape_markdown(titled.title) + "\n\n";
  if (!titled.caption.empty()) text += escape_markdown(titled.caption) + "\n\n";
  if (!titled.table.rows.empty()) text += markdown_table(titled.table);
  if (!titled.table.rows.empty() && !titled.notes.empty()) text += "\n";
  for (const std::string& note : titled.notes) text += escape_markdown(note) + "\n";
  return text;
}

std::string latex_of(const TitledTable& titled) {
  std::string text = latex_comment(titled.title);
  if (!titled.caption.empty()) text += latex_comment(titled.caption);
  for (const std::string& note : titled.notes) text += latex_comment(note);
  if (!titled.table.rows.empty()) text += latex_table(titled.table);
  return text;
}

std::string cross_engine_markdown(const CrossEngine& result) {
  const std::vector<TitledTable> tables = cross_engine_tables(result);
  if (tables.empty()) return too_few_engines(result) + "\n";
  std::string text;
  for (const TitledTable& titled : tables) text.append(text.empty() ? "" : "\n").append(markdown_of(titled));
  return text;
}

std::string cross_engine_latex(const CrossEngine& result) {
  const std::vector<TitledTable> tables = cross_engine_tables(result);
  if (tables.empty()) return fmt::format("% {}\n", too_few_engines(result));
  std::string text = "% \\usepackage{booktabs}\n";
  for (const TitledTable& titled : tables) text.append("\n").append(latex_of(titled));
  return text;
}

}  // namespace duet
