// A comparison of engines as tables and estimates.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "duet/report/engines/cross_engine.h"

namespace duet {
namespace {

constexpr const char* kAllEngines = "all";

Estimates success_estimates(const std::vector<EngineSuccess>& success) {
  Estimates estimates;
  for (const EngineSuccess& each : success) {
    EstimatesOf of{{.controller = each.controller, .policy = each.policy, .perturbation = each.perturbation},
                   estimates};
    std::vector<EngineRate> rates = each.engines;
    if (each.playback.has_value()) rates.push_back(*each.playback);
    for (const EngineRate& rate : rates) {
      of.keys.engine = rate.engine;
      of.rate("success", {rate.n, rate.k, rate.rate, rate.interval});
    }
    of.keys.engine = kAllEngines;
    of.add("mean_success", each.n, each.mean, each.mean_interval);
    of.add("success_sd", each.n, each.sd);
    of.add("success_range", each.n, each.range);
    of.add("noise_sd", each.n, each.noise_sd);
    of.add("excess_sd", each.n, each.excess_sd);
    of.count("left_out", {}, each.left_out);
  }
  return estimates;
}

std::vector<RowLabel> combination_rows() {
  return {{"Controller", &Estimate::controller},
          {"Perturbation", &Estimate::perturbation},
          {"Policy", &Estimate::policy, true}};
}

TitledTable engine_success_table(const CrossEngine& result, const Estimates& success) {
  Pivot pivot{.title = "Success per engine",
              .rows = combination_rows(),
              .columns = {column("n", {.name = "mean_success"}, as_n)}};
  for (const RunEngine& engine : result.engines)
    pivot.columns.push_back(column(engine.name, {.engine = engine.name, .name = "success"}, as_percent));
  const std::string playback(kPlaybackEngine);
  if (result.has_playback)
    pivot.columns.push_back(column(playback, {.engine = playback, .name = "success"}, as_percent));
  pivot.notes = {
      fmt::format("Success in % of the episodes that all engines of the row ran, with {:g} % Wilson intervals.{}",
                  100.0 * result.level, result.has_playback ? " Playback has no physics and is in no mean." : "")};
  long left_out = 0;
  for (const EngineSuccess& each : result.success) left_out += each.left_out;
  if (left_out > 0)
    pivot.notes.push_back(fmt::format(
        "{} episodes that only some of the engines ran are left out here; the leaderboard counts them.", left_out));
  return table_of(success, pivot);
}

std::string engines_cell(const PivotRow& row) {
  return count_cell(std::ranges::count_if(row.estimates, [](const Estimate* estimate) {
    return estimate->name == "success" && estimate->engine != kPlaybackEngine;
  }));
}

TitledTable spread_table(const Estimates& success, double level) {
  return table_of(
      success,
      {.title = "Spread between engines",
       .rows = combination_rows(),
       .columns = {{"Engines", engines_cell},
                   column("Mean", {.name = "mean_success"}, as_percent),
                   column("SD", {.name = "success_sd"}, as_share),
                   column("Range", {.name = "success_range"}, as_share),
                   column("Noise SD", {.name = "noise_sd"}, as_share),
                   column("Beyond noise", {.name = "excess_sd"}, as_share)},
       .notes = {
           fmt::format(
               "Mean over engines in %, each engine counting the same. Its {:g} % interval is Wilson's over clips, "
               "however many engines run them: it covers which clips were taken, not which engines; those are the "
               "ones at hand.",
               100.0 * level),
           "In points: SD, the sample standard deviation of the engines' rates; range, the highest minus the lowest; "
           "noise "
           "SD, what chance in so many episodes gives if engines do not differ; beyond noise, the SD that is left when "
           "chance is taken off (tau by the method of moments, not below 0). Engines share their episodes, so chance "
           "is "
           "smaller than assumed and what is left errs low."}});
}

std::string tau_cell(const Estimate& tau_b) {
  return std::isfinite(tau_b.value) ? decimals(tau_b.value, 2) : "not defined";
}

std::string limits(const Interval& interval, double scale, int digits) {
  if (!std::isfinite(interval.low)) return "no interval";
  return fmt::format("[{:.{}f}, {:.{}f}]", scale * interval.low + 0.0, digits, scale * interval.high + 0.0, digits);
}

// The mean and the swaps of the items `of`, and how far they can be relied on.
std::vector<std::string> rank_sentences(const CrossEngine& result, const std::string& of) {
  const auto named = [&](const char* name) -> const Estimate& {
    return *find_estimate(result.ranks, {.engine = kAllEngines, .of = of, .name = name});
  };
  if (named("items").value < 2.0) return {fmt::format("Ranks of {}: not defined with fewer than two of them.", of)};
  const Estimate &tau_b = named("mean_tau_b"), &swapped = named("swapped"), &violation = named("rank_violation"),
                 &winner = named("winner_changes");
  const std::string mean = tau_b.n > 0
                               ? fmt::format("mean tau-b {:.2f} over {} pairs of engines", tau_b.value, *tau_b.n)
                               : "tau-b is not defined for any two engines (all tied)";
  std::vector<std::string> sentences = {
      fmt::format("Ranks of {}: {}; {} of {} pairs swap their order between some two engines.", of, mean, swapped.value,
                  *swapped.n)};
  if (std::isfinite(violation.value))
    sentences.push_back(fmt::format(
        "Of {}, with intervals that draw clips again: mean tau-b {} {}; mean maximum rank violation {:.1f} points {}; "
        "{:.2f} of the pairs of engines have no winner in common {}.",
        of, tau_cell(tau_b), limits(tau_b.interval, 1.0, 2), 100.0 * violation.value,
        limits(violation.interval, 100.0, 1), winner.value, limits(winner.interval, 1.0, 2)));
  return sentences;
}

std::string engines_title(const Estimate& keys) {
  std::string engines = keys.engine;
  return engines.replace(engines.find(" vs "), 4, ", ");
}

TitledTable rank_table(const CrossEngine& result) {
  Pivot pivot{
      .title = "Stability of ranks", .rows = {{"Engines", &Estimate::engine, true, engines_title}}, .columns = {}};
  for (const std::string& of : values_of(result.ranks, &Estimate::of)) {
    for (std::string& sentence : rank_sentences(result, of)) pivot.notes.push_back(std::move(sentence));
    if (find_estimate(result.ranks, {.engine = kAllEngines, .of = of, .name = "items"})->value < 2.0) continue;
    pivot.columns.push_back(column("tau-b of " + of, {.of = of, .name = "tau_b"}, tau_cell));
    pivot.columns.push_back(column("Swapped", {.of = of, .name = "swapped"}, [](const Estimate& swapped) {
      return fmt::format("{} of {}", swapped.value, *swapped.n);
    }));
  }
  if (pivot.columns.empty())
    return {.title = pivot.title, .table = {.header = {"Engines"}}, .notes = std::move(pivot.notes)};
  pivot.notes.emplace_back(
      "By success; combinations are of controller and policy. tau-b (Kendall): 1 the same order in both engines, 0 "
      "none in common, -1 the reverse; not defined where all are tied. Swapped: pairs in opposite order in the two "
      "engines.");
  Estimates of_pairs;
  std::ranges::copy_if(result.ranks, std::back_inserter(of_pairs),
                       [](const Estimate& estimate) { return estimate.engine != kAllEngines; });
  return table_of(of_pairs, pivot);
}

std::string drift_cell(const Estimate& drift) {
  return fmt::format("{:+.3g} [{:.3g}, {:.3g}]", drift.value + 0.0, drift.interval.low + 0.0,
                     drift.interval.high + 0.0);
}

std::string unit_cell(const PivotRow& row) { return row.keys().unit.empty() ? "1" : row.keys().unit; }

std::string pairs_cell(const PivotRow& row) {
  const auto [fewest, most] =
      std::ranges::minmax(row.estimates, {}, [](const Estimate* estimate) { return *estimate->n; });
  return *fewest->n == *most->n ? count_cell(*most->n) : fmt::format("{}-{}", *fewest->n, *most->n);
}

// Its mean over the most pairs that an engine has.
std::string playback_cell(const PivotRow& row) {
  const Estimate* most = nullptr;
  for (const Estimate* estimate : row.estimates)
    if (estimate->name == "playback" && (most == nullptr || *estimate->n > *most->n)) most = estimate;
  return significant(most->value);
}

TitledTable drift_table(const CrossEngine& result, const std::string& controller) {
  Pivot pivot{.title = "Drift of metrics from playback",
              .rows = {{"Metric", &Estimate::of, true}},
              .columns = {{"Unit", unit_cell}, {"Pairs", pairs_cell}, {"playback", playback_cell}},
              .notes = {fmt::format("Mean of engine minus playback over the same episodes, with a {:g} % interval that "
                                    "draws clips again. Playback: its own mean.",
                                    100.0 * result.level)}};
  for (const RunEngine& engine : result.engines)
    pivot.columns.push_back(column(engine.name, {.engine = engine.name, .name = "drift"}, drift_cell));
  Estimates drift;
  std::ranges::copy_if(result.drift, std::back_inserter(drift),
                       [&](const Estimate& estimate) { return estimate.controller == controller; });
  TitledTable titled = table_of(drift, pivot);
  titled.caption = fmt::format("Controller {}.", controller);
  titled.table.label_columns = 2;
  for (std::vector<std::string>& cells : titled.table.rows)
    if (const auto metric = std::ranges::find(result.metrics, cells.front(), &MetricColumn::name);
        metric != result.metrics.end() && !metric->title.empty())
      cells.front() = metric->title;
  return titled;
}

std::string reached(const Estimate& time) {
  return std::isfinite(time.value) ? decimals(time.value, 2) : "not reached";
}

TitledTable parting_table(const CrossEngine& result) {
  Pivot pivot{.title = "Time until engines part",
              .rows = {},
              .columns = {column("Episodes", {.name = "parted"}, as_n),
                          column("First quartile [s]", {.name = "parting_lower_quartile"}, reached),
                          column("Median [s]", {.name = "parting_median"}, reached),
                          column("Third quartile [s]", {.name = "parting_upper_quartile"}, reached),
                          column("Never part [%]", {.name = "parted"}, [](const Estimate& parted) {
                            const auto pairs = static_cast<double>(*parted.n);
                            return percent((pairs - parted.value) / pairs);
                          })}};
  if (values_of(result.parting, &Estimate::controller).size() > 1)
    pivot.rows.push_back({"Controller", &Estimate::controller, true});
  pivot.rows.push_back({"Engines", &Estimate::engine, true, engines_title});
  double without_trace = 0.0;
  Estimates compared;  // over an episode or more
  for (const Estimate& estimate : result.parting) {
    if (estimate.name == "without_trace") without_trace += estimate.value;
    if (estimate.n.value_or(0) > 0) compared.push_back(estimate);
  }
  if (compared.empty())
    return {.title = pivot.title, .notes = {"No episode has traces of two engines that can be compared."}};
  pivot.notes = {fmt::format(
      "First time at which a traced point (root, hands) is more than {:g} cm away from where it is in the other engine "
      "in the same episode, or at which the robot falls or diverges in one engine alone. Quartiles by Kaplan and "
      "Meier: an episode that ends before that counts for as long as it lasted.",
      100.0 * result.parting_distance)};
  if (without_trace > 0.0)
    pivot.notes.push_back(fmt::format("{} pairs without comparable traces are left out.", without_trace));
  return table_of(compared, pivot);
}

TitledTable force_table(const CrossEngine& result) {
  const Estimate typical{.engine = kAllEngines, .name = "typical_force"};
  Pivot pivot{.title = "Agreement of contact forces",
              .rows = {{"Force", &Estimate::of, true}},
              .columns = {{"Unit", unit_cell},
                          column("Episodes", typical, as_n),
                          column("Typical", typical, as_significant),
                          column("Spread [%]", {.engine = kAllEngines, .name = "force_spread"}, as_share)}};
  for (const RunEngine& engine : result.engines)
    pivot.columns.push_back(column(engine.name, {.engine = engine.name, .name = "force_ratio"}, as_decimals(3)));
  pivot.notes = {result.forces.empty()
                     ? "No episode has a contact force in two engines."
                     : "Medians over the episodes in which some engine has the force. Typical: the engines' median. "
                       "Spread: highest minus lowest over the mean of the engines. Below an engine: its force over "
                       "the engines' median."};
  TitledTable titled = table_of(result.forces, pivot);
  titled.table.label_columns = 2;
  return titled;
}

std::vector<TitledTable> engine_tables(const CrossEngine& result, const Estimates& success) {
  std::vector<TitledTable> tables = {engine_success_table(result, success), spread_table(success, result.level),
                                     rank_table(result)};
  for (const std::string& controller : values_of(result.drift, &Estimate::controller))
    tables.push_back(drift_table(result, controller));
  if (result.drift.empty())
    tables.push_back({.title = "Drift of metrics from playback",
                      .notes = {"No episode was also run by the engine playback, so there is no drift to show."}});
  tables.push_back(parting_table(result));
  tables.push_back(force_table(result));
  return tables;
}

std::string too_few_engines(const CrossEngine& result) {
  return fmt::format(
      "Nothing to compare across engines: these results have {}.",
      result.engines.empty() ? "no physics engine" : "one physics engine, " + result.engines.front().name);
}

void add_engine_versions(const CrossEngine& result, Estimates& into) {
  for (const RunEngine& engine : result.engines) {
    const EstimatesOf of{{.engine = engine.name}, into};
    of.word("version", engine.version);
    of.word("profile", engine.profile);
  }
}

void add_engine_estimates(const CrossEngine& result, const Estimates& success, Estimates& into) {
  EstimatesOf{{}, into}.add("parting_distance", {}, result.parting_distance, kNoInterval, "m");
  into.insert(into.end(), success.begin(), success.end());
  for (const Estimates* part : {&result.ranks, &result.drift, &result.parting, &result.forces})
    into.insert(into.end(), part->begin(), part->end());
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
    const Estimates success = success_estimates(result.success);
    analysis.tables = engine_tables(result, success);
    add_engine_estimates(result, success, analysis.estimates);
  } else {
    analysis.notes = {too_few_engines(result)};
  }
  if (several || certificate.is_object()) analysis.tables.push_back(certificate_table(certificate, result.engines));
  return analysis;
}

namespace {

constexpr const char* kSchema = "duet.certificate/1";
constexpr const char* kTitle = "Parity certificate";

std::string text_of(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "-";
}

// A number, or how many a list or an object has.
std::string count_of(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) return "-";
  if (found->is_number_integer()) return dumped(*found);
  return found->is_structured() ? fmt::format("{}", found->size()) : "-";
}

std::vector<nlohmann::json> engines_in(const nlohmann::json& certificate) {
  std::vector<nlohmann::json> engines;
  const auto found = certificate.find("engines");
  if (found == certificate.end() || !found->is_array()) return engines;
  std::copy_if(found->begin(), found->end(), std::back_inserter(engines),
               [](const nlohmann::json& engine) { return engine.is_object(); });
  return engines;
}

// Which engines of the results the certificate does not cover as they were run.
std::vector<std::string> coverage_notes(const std::vector<nlohmann::json>& certified,
                                        const std::vector<RunEngine>& engines) {
  std::vector<std::string> missing;
  std::vector<std::string> notes;
  for (const RunEngine& engine : engines) {
    const auto found = std::find_if(certified.begin(), certified.end(),
                                    [&](const nlohmann::json& entry) { return text_of(entry, "name") == engine.name; });
    if (found == certified.end()) {
      missing.push_back(engine.name);
      continue;
    }
    const std::string version = text_of(*found, "version");
    const std::string profile = text_of(*found, "profile");
    const bool same_version = engine.version.empty() || engine.version == version;
    const bool same_profile = engine.profile.empty() || engine.profile == profile;
    if (same_version && same_profile) continue;
    notes.push_back(fmt::format("These results are of {} {} with profile {}, the certificate of {} with profile {}.",
                                engine.name, engine.version, engine.profile, version, profile));
  }
  if (!missing.empty()) notes.push_back(fmt::format("The certificate does not cover {}.", fmt::join(missing, ", ")));
  return notes;
}

}  // namespace

TitledTable certificate_table(const nlohmann::json& certificate, const std::vector<RunEngine>& engines) {
  TitledTable titled{.title = kTitle};
  if (!certificate.is_object()) {
    titled.notes = {certificate.is_null() ? "No parity certificate is attached (duet validate makes one)."
                                          : "The parity certificate attached is no JSON object and is not shown."};
    return titled;
  }
  titled.caption = fmt::format("Effort {}, made {}, digest {:.12}.", text_of(certificate, "effort"),
                               text_of(certificate, "created_at"), text_of(certificate, "digest"));
  titled.table = {.header = {"Engine", "Version", "Profile", "Checks passed", "Asserted deviations", "Failed"},
                  .rows = {},
                  .label_columns = 3};
  const std::vector<nlohmann::json> certified = engines_in(certificate);
  for (const nlohmann::json& engine : certified) {
    titled.table.rows.push_back({text_of(engine, "name"), text_of(engine, "version"), text_of(engine, "profile"),
                                 count_of(engine, "passed"), count_of(engine, "deviations"),
                                 count_of(engine, "failed")});
  }
  titled.notes = {certified.empty() ? "It names no engine."
                                    : "An asserted deviation is a known difference that the suite of scenes expects, "
                                      "with its reason."};
  for (const nlohmann::json& engine : certified)
    if (engine.contains("unsupported"))
      titled.notes.push_back(fmt::format("{} lacks what {} checks need: they are unsupported, and not in the counts.",
                                         text_of(engine, "name"), count_of(engine, "unsupported")));
  if (const std::string schema = text_of(certificate, "schema"); schema != kSchema) {
    titled.notes.push_back(
        fmt::format("Its schema is {}, expected {}: it may say more than is shown.", schema, kSchema));
  }
  for (std::string& note : coverage_notes(certified, engines)) titled.notes.push_back(std::move(note));
  return titled;
}

}  // namespace duet
