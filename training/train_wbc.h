// The training of WBC-Sim as a run on disk: stages one after the other, a checkpoint every minute, curves as CSV, and
// the networks in the form in which they ship. Killed at any time, the same call goes on from the last checkpoint.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "duet/controllers/wbc_sim/wbc_sim.h"
#include "duet/training/distill.h"
#include "duet/training/ppo.h"

namespace duet {

// A stage of the training, with what it is given unless the caller says otherwise.
struct WbcStage {
  std::string name;
  long steps = 0;        // of the environment
  std::string task;      // what it trains on (wbc_stage)
  bool follows = false;  // motions are followed in part
  bool distils = false;  // a student learns from the oracle before it; else PPO
};
const std::vector<WbcStage>& wbc_plan();  // stand, walk, brace, interact, student
// Throws std::invalid_argument for an unknown name, with the known ones.
const WbcStage& find_wbc_stage(const std::string& name);

struct WbcRun {
  std::string stage;   // of wbc_plan()
  std::string folder;  // runs/wbc: this stage writes into <folder>/<stage>/
  std::string from;    // checkpoint or oracle's network to begin with; empty: the stage before in `folder`, or new
  long steps = 0;      // 0: the plan's
  std::uint64_t seed = 1;
  int threads = 2;
  int environments = 128;
  std::shared_ptr<const std::vector<RobotMotion>> motions;  // for the stages that follow motions; may be none
};

// Runs of all stages in turn. `run.from` is what the first begins with; each other one has the one before it.
std::vector<WbcRun> wbc_runs(const WbcRun& run);

struct WbcProgress {
  std::string stage;
  long steps = 0, steps_wanted = 0;
  double steps_per_second = 0.0, seconds_left = 0.0;
  double episode_return = 0.0, fall_share = 0.0, episode_seconds = 0.0;  // of the episodes that ended
  double loss = 0.0;                                                     // of the student, mean square of an action
  TrackingStatistics tracking;
};

// Runs one stage to its end or until `stop` says so; true where it is complete. `report` is called about every ten
// seconds of work. Throws std::invalid_argument for an unknown stage and options out of range, InputError for a
// checkpoint that is broken, of another robot or another kind, and for a stage whose predecessor is not there.
bool train_wbc(const std::shared_ptr<const RobotModel>& robot, const WbcRun& run,
               const std::function<void(const WbcProgress&)>& report, const std::function<bool()>& stop);

// Files of <folder>/<stage>: the checkpoint, the network and the curves.
std::string wbc_checkpoint(const std::string& folder, const std::string& stage);
std::string wbc_network_file(const std::string& folder, const std::string& stage);
std::string wbc_curves(const std::string& folder, const std::string& stage);

// The oracle or the student as a network for a robot, learnt with a gait.
WbcNetwork network_of(const RobotModel& robot, const GaitOptions& gait, const TrainingState& state);
WbcNetwork network_of(const RobotModel& robot, const GaitOptions& gait, const StudentState& state);

}  // namespace duet
