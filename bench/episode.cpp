#include "bench/episode.h"

#include <fmt/format.h>

#include <algorithm>

#include "bench/suite_names.h"
#include "core/random.h"
#include "core/require.h"

namespace duet {
namespace {

constexpr const char* kPlayback = "playback";

// Whether playback under one controller is playback under all; asks what the suite says, not what this machine has.
bool one_playback(const Suite& suite) {
  const auto robot = [&](const SuiteController& controller) {
    return suite.robot.empty() ? controller_info(controller.use).robot : suite.robot;
  };
  const SuiteController& first = suite.controllers.front();
  return std::all_of(suite.controllers.begin(), suite.controllers.end(), [&](const SuiteController& controller) {
    return robot(controller) == robot(first) && start_mode(suite, controller) == start_mode(suite, first);
  });
}

const PairedMotion& next_of_task(const std::vector<PairedMotion>& clips, const PairedMotion& clip,
                                 const std::string& policy) {
  const auto own = static_cast<std::size_t>(&clip - clips.data());
  for (std::size_t i = 1; i < clips.size(); ++i) {
    const PairedMotion& other = clips[(own + i) % clips.size()];
    if (other.task == clip.task) return other;
  }
  throw InputError(
      fmt::format("policy '{}' sees the partner of another clip: expected two clips of {} or more, found one", policy,
                  to_string(clip.task)));
}

// The episodes of one engine, controller and perturbation.
class Planner {
 public:
  Planner(const Suite& suite, std::vector<EpisodeSpec>& plan)
      : suite_(suite), suite_id_(suite.name + "@" + suite.version), plan_(plan) {}

  void add(const EpisodeSpec& combination, const std::vector<PairedMotion>& clips) {
    for (const SuitePolicy& policy : suite_.policies)
      if (policy.name != kNullPolicy) add(combination, clips, policy, policy.shuffled_partner ? "shuffled" : "main");
    if (suite_.null_arm) add(combination, clips, SuitePolicy{kNullPolicy}, "null");
  }

 private:
  void add(const EpisodeSpec& combination, const std::vector<PairedMotion>& clips, const SuitePolicy& policy,
           const char* arm) {
    for (const PairedMotion& clip : clips) {
      for (int episode = 0; episode < suite_.episodes_per_clip; ++episode) {
        EpisodeSpec spec = combination;
        spec.clip = &clip;
        spec.seen = policy.shuffled_partner ? &next_of_task(clips, clip, policy.name) : nullptr;
        spec.policy = policy.name;
        spec.arm = arm;
        spec.episode = episode;
        spec.seed = seed(clip, episode, "episode");
        spec.perturbation_seed = seed(clip, episode, "perturbation");
        plan_.push_back(std::move(spec));
      }
    }
  }

  [[nodiscard]] std::uint64_t seed(const PairedMotion& clip, int episode, const char* stream) const {
    return suite_.seed + stream_key({suite_id_, to_string(clip.task), clip.clip_id, std::to_string(episode), stream});
  }

  const Suite& suite_;
  std::string suite_id_;
  std::vector<EpisodeSpec>& plan_;
};

}  // namespace

StartMode start_mode(const Suite& suite, const SuiteController& controller) {
  switch (suite.start) {
    case SuiteStart::kClip:
      return StartMode::kClip;
    case SuiteStart::kApproach:
      return StartMode::kApproach;
    case SuiteStart::kAct:
      return StartMode::kAct;
    case SuiteStart::kSimToReal:
      return StartMode::kSimToReal;
    case SuiteStart::kAuto:
      break;
  }
  return controller_info(controller.use).walks ? StartMode::kApproach : StartMode::kAct;
}

std::vector<EpisodeSpec> plan_episodes(const Suite& suite, const Bodies& bodies) {
  std::vector<EpisodeSpec> plan;
  Planner planner(suite, plan);
  const bool once = one_playback(suite);
  for (const std::string& engine : suite.engines) {
    for (const SuiteController& controller : suite.controllers) {
      const bool playback = engine == kPlayback;
      if (playback && once && controller.name != suite.controllers.front().name) continue;
      EpisodeSpec combination;
      combination.engine = engine;
      combination.controller = controller.name;
      const std::vector<PairedMotion>& clips = bodies.clips(controller.name);
      if (playback) {
        planner.add(combination, clips);
        continue;
      }
      for (const Perturbation& perturbation : suite.perturbations) {
        combination.perturbation = perturbation.name;
        planner.add(combination, clips);
      }
    }
  }
  return plan;
}

EpisodeRow row_for(const EpisodeSpec& spec, const Suite& suite, const std::string& hash, const RobotModel& robot) {
  EpisodeRow row;
  row.suite = suite.name;
  row.suite_version = suite.version;
  row.suite_hash = hash;
  row.task = to_string(spec.clip->task);
  row.clip = spec.clip->clip_id;
  row.episode = spec.episode;
  row.seed = spec.seed;
  row.engine = spec.engine;
  if (spec.engine != kPlayback) {
    row.engine_profile = suite.profile.name;
    row.profile_digest = settings_digest(spec.engine, suite.profile.settings(spec.engine));
  }
  row.controller = spec.controller;
  row.policy = spec.policy;
  row.perturbation = spec.perturbation;
  row.arm = spec.arm;
  row.robot_digest = robot.digest;
  row.key = episode_key(row);
  return row;
}

}  // namespace duet
