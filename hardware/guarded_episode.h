// An episode of a suite over a robot behind its guard, and what came of many of them beside the same episodes in the
// simulator: success with intervals and a paired test.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "duet/execution/experiment.h"
#include "duet/experiment/plan/episode.h"
#include "duet/hardware/guarded_world.h"
#include "duet/hardware/log_recording.h"
#include "duet/hardware/robot_config.h"
#include "duet/statistics/statistics.h"

namespace duet {

struct GuardedOptions {
  RobotConfig config;
  double steps_from = 0.0;  // of the walking controller [m/s]
  std::string engine;       // that stands in the row: "twin"
  std::string recording;    // path of the recording to make (NPZ); empty: none
  std::function<void(const GuardReport&)> watch = {};
  std::function<bool()> stop_asked = {};
};

struct GuardedRun {
  EpisodeRow row;
  ExecutedMask executed;
  ClampCounts clamps{};
  int held_ticks = 0;        // in which the guard held
  int missed_reports = 0;    // of the guard, that were lost on their way
  double guard_seconds = 0;  // of the episode, by the guard's clock [s]
  bool interrupted = false;  // by stop_asked: the row is no result
};

// The episode through `link`, scored as the suite scores. Whatever ends it is an outcome; a guard that does not run is
// `error` with what it is at. Throws StorageError where the recording cannot be written.
GuardedRun run_guarded_episode(const Experiment& experiment, const EpisodeSpec& spec, GuardLink& link,
                               const GuardedOptions& options);

// The same episodes in two worlds, one row each.
struct PairedEpisodes {
  std::vector<EpisodeRow> simulated, guarded;
};

struct PairedSuccess {
  long n = 0, simulated = 0, guarded = 0;
  long both = 0, only_simulated = 0, only_guarded = 0, neither = 0;
  Interval simulated_95, guarded_95;  // Wilson
  Interval difference_95;             // guarded - simulated, Newcombe, paired
  long clips = 0;
  double p = 1.0;       // sign_flip_exact by clip, as on the board
  bool inside = false;  // the guarded share lies in the simulator's interval
};
// Throws std::invalid_argument for lists of different lengths.
PairedSuccess paired_success(const PairedEpisodes& episodes);
std::string paired_text(const PairedSuccess& success, const std::string& simulated, const std::string& guarded);
nlohmann::json paired_json(const PairedSuccess& success);

// A suite of one clip for a robot: `policy` leads from `start` ("act", "approach", ...). Throws as parse_suite.
Suite suite_of_clip(const std::string& clip, const std::string& policy, const std::string& start,
                    const std::string& controller);

}  // namespace duet
