#include "bench/episode.h"

#include <fmt/format.h>

#include "core/random.h"

namespace duet {
namespace {

constexpr const char* kPlayback = "playback";

}  // namespace

std::vector<EpisodeSpec> plan_episodes(const Suite& suite, const std::vector<PairedMotion>& clips) {
  std::vector<EpisodeSpec> plan;
  const std::string suite_id = suite.name + "@" + suite.version;
  for (const std::string& engine : suite.engines) {
    for (const std::string& controller : suite.controllers) {
      if (engine == kPlayback && controller != suite.controllers.front()) continue;  // it moves without one
      const auto add = [&](const std::string& policy, const std::string& arm) {
        for (const PairedMotion& clip : clips) {
          for (int episode = 0; episode < suite.episodes_per_clip; ++episode) {
            const std::uint64_t seed = suite.seed + stream_key({suite_id, to_string(clip.task), clip.clip_id,
                                                                std::to_string(episode), "episode"});
            plan.push_back({&clip, engine, controller, policy, arm, episode, seed});
          }
        }
      };
      for (const std::string& policy : suite.policies)
        if (policy != "null") add(policy, "main");
      if (suite.null_arm) add("null", "null");
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
  row.arm = spec.arm;
  row.robot_digest = robot.digest;
  row.key = episode_key(row);
  return row;
}

}  // namespace duet
