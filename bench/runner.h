// Runs a suite on all cores into a run directory: resumable, with time limits; a stopped run has lost nothing.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "bench/episode.h"
#include "bench/progress.h"
#include "bench/rollout.h"
#include "bench/suite.h"
#include "results/run_directory.h"

namespace duet {

struct RunOptions {
  int threads = 1;
  double time_limit = 0.0;                                  // of the whole run [s]; 0 = none
  std::vector<std::string> engines, controllers, policies;  // where not empty: only these
  std::vector<std::string> tasks, perturbations;
  std::vector<std::string> argv;
  nlohmann::json certificate;  // parity certificate that the run keeps; null: none
};

enum class RunEnd { kComplete, kTimeLimit, kInterrupted, kTerminated };

struct RunSummary {
  int planned = 0, already_there = 0, run = 0;
  std::map<std::string, int> outcomes;  // of those run now
  // Name -> reason; their episodes are rows with `unsupported`.
  std::map<std::string, std::string> absent_engines, absent_controllers, absent_policies;
  RunEnd end = RunEnd::kComplete;
};

// Throws InputError (suite, clips, run directory, a full disk), MissingError (none of its engines, of its policies or,
// but for playback, of its controllers is there), std::invalid_argument.
RunSummary run_suite(const Suite& suite, const std::string& directory, const RunOptions& options, Progress& progress);

// The scene with the perturbation's ground and robot; `robot` is the controller's nominal one.
Scene episode_scene(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot);

// One episode, the setup of it, and what it left. Exceptions become rows with outcome `error`. Without `policy` the
// suite's own is loaded for this episode alone.
RolloutSetup episode_setup(const EpisodeSpec& spec, const Suite& suite, const RobotModel& robot);
EpisodeRow run_episode(const EpisodeSpec& spec, const Suite& suite, const std::string& hash,
                       const std::shared_ptr<const RobotModel>& robot, const std::string& trajectory_folder = "",
                       const PolicyMaker& policy = {});

// Thrown by run_episode when the user stopped the run: the episode leaves no row and runs again on resume.
struct EpisodeInterrupted {};

}  // namespace duet
