// Runs a suite on all cores into a run directory: resumable, with time limits; a stopped run has lost nothing.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/execution/decided_run.h"
#include "duet/execution/experiment.h"
#include "duet/execution/run_inputs.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/work/progress.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_sign.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// Options of a run; as a RunPart, the part of the suite that is to run.
struct RunOptions : RunPart {
  int threads = 1;
  double time_limit = 0.0;                                     // of the whole run [s]; 0 = none
  StopSign::Clock::time_point begin = StopSign::Clock::now();  // of the command: where the time limit counts from
  bool retry_errors = false;  // runs episodes again that ended with an error before, as time-outs
  std::vector<std::string> argv;
  DecisionOptions decide;  // where asked: runs only until these policies, and no others, are told apart
  std::size_t episodes_per_look = kEpisodesPerLook;  // of a decision
  nlohmann::json certificate;                        // parity certificate that the run keeps; null: none
  std::function<bool()> stop_asked = {};             // the run then ends resumable, as after an interrupt
  std::map<std::string, PolicyLoader> called = {};   // how policies are made that the caller brings, by name
  std::vector<std::string> replaced = {};            // policies whose rows go where they were another policy then
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
RunInfo new_run_info(const Experiment& experiment, const KeptSuite& kept, const std::vector<std::string>& argv,
                     const nlohmann::json& certificate);

}  // namespace duet
