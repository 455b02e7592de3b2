// The cost of perturbations to a policy: success under each beside clean episodes of the same run, paired episode by
// episode, and as curves over the sizes that rows' tags say (core/episode_tags.h), with the supplement's Table S9
// beside them. Every engine alone, playback too; the null arm is left out.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/episode_tags.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/analysis.h"

namespace duet {

struct PerturbedSuccess {
  PolicyKey key;
  std::string perturbation;  // clean first, then by family, size and name
  std::optional<PerturbationSize> size = {};
  Rate success, paper;          // headline; detector paper/paper, n = 0 where no row has it
  PairedDifference difference;  // to the clean episodes; no pairs for clean itself
};

struct CurvePoint {
  double x = 0.0, success = 0.0;
};

// One family in one (engine, controller, arm, policy); clean is the point at 0. Perturbations of one kind that differ
// in other values, too, are families of their own: "push (duration: 1, every: 4)".
struct DegradationCurve {
  PolicyKey key;
  std::string family, unit;
  std::vector<CurvePoint> points;  // by x, at least two
  // Mean of success over the span of x (trapezia) over that of clean: 1 = no loss. NaN where clean never succeeds.
  double normalised_area = 0.0;
  double largest = 0.0;         // the x that is furthest from 0
  PairedDifference difference;  // there, to clean; the paper's: no interval
};

struct Degradation {
  double level = 0.95;
  std::vector<PerturbedSuccess> success;  // empty: no policy ran both clean and perturbed
  std::vector<DegradationCurve> curves;
  std::vector<DegradationCurve> paper;  // Table S9, of the families that occur in `curves`
};

// Throws InputError: rows of two suites or suite versions, an episode that is there twice.
Degradation degradation(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {});

// Tables, and plots per family, engine and controller.
Analysis degradation_analysis(const Degradation& result);

}  // namespace duet
