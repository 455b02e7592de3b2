// Rows by combination, episode and engine, and the parts of a cross-engine comparison: internal to it.
#pragma once

#include <compare>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "duet/core/order_statistics.h"
#include "duet/report/engines/cross_engine_result.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {

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

}  // namespace duet
