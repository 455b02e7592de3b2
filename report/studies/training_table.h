// One method, several trainings: policies to which the suite gives one tag `method` and different tags `seed` are
// networks of one method that learnt with other seeds. Each training's success, their mean and spread, and every
// method against every other where both trainings and clips are random effects (results/statistics/crossed_effects.h):
// a difference that another seed would turn round is none. The main arm only; nothing depends on the order of rows.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/report/ranking/policy_groups.h"
#include "duet/report/tables/analysis.h"
#include "duet/statistics/crossed_effects.h"
#include "duet/statistics/sequential_test.h"

namespace duet {

struct MethodTrainings {
  PolicyKey key;                               // its policy is the method
  std::vector<std::string> seeds = {};         // by number
  std::vector<Rate> success = {}, falls = {};  // of each, over the episodes that all of them have
  double mean = 0.0;
  double deviation = 0.0;  // of the trainings' success; NaN for one
};

// A minus B over the episodes that all trainings of both have.
struct MethodDifference {
  PolicyKey key;                 // its policy is "dstar vs dp"
  std::string of;                // kEpisodes for all; "recorded", "synthetic"; a task; a perturbation
  long episodes = 0, clips = 0;  // a clip in both of its roles is one
  double success_a = 0.0, success_b = 0.0;
  // Holds the difference alone where a method has one training or all episodes are of one clip; p_holm is NaN, too.
  CrossedDifference crossed = {};
  double p_holm = CrossedDifference::kUnknown;
  PairVerdict verdict = PairVerdict::kUndecided;
};
inline constexpr std::string_view kEpisodes = "all";

struct TrainingTable {
  double level = 0.95, margin = 0.05;
  std::vector<MethodTrainings> methods;       // by engine, controller, method
  std::vector<MethodDifference> differences;  // of all episodes, recorded and synthetic; p_holm over these
  std::vector<MethodDifference> parts;        // of tasks and perturbations; p_holm over these
};

// Throws InputError: rows of two suites or suite versions, an episode that is there twice, two policies that are the
// same training.
TrainingTable training_table(const std::vector<EpisodeRow>& rows, double level = 0.95, double margin = 0.05);

Analysis training_analysis(const TrainingTable& table);

}  // namespace duet
