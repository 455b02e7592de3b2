// A comparison of engines as tables and figures.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "duet/report/engines/certificate_table.h"
#include "duet/report/engines/cross_engine.h"
#include "duet/report/tables/cells.h"

namespace duet {
namespace {

std::string engine_rate_cell(const EngineRate* rate) {
  return rate != nullptr ? percent(rate->rate, rate->interval) : "-";
}

const EngineRate* find(const std::vector<EngineRate>& rates, const std::string& engine) {
  const auto found =
      std::find_if(rates.begin(), rates.end(), [&](const EngineRate& rate) { return rate.engine == engine; });
  return found != rates.end() ? &*found : nullptr;
}

std::string left_out_note(const std::vector<EngineSuccess>& success) {
  long left_out = 0;
  for (const EngineSuccess& entry : success) left_out += entry.left_out;
  if (left_out == 0) return "";
  return fmt::format("{} episodes that only some of the engines ran are left out here; the leaderboard counts them.",
                     left_out);
}

TitledTable engine_success_table(const CrossEngine& result, const RowLabels& labels) {
  TitledTable titled = labelled_table("Success per engine", labels);
  add_column("n", titled, [&](std::size_t i) { return count_cell(result.success[i].n); });
  for (const RunEngine& engine : result.engines)
    add_column(engine.name, titled,
               [&](std::size_t i) { return engine_rate_cell(find(result.success[i].engines, engine.name)); });
  if (result.has_playback)
    add_column(std::string(kPlaybackEngine), titled, [&](std::size_t i) {
      const std::optional<EngineRate>& playback = result.success[i].playback;
      return engine_rate_cell(playback.has_value() ? &*playback : nullptr);
    });
  titled.notes = {
      fmt::format("Success in % of the episodes that all engines of the row ran, with {:g} % Wilson "
                  "intervals.{}",
                  100.0 * result.level, result.has_playback ? " Playback has no physics and is in no mean." : "")};
  if (std::string note = left_out_note(result.success); !note.empty()) titled.notes.push_back(std::move(note));
  return titled;
}

TitledTable spread_table(const CrossEngine& result, const RowLabels& labels) {
  TitledTable titled = labelled_table("Spread between engines", labels);
  const auto add = [&](const char* title, const auto& cell) {
    add_column(title, titled, [&](std::size_t i) { return cell(result.success[i]); });
  };
  add("Engines", [](const EngineSuccess& of) { return count_cell(static_cast<long>(of.engines.size())); });
  add("Mean", [](const EngineSuccess& of) { return percent(of.mean, of.mean_interval); });
  add("SD", [](const EngineSuccess& of) { return percent(of.sd); });
  add("Range", [](const EngineSuccess& of) { return percent(of.range); });
  add("Noise SD", [](const EngineSuccess& of) { return percent(of.noise_sd); });
  add("Beyond noise", [](const EngineSuccess& of) { return percent(of.excess_sd); });
  titled.notes = {
      fmt::format("Mean over engines in %, each engine counting the same. Its {:g} % interval is Wilson's over clips, "
                  "however many engines run them: it covers which clips were taken, not which engines; those are the "
                  "ones at hand.",
                  100.0 * result.level),
      "In points: SD, the sample standard deviation of the engines' rates; range, the highest minus the lowest; noise "
      "SD, what chance in so many episodes gives if engines do not differ; beyond noise, the SD that is left when "
      "chance is taken off (tau by the method of moments, not below 0). Engines share their episodes, so chance is "
      "smaller than assumed and what is left errs low."};
  return titled;
}

std::string tau_cell(double tau_b) { return std::isfinite(tau_b) ? decimals(tau_b, 2) : "not defined"; }

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
      "{:.2f} of the "
      "pairs of engines have no winner in common {}.",
      ranks.of, tau_cell(ranks.mean_tau_b), limits(ranks.tau_interval, 1.0, 2), 100.0 * ranks.rank_violation,
      limits(ranks.violation_interval, 100.0, 1), ranks.winner_changes, limits(ranks.winner_interval, 1.0, 2));
}

TitledTable rank_table(const CrossEngine& result) {
  TitledTable titled{
      .title = "Stability of ranks", .caption = "", .table = {.header = {"Engines"}, .rows = {}, .label_columns = 1}};
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
      fewest == most ? count_cell(most) : fmt::format("{}-{}", fewest, most), significant(playback)};
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

std::string reached(double time) { return std::isfinite(time) ? decimals(time, 2) : "not reached"; }

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
    cells.push_back(count_cell(parting.pairs));
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
      .table = {.header = {"Force", "Unit", "Episodes", "Typical", "Spread [%]"}, .rows = {}, .label_columns = 2}};
  for (const RunEngine& engine : result.engines) titled.table.header.push_back(engine.name);
  for (const ForceAgreement& force : result.forces) {
    std::vector<std::string> cells = {force.name, force.unit, count_cell(force.episodes), significant(force.typical),
                                      percent(force.spread)};
    for (const RunEngine& engine : result.engines) {
      const auto found = force.ratio.find(engine.name);
      cells.push_back(found != force.ratio.end() ? decimals(found->second, 3) : "-");
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

std::vector<TitledTable> engine_tables(const CrossEngine& result) {
  const RowLabels labels = combination_labels(result.success);
  std::vector<TitledTable> tables = {engine_success_table(result, labels), spread_table(result, labels),
                                     rank_table(result)};
  std::set<std::string> drifting;
  for (const MetricDrift& drift : result.drift) drifting.insert(drift.controller);
  for (const std::string& controller : drifting) tables.push_back(drift_table(result, controller));
  if (drifting.empty())
    tables.push_back({.title = "Drift of metrics from playback",
                      .notes = {"No episode was also run by the engine playback, so there is no drift to show."}});
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

std::string versus(const std::string& a, const std::string& b) { return fmt::format("{} vs {}", a, b); }

void add_engine_success(const EngineSuccess& success, std::vector<Estimate>& into) {
  EstimatesOf figures{
      {.controller = success.controller, .policy = success.policy, .perturbation = success.perturbation}, into};
  std::vector<EngineRate> rates = success.engines;
  if (success.playback.has_value()) rates.push_back(*success.playback);
  for (const EngineRate& of : rates) {
    figures.keys.engine = of.engine;
    figures.rate("success", {of.n, of.k, of.rate, of.interval});
  }
  figures.keys.engine = "all";
  figures.add("mean_success", success.n, success.mean, success.mean_interval);
  figures.add("success_sd", success.n, success.sd);
  figures.add("success_range", success.n, success.range);
  figures.add("noise_sd", success.n, success.noise_sd);
  figures.add("excess_sd", success.n, success.excess_sd);
  figures.count("left_out", {}, success.left_out);
}

void add_rank_figures(const RankStability& ranks, std::vector<Estimate>& into) {
  EstimatesOf figures{{.of = ranks.of}, into};
  for (const EnginePairRanks& pair : ranks.engines) {
    figures.keys.engine = versus(pair.engine_a, pair.engine_b);
    figures.add("tau_b", pair.items, pair.tau_b);
    figures.count("swapped", pair.pairs, pair.swapped);
  }
  const auto pairs = static_cast<long>(ranks.engines.size());
  figures.keys.engine = "all";
  figures.count("items", {}, ranks.items);
  figures.add("mean_tau_b", ranks.defined, ranks.mean_tau_b, ranks.tau_interval);
  figures.add("rank_violation", pairs, ranks.rank_violation, ranks.violation_interval);
  figures.add("winner_changes", pairs, ranks.winner_changes, ranks.winner_interval);
  figures.count("swapped", ranks.item_pairs, ranks.swapped);
}

void add_drift_figures(const CrossEngine& result, const MetricDrift& drift, std::vector<Estimate>& into) {
  const auto metric = std::ranges::find(result.metrics, drift.metric, &MetricColumn::name);
  const std::string unit = metric == result.metrics.end() ? "" : metric->unit;
  const EstimatesOf figures{{.engine = drift.engine, .controller = drift.controller, .of = drift.metric}, into};
  figures.add("playback", drift.pairs, drift.playback, kNoInterval, unit);
  figures.add("drift", drift.pairs, drift.mean, drift.interval, unit);
}

void add_parting_figures(const EngineParting& parting, std::vector<Estimate>& into) {
  const EstimatesOf figures{{.engine = versus(parting.engine_a, parting.engine_b), .controller = parting.controller},
                            into};
  figures.add("parting_lower_quartile", parting.pairs, parting.lower_quartile, kNoInterval, "s");
  figures.add("parting_median", parting.pairs, parting.median, kNoInterval, "s");
  figures.add("parting_upper_quartile", parting.pairs, parting.upper_quartile, kNoInterval, "s");
  figures.count("parted", parting.pairs, parting.parted);
  figures.count("without_trace", {}, parting.without_trace);
}

void add_force_figures(const ForceAgreement& force, std::vector<Estimate>& into) {
  EstimatesOf figures{{.engine = "all", .of = force.name}, into};
  figures.add("typical_force", force.episodes, force.typical, kNoInterval, force.unit);
  figures.add("force_spread", force.episodes, force.spread);
  for (const auto& [engine, ratio] : force.ratio) {
    figures.keys.engine = engine;
    figures.add("force_ratio", force.episodes, ratio);
  }
}

void add_engine_versions(const CrossEngine& result, std::vector<Estimate>& into) {
  for (const RunEngine& engine : result.engines) {
    const EstimatesOf figures{{.engine = engine.name}, into};
    figures.word("version", engine.version);
    figures.word("profile", engine.profile);
  }
}

void add_engine_figures(const CrossEngine& result, std::vector<Estimate>& into) {
  EstimatesOf{{}, into}.add("parting_distance", {}, result.parting_distance, kNoInterval, "m");
  for (const EngineSuccess& success : result.success) add_engine_success(success, into);
  for (const RankStability& ranks : result.ranks) add_rank_figures(ranks, into);
  for (const MetricDrift& drift : result.drift) add_drift_figures(result, drift, into);
  for (const EngineParting& parting : result.parting) add_parting_figures(parting, into);
  for (const ForceAgreement& force : result.forces) add_force_figures(force, into);
}

}  // namespace

RowLabels combination_labels(const std::vector<EngineSuccess>& success) {
  return row_labels({label_column("Controller", success, &EngineSuccess::controller),
                     label_column("Perturbation", success, &EngineSuccess::perturbation),
                     label_column("Policy", success, &EngineSuccess::policy, true)});
}

Analysis engine_analysis(const CrossEngine& result, const nlohmann::json& certificate) {
  Analysis analysis{.name = "engines", .title = "Across engines", .level = result.level};
  const bool several = result.engines.size() > 1;
  if (several || certificate.is_object()) add_engine_versions(result, analysis.estimates);
  if (several) {
    analysis.tables = engine_tables(result);
    add_engine_figures(result, analysis.estimates);
  } else {
    analysis.notes = {too_few_engines(result)};
  }
  if (several || certificate.is_object()) analysis.tables.push_back(certificate_table(certificate, result.engines));
  return analysis;
}

}  // namespace duet
