// One episode: what is run, and the plan of all episodes of a suite.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/task.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/suite/suite.h"
#include "duet/motion/paired_motion.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/folder/run_info.h"

namespace duet {

// The parts that an episode is made of. It points at the suite's own parts and at what this machine has loaded of them,
// so that nothing is looked up by name while it runs; Experiment (execution/experiment.h) owns both.
struct EpisodeSpec {
  const PairedMotion* clip = nullptr;
  std::string engine;
  const EngineSettings* settings = nullptr;  // of the engine; null: of playback
  const SuiteController* controller = nullptr;
  const SuitePolicy* policy = nullptr;
  const Perturbation* perturbation = nullptr;
  const SuiteReference* reference = nullptr;  // the commanded velocity that leads in the place of clip and policy
  // "control" and "null" (policy `null`) for control arms; "shuffled": the policy sees `seen`.
  std::string arm = "main";
  int episode = 0;
  std::uint64_t seed = 0;               // of the episode, the same for every engine, controller and policy
  std::uint64_t perturbation_seed = 0;  // likewise
  RowTags perturbation_tags = {};       // of a plan's episodes, which share them
  const PairedMotion* seen = nullptr;   // whose partner the policy sees in the place of this clip's; null: this one's
  const ControllerOnBody* body = nullptr;  // the controller with its robot
  const PolicyOnBody* leader = nullptr;    // the policy on that robot; null for one that was skipped
};

// Whether this machine can run episodes in it: playback always.
bool can_run_in(const std::string& engine);

// More episodes than that are a mistake in a suite.
inline constexpr std::int64_t kMostEpisodes = 10'000'000;

// Throws InputError where a suite of so many clips has more than kMostEpisodes.
void require_sane_size(const Suite& suite, std::int64_t clips);

struct EpisodeArm {
  SuitePolicy policy;
  std::string name;  // EpisodeSpec::arm
};

// Every episode of the suite, the null arm included, in a fixed order: the arms of one clip follow one another, so that
// a part of the work has pairs. The null arm is run once per engine, controller and perturbation. Playback is always
// clean and, as no controller acts in it, run under the first alone, or under each where they differ in robot or start.
// A policy with a shuffled partner sees that of the next clip of its task, the last one that of the first. Each episode
// is made when it is asked for, and points into suite, bodies and plan, which must outlive it.
class EpisodePlan {
 public:
  // `part`: those of it alone, in the same order. Throws InputError where a task with a shuffled partner has one clip
  // alone, for more than kMostEpisodes, and for a part without an episode.
  EpisodePlan(const Suite& suite, const Embodiments& bodies, const EpisodeFilter& part = {});
  EpisodePlan(Suite&&, const Embodiments&,
              const EpisodeFilter& = {}) = delete;  // a suite that is gone by the next line
  EpisodePlan(const EpisodePlan&) = delete;
  EpisodePlan& operator=(const EpisodePlan&) = delete;

  [[nodiscard]] std::int64_t size() const;
  [[nodiscard]] EpisodeSpec at(std::int64_t i) const;

 private:
  [[nodiscard]] std::uint64_t seed(const PairedMotion& clip, int episode, const char* stream) const;

  const Suite& suite_;
  const Embodiments& bodies_;
  std::string suite_id_;
  Perturbation clean_;                              // of playback
  std::map<std::string, EngineSettings> settings_;  // by engine
  std::vector<EpisodeSpec> combinations_;           // engine, controller and perturbation alone
  std::vector<EpisodeArm> arms_;
  // Each combination with each clip that is in the part and is run under it, by their places; clips are the same on
  // every body.
  struct Cell {
    std::size_t combination = 0, clip = 0;
  };
  std::vector<Cell> cells_;
};

// Whether the choice holds this name; none at all is a choice of every name.
bool chosen(const std::vector<std::string>& names, std::string_view name);

// Those of `known` that a filter leaves out.
std::vector<std::string> left_out(const std::vector<std::string>& filter, const std::vector<std::string>& known);

// Throws std::invalid_argument for a name that the suite does not have: a mistake, not an empty run.
void check_filters(const EpisodeFilter& part, const Suite& suite);

// Whether the suite's reference of that place is run under what perturbs the episode; a clip is, and so is playback.
bool is_run_under(const Suite& suite, std::size_t clip, const EpisodeSpec& spec);

// Whether the episode, of a clip of this task, belongs to the part; playback to every choice of perturbations, the null
// arm to every choice of policies.
bool belongs(const EpisodeSpec& spec, Task task, const EpisodeFilter& part);

// How many episodes of a suite, over clips of these tasks, belong to one of these parts.
std::int64_t count_episodes(const Suite& suite, const std::vector<Task>& clips,
                            const std::vector<EpisodeFilter>& parts);

// The cost of an episode in each engine with each controller, and how much of a run's work is done: engines differ by a
// factor of twenty, so that counting episodes says nothing of the time that is left. Thread-safe.

// The name that costs are told apart by: "mujoco/vmc".
std::string cost_name(const EpisodeSpec& spec);

// The length of the motion that an episode follows, its start included. [s]
double motion_seconds(const EpisodeSpec& spec);

class EpisodeCosts {
 public:
  // Said of each episode that is to run, before any has ended.
  void expect(const EpisodeSpec& spec);
  // Such an episode has ended, after so much time of one core [s].
  void ended(const EpisodeSpec& spec, double wall_s);
  // Share of the work that is done, 0 to 1: what ended episodes took over that and what the rest will take at the mean
  // cost of its engine and controller so far. NaN until one of each has ended.
  [[nodiscard]] double share_done() const;

 private:
  struct Work {
    double left = 0.0, done = 0.0;  // motion [s]
    double wall = 0.0;              // that `done` took [s]
  };
  mutable std::mutex mutex_;
  std::map<std::string, Work> work_;
};

// The values that rows hold beside names (core/task.h), made of the suite's values with the row.

// The tags of an episode's perturbation, and with them those that the suite gives its policy or, where it has commands,
// its command.
Tags with_named_tags(Tags of_perturbation, const SuitePolicy& policy, const SuiteReference* command);

// An episode's tags, with those of its clip.
Tags episode_tags(const EpisodeSpec& spec);

}  // namespace duet
