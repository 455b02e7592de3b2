// plan.json of a run that many machines work on: what every worker must agree with, and the shards that they count by.
// An episode's place is its index in the suite's order (experiment/plan/episode.h); a shard is a range of places of one
// engine, cut between clips, so that all policies of a clip are together. Paths in it start at the run directory.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "duet/training/setup/train_options.h"

namespace duet {

// Digests of what runs: "duet", and each engine's module by its name; "" for one that is absent.
using ProgramDigests = std::map<std::string, std::string>;

// A shard that is a training, in the folder trainings/ARM-SEED of the run.
struct PlannedTraining {
  std::string train, arm;  // train: one of training_names()
  std::uint64_t seed = 0;
  TrainingOptions options;

  [[nodiscard]] std::string name() const { return arm + "-" + std::to_string(seed); }
};

struct Shard {
  std::string name;                 // the engine of its episodes, or that of the training
  std::int64_t begin = 0, end = 0;  // places, the last one not in it; of a training one place
  double cost = 0.0;                // predicted, of one core [s]
  std::string keys;                 // SHA-256 of the episodes' keys in their order; of a training empty
  PlannedTraining training;         // of episodes empty

  [[nodiscard]] std::int64_t episodes() const { return end - begin; }
};

struct PlannedClip {
  std::string task, id, file, sha256;  // file: from the run directory
};

struct ShardPlan {
  enum class Kind { kEpisodes, kTrainings };
  Kind kind = Kind::kEpisodes;
  ProgramDigests program;
  std::string suite_hash;  // of trainings empty
  std::int64_t episodes = 0;
  std::vector<PlannedClip> clips;       // in the order of the suite; none for walking commands
  std::map<std::string, double> costs;  // "mujoco/vmc" -> of one core, per second of motion [s/s]
  std::vector<Shard> shards;
};

// The cost of a clip in one engine, with all policies and episodes, at the places that it takes.
struct PlanBlock {
  std::string engine;
  std::int64_t begin = 0, end = 0;
  double cost = 0.0;  // [s]
};

inline constexpr double kShardSeconds = 240.0;  // predicted cost of a shard of its own choice: 2 to 10 minutes are good

// Shards of equal predicted cost from blocks in the order of their places. `count` 0: as many as give kShardSeconds,
// each engine one at least. Throws std::invalid_argument for fewer than there are engines or more than there are
// blocks.
std::vector<Shard> cut_shards(const std::vector<PlanBlock>& blocks, std::int64_t count);

// Whether an arm of trainings may be called so: letters, digits, '_' and '.', none of them first a '.'.
bool is_arm_name(const std::string& name);

// Whether the folder is a run that was planned.
bool has_shard_plan(const std::string& run);
std::string plan_file(const std::string& run);  // its path
void write_shard_plan(const ShardPlan& plan, const std::string& run);
// Throws InputError: no plan there; file, key, expected, found.
ShardPlan read_shard_plan(const std::string& run);
// SHA-256 of plan.json: what attempts say that they belong to.
std::string shard_plan_digest(const std::string& run);

// The shard of that number. Throws std::invalid_argument that names how many there are.
const Shard& shard_of(const ShardPlan& plan, std::int64_t number);

// Digests of this process, with these engines' modules.
ProgramDigests program_digests(const std::vector<std::string>& engines);
// Throws InputError where a worker is not the program that made the plan: which part, both digests, what to do.
void require_same_program(const ProgramDigests& planned, const ProgramDigests& here, const std::string& run);

}  // namespace duet
