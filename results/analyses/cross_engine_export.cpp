// A cross-engine comparison for other programs: CSV with one figure per line, JSON.
#include <fmt/format.h>

#include <cmath>

#include "duet/results/analyses/cross_engine.h"
#include "duet/results/analyses/text_table.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

constexpr std::string_view kNoUnit = "1";

struct Figure {
  std::string table = {}, perturbation = {}, controller = {}, policy = {}, engine = {}, engine_b = {}, name = {};
  std::string unit = std::string(kNoUnit), figure = {};
  long n = 0;
  double value = 0.0;
  std::optional<Interval> interval = std::nullopt;
};

void add(TextTable& table, const Figure& figure) {
  table.rows.push_back({figure.table, figure.perturbation, figure.controller, figure.policy, figure.engine,
                        figure.engine_b, figure.name, figure.unit, figure.figure, fmt::format("{}", figure.n),
                        number_cell(figure.value), figure.interval.has_value() ? number_cell(figure.interval->low) : "",
                        figure.interval.has_value() ? number_cell(figure.interval->high) : ""});
}

void add_success(const EngineSuccess& success, TextTable& table) {
  Figure figure{.table = "success",
                .perturbation = success.perturbation,
                .controller = success.controller,
                .policy = success.policy};
  const auto rate = [&](const EngineRate& of) {
    Figure line = figure;
    line.engine = of.engine;
    line.figure = "rate";
    line.n = of.n;
    line.value = of.rate;
    line.interval = of.interval;
    add(table, line);
  };
  for (const EngineRate& of : success.engines) rate(of);
  if (success.playback.has_value()) rate(*success.playback);
  figure.table = "spread";
  figure.n = success.n;
  const auto spread = [&](const char* name, double value, std::optional<Interval> interval = std::nullopt) {
    figure.figure = name;
    figure.value = value;
    figure.interval = interval;
    add(table, figure);
  };
  spread("mean", success.mean, success.mean_interval);
  spread("sd", success.sd);
  spread("range", success.range);
  spread("noise_sd", success.noise_sd);
  spread("excess_sd", success.excess_sd);
}

void add_ranks(const RankStability& ranks, TextTable& table) {
  for (const EnginePairRanks& pair : ranks.engines) {
    Figure figure{.table = "ranks", .engine = pair.engine_a, .engine_b = pair.engine_b, .name = ranks.of};
    figure.n = pair.items;
    figure.figure = "tau_b";
    figure.value = pair.tau_b;
    add(table, figure);
    figure.n = pair.pairs;
    figure.figure = "swapped";
    figure.value = static_cast<double>(pair.swapped);
    add(table, figure);
  }
  Figure all{.table = "ranks", .name = ranks.of, .figure = "mean_tau_b", .n = ranks.defined};
  all.value = ranks.mean_tau_b;
  all.interval = ranks.tau_interval;
  add(table, all);
  all.figure = "rank_violation";
  all.n = static_cast<long>(ranks.engines.size());
  all.value = ranks.rank_violation;
  all.interval = ranks.violation_interval;
  add(table, all);
  all.figure = "winner_changes";
  all.value = ranks.winner_changes;
  all.interval = ranks.winner_interval;
  add(table, all);
  all.interval.reset();
  all.figure = "swapped";
  all.n = ranks.item_pairs;
  all.value = static_cast<double>(ranks.swapped);
  add(table, all);
}

std::string unit_of(const CrossEngine& result, const std::string& metric) {
  for (const MetricColumn& column : result.metrics) {
    if (column.name == metric) return column.unit;
  }
  return "";
}

void add_drift(const CrossEngine& result, TextTable& table) {
  for (const MetricDrift& drift : result.drift) {
    Figure figure{.table = "drift",
                  .controller = drift.controller,
                  .engine = drift.engine,
                  .name = drift.metric,
                  .unit = unit_of(result, drift.metric),
                  .figure = "playback",
                  .n = drift.pairs,
                  .value = drift.playback};
    add(table, figure);
    figure.figure = "difference";
    figure.value = drift.mean;
    figure.interval = drift.interval;
    add(table, figure);
  }
}

void add_parting(const EngineParting& parting, TextTable& table) {
  Figure figure{.table = "parting",
                .controller = parting.controller,
                .engine = parting.engine_a,
                .engine_b = parting.engine_b,
                .unit = "s",
                .n = parting.pairs};
  const auto line = [&](const char* name, double value) {
    figure.figure = name;
    figure.value = value;
    add(table, figure);
  };
  line("lower_quartile", parting.lower_quartile);
  line("median", parting.median);
  line("upper_quartile", parting.upper_quartile);
  figure.unit = kNoUnit;
  line("parted", static_cast<double>(parting.parted));
}

void add_force(const ForceAgreement& force, TextTable& table) {
  Figure figure{.table = "forces",
                .name = force.name,
                .unit = force.unit,
                .figure = "typical",
                .n = force.episodes,
                .value = force.typical};
  add(table, figure);
  figure.unit = kNoUnit;
  figure.figure = "spread";
  figure.value = force.spread;
  add(table, figure);
  figure.figure = "ratio";
  for (const auto& [engine, ratio] : force.ratio) {
    figure.engine = engine;
    figure.value = ratio;
    add(table, figure);
  }
}

using Json = nlohmann::json;

Json json_of(const RunEngine& engine) {
  return {{"name", engine.name}, {"version", engine.version}, {"profile", engine.profile}};
}

Json json_of(const EngineRate& rate) {
  return {{"engine", rate.engine},
          {"n", rate.n},
          {"k", rate.k},
          {"rate", number_or_null(rate.rate)},
          {"interval", json_of(rate.interval)}};
}

Json json_of(const EnginePairRanks& pair) {
  return {{"engines", {pair.engine_a, pair.engine_b}},
          {"items", pair.items},
          {"pairs", pair.pairs},
          {"swapped", pair.swapped},
          {"tau_b", number_or_null(pair.tau_b)}};
}

Json json_of(const MetricDrift& drift) {
  return {{"controller", drift.controller},
          {"engine", drift.engine},
          {"metric", drift.metric},
          {"pairs", drift.pairs},
          {"playback", number_or_null(drift.playback)},
          {"difference", number_or_null(drift.mean)},
          {"interval", json_of(drift.interval)}};
}

Json json_of(const EngineParting& parting) {
  return {{"controller", parting.controller},
          {"engines", {parting.engine_a, parting.engine_b}},
          {"pairs", parting.pairs},
          {"parted", parting.parted},
          {"without_trace", parting.without_trace},
          {"lower_quartile", number_or_null(parting.lower_quartile)},
          {"median", number_or_null(parting.median)},
          {"upper_quartile", number_or_null(parting.upper_quartile)}};
}

Json json_of(const ForceAgreement& force) {
  return {{"name", force.name},
          {"unit", force.unit},
          {"episodes", force.episodes},
          {"typical", number_or_null(force.typical)},
          {"spread", number_or_null(force.spread)},
          {"ratio", force.ratio}};
}

Json json_of(const EngineSuccess& success);
Json json_of(const RankStability& ranks);

template <typename T>
Json list_of(const std::vector<T>& items) {
  Json list = Json::array();
  for (const T& item : items) list.push_back(json_of(item));
  return list;
}

Json json_of(const EngineSuccess& success) {
  return {{"controller", success.controller},
          {"policy", success.policy},
          {"perturbation", success.perturbation},
          {"n", success.n},
          {"left_out", success.left_out},
          {"engines", list_of(success.engines)},
          {"playback", success.playback.has_value() ? json_of(*success.playback) : Json(nullptr)},
          {"mean", number_or_null(success.mean)},
          {"mean_interval", json_of(success.mean_interval)},
          {"sd", number_or_null(success.sd)},
          {"range", number_or_null(success.range)},
          {"noise_sd", number_or_null(success.noise_sd)},
          {"excess_sd", number_or_null(success.excess_sd)}};
}

Json json_of(const RankStability& ranks) {
  return {{"of", ranks.of},
          {"items", ranks.items},
          {"engines", list_of(ranks.engines)},
          {"mean_tau_b", number_or_null(ranks.mean_tau_b)},
          {"tau_interval", json_of(ranks.tau_interval)},
          {"rank_violation", number_or_null(ranks.rank_violation)},
          {"violation_interval", json_of(ranks.violation_interval)},
          {"winner_changes", number_or_null(ranks.winner_changes)},
          {"winner_interval", json_of(ranks.winner_interval)},
          {"defined", ranks.defined},
          {"item_pairs", ranks.item_pairs},
          {"swapped", ranks.swapped}};
}

}  // namespace

std::string cross_engine_csv(const CrossEngine& result) {
  TextTable table;
  table.header = {"table", "perturbation", "controller", "policy", "engine", "engine_b", "name",
                  "unit",  "figure",       "n",          "value",  "ci_low", "ci_high"};
  for (const EngineSuccess& success : result.success) add_success(success, table);
  for (const RankStability& ranks : result.ranks) add_ranks(ranks, table);
  add_drift(result, table);
  for (const EngineParting& parting : result.parting) add_parting(parting, table);
  for (const ForceAgreement& force : result.forces) add_force(force, table);
  return csv_table(table);
}

nlohmann::json cross_engine_json(const CrossEngine& result) {
  return {{"schema", "duet.cross_engine/1"},
          {"engines", list_of(result.engines)},
          {"level", result.level},
          {"parting_distance", result.parting_distance},
          {"success", list_of(result.success)},
          {"ranks", list_of(result.ranks)},
          {"drift", list_of(result.drift)},
          {"parting", list_of(result.parting)},
          {"forces", list_of(result.forces)}};
}

}  // namespace duet
