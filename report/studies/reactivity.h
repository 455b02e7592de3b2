// Whether a robot acts when and where its partner does. When: the shift of the robot's onset against that of its
// partner's, each episode of a run whose perturbations move the partner in time beside its clean one. Where: success
// by the hand and height that the partner offers (Table S10). Every engine alone, playback too; the null arm is left
// out.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/analysis.h"

namespace duet {

inline constexpr double kPartnerShift = 0.1;  // from here on the partner's onset counts as moved [s]

// Means over the episodes of one perturbation in which the partner's onset moved.
struct OnsetShift {
  std::string perturbation;
  long n = 0;
  double partner = 0.0, robot = 0.0;  // [s], later is positive
};

struct Reactivity {
  PolicyKey key;
  std::string task;    // "all" or one
  long n = 0;          // episodes with a moved partner in which both onsets are known, perturbed and clean
  long without = 0;    // with a moved partner in which the robot's is not: it did not act
  double slope = 0.0;  // of robot's over partner's shift, through the origin: 1 follows, 0 plays its clip. NaN: n = 0
  Interval interval;   // bootstrap over clips; NaN for fewer than two
  // The same with the least absolute deviations: what most episodes do. An arm that swings with the steps can pass for
  // an onset, in a few episodes, and pulls the squares.
  double median_slope = 0.0;
  Interval median_interval;
  double delay_clean = 0.0, delay_moved = 0.0;  // median of robot's minus partner's onset [s]; NaN: none
  long n_clean = 0;                             // clean episodes with both onsets
  long led = 0, false_starts = 0;               // as in InteractionEntry, clean and perturbed
  std::vector<OnsetShift> shifts;               // by partner's shift
};

// Success by the clip's variant, clean.
struct SpatialCells {
  PolicyKey key;
  std::string task;
  std::array<Rate, 4> cells;  // as in kSpatialCells
};
struct SpatialCell {
  std::string_view variant, title;
  double paper;  // Table S10, handshake
};
// In the order (high, low) by (left, right).
inline constexpr std::array<SpatialCell, 4> kSpatialCells = {{{"left_high", "Left, high", 0.8},
                                                              {"right_high", "Right, high", 1.0},
                                                              {"left_low", "Left, low", 0.4},
                                                              {"right_low", "Right, low", 0.6}}};

// The two heights at which clips offer hands. [m]
struct OfferedHeights {
  double low = 0.0, high = 0.0;
};

struct ReactivityTable {
  double level = 0.95;
  // For each policy all tasks and, where there are several, each. Empty: no perturbation moved a partner's onset.
  std::vector<Reactivity> timing;
  std::vector<SpatialCells> spatial;  // empty: the rows' tags name no two heights and hands
  OfferedHeights heights = {};        // of `spatial`

  [[nodiscard]] bool empty() const { return timing.empty() && spatial.empty(); }
};

// Throws InputError: rows of two suites or suite versions, an episode that is there twice.
ReactivityTable reactivity_table(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {});

// Tables, and plots per engine and controller as Figure S4.
Analysis reactivity_analysis(const ReactivityTable& table);

}  // namespace duet
