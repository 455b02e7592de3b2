// Runs a suite on all cores into a run directory: resumable, with time limits; a stopped run has lost nothing.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/execution/experiment.h"
#include "duet/execution/run_inputs.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/report/ranking/decision.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// The order in which a run works that stops when its policies are told apart: clips in rounds, rounds in looks. It
// depends on the suite's seed and on the part that is asked for, not on threads or on what is in the folder, so that a
// suite stops at the same episode everywhere; each row is the one that the full run has.

struct DecisionSchedule {
  std::vector<std::vector<TaskClip>> rounds;
  std::vector<long> looks;                           // rounds that are over at each look
  std::vector<std::vector<std::uint32_t>> episodes;  // places in the plan, per look
};

// A look comes after so many episodes or more: enough for all cores to work between two of them.
inline constexpr std::size_t kEpisodesPerLook = 60;

// Throws InputError where the part has no episode.
DecisionSchedule decision_schedule(const EpisodePlan& plan, const EpisodeFilter& part, std::uint64_t seed,
                                   std::size_t episodes_per_look = kEpisodesPerLook);

// Rows of the part alone: a folder may hold other engines and perturbations as well.
std::vector<EpisodeRow> rows_of_part(std::vector<EpisodeRow> rows, const EpisodeFilter& part);

// Whether a look needs the episode: policies that are told apart already need none, the null arm runs beside the rest.
bool is_needed(const EpisodeSpec& spec, const Decision& so_far);

// A decision with what it took.
struct DecidedRun {
  Decision decision;
  std::int64_t planned = 0, used = 0;  // episodes of the part, and those up to the look that decided
  [[nodiscard]] std::int64_t saved() const { return planned - used; }
};
// A sentence per pair, then "decided: 126 of 378 episodes were used, 252 runs saved".
std::string decided_run_text(const DecidedRun& run);
nlohmann::json decided_run_json(const DecidedRun& run);  // what decision.json in a run directory says

// Options of a run; as a EpisodeFilter, the part of the suite that is to run.
struct RunOptions : EpisodeFilter {
  int threads = 1;
  double time_limit = 0.0;                                       // of the whole run [s]; 0 = none
  StopToken::Clock::time_point begin = StopToken::Clock::now();  // of the command: where the time limit counts from
  bool retry_errors = false;  // runs episodes again that ended with an error before, as time-outs
  std::vector<std::string> argv;
  DecisionOptions decide;  // where asked: runs only until these policies, and no others, are told apart
  std::size_t episodes_per_look = kEpisodesPerLook;  // of a decision
  nlohmann::json certificate;                        // parity certificate that the run keeps; null: none
  std::string clips_in = {};              // prepared clips are kept there, and stay; "": until the run is whole
  std::function<bool()> stop_asked = {};  // the run then ends resumable, as after an interrupt
  std::map<std::string, PolicyLoader> called = {};  // how policies are made that the caller brings, by name
  std::vector<std::string> replaced = {};           // policies whose rows go where they were another policy then
};

struct RunSummary {
  // Counts over the part that was asked for; planned is 0 where the run was stopped before its clips were ready.
  std::int64_t planned = 0, already_there = 0, run = 0;
  std::map<std::string, std::int64_t> there_of;  // already_there by policy
  std::map<std::string, int> outcomes;           // of those run now
  std::string first_error = {};                  // which episode and what it says; "" where none of them ended so
  // Name -> reason; their episodes are rows with `unsupported`.
  std::map<std::string, std::string> absent_engines, absent_controllers, absent_policies;
  std::vector<std::string> warnings;  // sentences
  std::optional<DecidedRun> decided;  // of the last look; none where no decision was asked for or no look reached
  RunEnd end = RunEnd::kComplete;
};

// Several processes may run one suite into one folder at once: each episode is run by one of them. Throws InputError
// (suite, clips, run directory, a full disk; a decision for a suite of walking commands), MissingError (none of its
// engines, of its policies or, but for playback, of its controllers is there), std::invalid_argument.
RunSummary run_suite(Suite suite, const std::string& directory, const RunOptions& options, Progress& progress);

// The run.json of a new run, but for its plan.
RunInfo new_run_info(const Experiment& experiment, const ArchivedSuite& kept, const std::vector<std::string>& argv,
                     const nlohmann::json& certificate);

}  // namespace duet
