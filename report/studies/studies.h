// The studies of a run: each is a function from rows to an analysis, and nothing of it depends on the order of rows.
// All throw InputError for rows of two suites or suite versions and, where they pair episodes or count them by arm, for
// an episode that is there twice.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/ratings.h"

namespace duet {

// The controller's effect on a reference and how well it follows it, per controller and engine: the figures of the
// supplement's Table S4 (A.4.6) before and after the controller, survival and faults. From the rows of the main arm in
// physics engines; playback has no controller and is left out.
Analysis controller_analysis(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {});

// The cost of perturbations to a policy: success under each beside clean episodes of the same run, paired episode by
// episode, and as curves over the sizes that rows' tags say (core/task.h), with the supplement's Table S9
// beside them. Perturbations of one kind that differ in other values, too, are families of their own: "push (duration:
// 1, every: 4)". Every engine alone, playback too; the null arm is left out.
Analysis degradation_analysis(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {});

// Whether a robot acts when and where its partner does. When: the shift of the robot's onset against that of its
// partner's, each episode of a run whose perturbations move the partner in time beside its clean one. Where: success
// by the hand and height that the partner offers (Table S10). Every engine alone, playback too; the null arm is left
// out.
Analysis reactivity_analysis(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {});

// The rule `interaction` (docs/detectors.md) as a run's rows hold it: success of every arm by task beside the detectors
// `robot` with the paper's thresholds, false starts, and for each condition of the rule how many episodes failed it.
// Clean episodes of every engine, the null arm too.
Analysis interaction_analysis(const std::vector<EpisodeRow>& rows, double level = 0.95);

// A robot that begins by more than this before its partner has made a false start. [s]
inline constexpr double kFalseStart = 0.3;
// By how much the robot begins before its partner, withdrawn beginnings included [s]: by the verdict of the rule where
// the row has it, else by `onset_s` and `partner_onset_s`. Nothing where one of the two never begins, or where nobody
// has to wait.
std::optional<double> lead_of(const EpisodeRow& row);

// How far a policy or a controller comes on a ladder of difficulty: success at each level, from rows whose suite gives
// their perturbation or clip the tag `level` or `stage`, and with `level_name` or `stage_name` a name. A row is of the
// higher of the two; a clean one whose clip has no level is of level 0. A command to walk forward is passed at half of
// its speed or more. The null arm is left out. A table for each ladder that has two levels or more. Throws InputError
// also for two names of one level.
Analysis level_analysis(const std::vector<EpisodeRow>& rows, double level = 0.95);

// How far each controller comes on a ladder of commands, in each engine and under each actuation, best first, and where
// it fails first: from rows whose suite gives their clip or perturbation the tags `rung` and `rung_name` (the
// perturbation's counts where both have them); the perturbation's tag `actuation` tells actuations apart. A rung is
// passed where the lower end of the interval of its episodes is .7 or more; its episodes are draws of the suite's
// noise, poses and pushes. An episode passes as in level_analysis and, where its clip has the tag `arms: followed`,
// with the upper body within .12 rad of its reference on average. Beside it, where three networks or more are in a
// public benchmark, too: Kendall's tau-b of the two orders; and where three controllers or more that are not saturated
// ran in all engines of the rows: tau-b and rank violation between engines.
Analysis arena_analysis(const std::vector<EpisodeRow>& rows, double level = 0.95);

// Recorded and synthetic people side by side, as rows' tags say: what each policy achieves with the one and with the
// other, over the tasks that both kinds have. Clean episodes only; the null arm has lines of its own.
Analysis people_analysis(const std::vector<EpisodeRow>& rows, double level = 0.95);

// One method, several trainings: policies to which the suite gives one tag `method` and different tags `seed` are
// networks of one method that learnt with other seeds. Each training's success, their mean and spread, and every
// method against every other where both trainings and clips are random effects (statistics/clustered.h): a
// difference that another seed would turn round is none. The main arm only. Throws InputError also for two policies
// that are the same training.
Analysis training_analysis(const std::vector<EpisodeRow>& rows, double level = 0.95, double margin = 0.05);

// Whether robots walk by command, how fast, and whether they fall: from rows of the task "walk", per perturbation,
// controller, command (slow before fast) and engine.
Analysis walk_analysis(const std::vector<EpisodeRow>& rows, double level = 0.95);

// People against detectors: how far raters agree with one another on episodes of a run, and how far each detector
// agrees with them (supplement C.3.2). An episode that fell or met an error is no success of any detector, as
// everywhere. Of detectors the episodes count that people answered by yes or no, not unsure or without majority.
struct HumanAgreement {
  Analysis analysis;
  long episodes = 0;        // that anybody answered
  long yes = 0, no = 0;     // of them, by more than half of those who answered; others have no majority
  nlohmann::json disputes;  // not answered alike by all who answered: key, task, clip, the answer of each rater
};
// Intervals of kappas by resampling clips. `rows` hold every episode that was rated. Throws std::invalid_argument
// without a rater.
HumanAgreement human_agreement(const std::vector<EpisodeRow>& rows, const std::vector<Rater>& raters,
                               const IntervalOptions& options = {});

}  // namespace duet
