// Comparison of physics engines: success, ranks, metrics against kinematic playback, when states part
// and contact forces. From the rows of one arm; "playback" is no physics engine, it is shown apart and is in no mean.
// Nothing depends on the order of rows (docs/reading-the-leaderboard.md, "Across engines").
#pragma once

#include <compare>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/report/tables/analysis.h"
#include "duet/report/tables/estimate.h"
#include "duet/report/tables/text_table.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/row_file.h"
#include "duet/statistics/statistics.h"

namespace duet {

// Options and results of a comparison of engines (report/engines/cross_engine.h).

struct CrossEngineOptions {
  IntervalOptions intervals = {};
  double parting_distance = 0.05;  // two engines have parted where a point of the traces differs by more [m]
  std::string arm = "main";
  RowFile file = {};  // where the traces of lean rows are
};

struct RunEngine {
  std::string name, version, profile;  // of several versions or profiles all, "2.2.2, 2.3.0"
};

struct EngineRate {
  std::string engine;
  long n = 0, k = 0;
  double rate = 0.0;  // NaN where n is 0
  Interval interval;  // Wilson; by clip where a clip has several draws
};

// Success of one (controller, policy, perturbation), over the episodes that all its engines ran.
struct EngineSuccess {
  std::string controller, policy, perturbation;
  long n = 0;                          // those episodes
  long left_out = 0;                   // episodes that only some of its engines ran
  std::vector<EngineRate> engines;     // physics engines that ran it, by name
  std::optional<EngineRate> playback;  // of the same episodes, under the same controller or else the first by name
  double mean = 0.0;                   // over engines, each counts the same
  Interval mean_interval;              // by clip (wilson_by_clip): says nothing of other engines
  double sd = 0.0;                     // sample standard deviation of the rates; NaN for fewer than 2 engines
  double range = 0.0;                  // highest minus lowest rate
  double noise_sd = 0.0;   // that independent binomial episodes would give: sqrt of the mean of p (1 - p) / (n - 1)
  double excess_sd = 0.0;  // tau by moments: sqrt(max(0, sd^2 - noise_sd^2))
};

struct CrossEngine {
  std::vector<RunEngine> engines;  // physics engines by name; fewer than two: nothing below is filled
  bool has_playback = false;
  double level = 0.95;
  double parting_distance = 0.05;
  std::vector<MetricColumn> metrics;   // as asked for
  std::vector<EngineSuccess> success;  // by perturbation, controller, policy
  Estimates ranks;                     // controllers and policies alone where there are several of both
  Estimates drift;                     // by controller, metric as asked for, engine
  Estimates parting;                   // by controller, engines
  Estimates forces;                    // by name
};

// `metrics`: those whose drift is of interest (the 18 of retargeting). Throws InputError: rows of two suites or suite
// versions, an episode that is there twice.
CrossEngine cross_engine(const std::vector<EpisodeRow>& rows, const std::vector<MetricColumn>& metrics,
                         const CrossEngineOptions& options = {});

// Nothing but a note for fewer than two physics engines. The parity certificate (null: none is attached) is its last
// table, of one engine too.
Analysis engine_analysis(const CrossEngine& result, const nlohmann::json& certificate = nullptr);

// Labels of all entries in turn: "Controller" and "Perturbation" as far as they differ, and "Policy".
RowLabels combination_labels(const std::vector<EngineSuccess>& success);

// Unit of a force by the ending of its name: "N", "N s", "s", "N/cm^2", "" for another.
std::string force_unit(std::string_view name);

// Rows by combination, episode and engine, and the parts of a cross-engine comparison: internal to it.

struct Combination {
  std::string perturbation, controller, policy;
  auto operator<=>(const Combination&) const = default;
};

using RowPerEngine = std::map<std::string, const EpisodeRow*>;
using EpisodesOfEngines = std::map<EpisodeId, RowPerEngine>;

class EngineRows {
 public:
  // Throws InputError for an episode that is there twice. Keeps pointers into `rows`.
  EngineRows(const std::vector<EpisodeRow>& rows, const std::string& arm);

  [[nodiscard]] const std::map<Combination, EpisodesOfEngines>& physics() const { return physics_; }
  [[nodiscard]] bool has_playback() const { return !playback_.empty(); }
  // Playback's row of the same episode, policy and perturbation: of this controller, or else of the first by name;
  // null where there is none.
  [[nodiscard]] const EpisodeRow* playback(const Combination& combination, const EpisodeId& id) const;

 private:
  std::map<Combination, EpisodesOfEngines> physics_;
  // By perturbation, policy and episode; then by controller.
  std::map<std::tuple<std::string, std::string, EpisodeId>, std::map<std::string, const EpisodeRow*>> playback_;
};

std::vector<EngineSuccess> engine_success(const EngineRows& rows, const CrossEngineOptions& options);

// Whether engines put items in the same order by success; `of` says which items, an item's success is the mean over all
// that it was run with. For every two engines `tau_b` over the items of both (NaN where they are fewer than 2, or all
// tied in one of the engines) and `swapped`, pairs of items in opposite order, of those that both ran. For "all" the
// number of `items`; `mean_tau_b` over the pairs of engines where it is defined; over those that both ran two items or
// more `rank_violation`, mean_maximum_rank_violation with each engine of a pair as the reference in turn, and
// `winner_changes`, the share without a best item in common; `swapped` between some two engines. Intervals draw clips
// again within their task; NaN where there are none.
Estimates rank_stability(const EngineRows& rows, const std::vector<EngineSuccess>& success,
                         const CrossEngineOptions& options);
// For each item the largest difference of its rate in the reference to that of an item that `other` puts on another
// side of it; the mean over items. Rates of the same items, one or more. Source: SIMPLER, arXiv 2405.05941, section IV.
double mean_maximum_rank_violation(std::span<const double> reference, std::span<const double> other);
// The mean of it with either as the reference.
double rank_violation_of_both(std::span<const double> a, std::span<const double> b);
// 1 where no item that is best in `a` is best in `b`, else 0: items that are tied for the best all win.
double winner_change(std::span<const double> a, std::span<const double> b);

// "bullet vs mujoco"
std::string versus(const std::string& a, const std::string& b);

// `drift`: an engine's value of the metric `of` minus that of playback in the same episode, whatever playback's
// controller, mean over pairs with a bootstrap over clips; `playback`: its own mean over these.
Estimates metric_drift(const EngineRows& rows, const std::vector<MetricColumn>& metrics,
                       const CrossEngineOptions& options);
// When the states of two engines part in the same episode, over the episodes with traces that can be compared (same
// points, same rate): the first frame in which a point differs by more than the distance asked for, or the end by a
// fall or divergence in one of the two alone. Censored at the end of the shorter trace. Quartiles in seconds,
// Kaplan-Meier; NaN: not reached. `without_trace`: episodes of both engines that cannot be compared.
Estimates engine_parting(const EngineRows& rows, const CrossEngineOptions& options);
// One contact force over the engines, per episode of two or more engines that have it; episodes in which no engine has
// any force are left out, and so are names that end with no unit. Medians over episodes: `typical_force`, the engines'
// median; `force_spread`, (max - min) / mean over engines; `force_ratio`, an engine's value over the engines' median.
Estimates force_agreement(const EngineRows& rows);

// Time at which two rows of one episode part, or to which they have not. Null where their traces cannot be compared.
std::optional<Lifetime> time_together(const EpisodeRow& a, const EpisodeRow& b, double distance);

// The parity certificate that `duet validate` writes: which engines passed which scenes.

// Engine, version, profile, checks passed, asserted deviations, failed; with a note for each of the engines of the
// results that it does not cover as it was run. Read tolerantly: what is missing is "-". null: a table without rows
// that says that none is attached.
TitledTable certificate_table(const nlohmann::json& certificate, const std::vector<RunEngine>& engines = {});

}  // namespace duet
