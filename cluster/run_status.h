// How far a planned run is (`duet status`), from the journals of its workers; rows are read only of workers that were
// killed. Nothing is locked or written but a file of a moment that tells the time of the file system.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/cluster/shard_plan.h"

namespace duet {

// done: all episodes have rows; running: a worker may be at it; failed: a training that ended with an error; stopped:
// it was begun and nobody is at it, so that a worker has to be started again; waiting: nobody began.
enum class ShardState { kDone, kRunning, kFailed, kStopped, kWaiting };
std::string_view to_string(ShardState state);

struct ShardStatus {
  ShardState state = ShardState::kWaiting;
  std::int64_t number = 0, episodes = 0, done = 0, errors = 0, timeouts = 0;  // done: with a row of any outcome
  std::int64_t attempts = 0, running = 0, crashes = 0;                        // running: attempts that may be at work
  std::vector<std::string> nodes;                                             // of those
};

struct NodeStatus {
  std::int64_t done = 0, errors = 0, running = 0, attempts = 0, lost = 0, crashes = 0;
  double seconds = 0.0;  // of the episodes that are done
};

struct RunStatus {
  ShardPlan::Kind kind = ShardPlan::Kind::kEpisodes;
  std::int64_t episodes = 0, done = 0, errors = 0, timeouts = 0, running = 0;
  double seconds_left = -1.0;  // at the rate so far, by as many workers as are running; below 0: none is
  std::vector<ShardStatus> shards;
  std::map<std::string, NodeStatus> nodes;

  [[nodiscard]] bool is_complete() const { return done == episodes; }
  // Numbers of the shards in a state, as `sbatch --array` takes them: "0-3,7".
  [[nodiscard]] std::string numbers(const std::vector<ShardState>& states) const;
};

// Throws InputError as read_shard_plan and for a journal of something else.
RunStatus run_status(const std::string& run);

std::string status_text(const RunStatus& status);
nlohmann::json status_json(const RunStatus& status);

// "0-3,7" of sorted numbers.
std::string ranges_text(const std::vector<std::int64_t>& numbers);

}  // namespace duet
