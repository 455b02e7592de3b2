// One episode: what is run, and the plan of all episodes of a suite.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bench/bodies.h"
#include "bench/suite.h"
#include "motion/paired_motion.h"
#include "policies/phase_adaptation.h"
#include "results/episode_row.h"

namespace duet {

struct EpisodeSpec {
  const PairedMotion* clip = nullptr;
  std::string engine, controller, policy;
  std::string arm = "main";  // "null" for the control arm: policy `null`; "shuffled": the policy sees `seen`
  int episode = 0;
  std::uint64_t seed = 0;  // of the episode, the same for every engine, controller and policy
  std::string perturbation = kCleanName;
  std::uint64_t perturbation_seed = 0;  // likewise
  const PairedMotion* seen = nullptr;   // whose partner the policy sees in the place of this clip's; null: this one's
};

// Where episodes of one of the suite's controllers begin.
StartMode start_mode(const Suite& suite, const SuiteController& controller);

// Every episode of the suite, the null arm included, in a fixed order. The null arm is run once per engine, controller
// and perturbation. Playback is always clean and, as no controller acts in it, run under the first alone, or under each
// where they differ in robot or start. A policy with a shuffled partner sees that of the next clip of its task, the
// last one that of the first; throws InputError where a task has one clip alone.
std::vector<EpisodeSpec> plan_episodes(const Suite& suite, const Bodies& bodies);

// A row with everything that is known before the episode runs, its key included.
EpisodeRow row_for(const EpisodeSpec& spec, const Suite& suite, const std::string& hash, const RobotModel& robot);

}  // namespace duet
