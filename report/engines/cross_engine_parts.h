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
std::vector<RankStability> rank_stability(const std::vector<EngineSuccess>& success);
// Sets what rank_stability leaves: violation, change of the winner, all intervals.
void add_rank_reliability(const EngineRows& rows, const CrossEngineOptions& options, std::vector<RankStability>& ranks);
// For each item the largest difference of its rate in the reference to that of an item that `other` puts on another
// side of it; the mean over items. Rates of the same items, one or more. Source: SIMPLER, arXiv 2405.05941, section IV.
double mean_maximum_rank_violation(std::span<const double> reference, std::span<const double> other);
// 1 where no item that is best in `a` is best in `b`, else 0: items that are tied for the best all win.
double winner_change(std::span<const double> a, std::span<const double> b);
std::vector<MetricDrift> metric_drift(const EngineRows& rows, const std::vector<MetricColumn>& metrics,
                                      const CrossEngineOptions& options);
std::vector<EngineParting> engine_parting(const EngineRows& rows, const CrossEngineOptions& options);
std::vector<ForceAgreement> force_agreement(const EngineRows& rows);

// Time at which two rows of one episode part, or to which they have not. Null where their traces cannot be compared.
std::optional<Lifetime> time_together(const EpisodeRow& a, const EpisodeRow& b, double distance);

}  // namespace duet
