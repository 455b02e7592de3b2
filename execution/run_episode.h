// One episode of a suite: its scene, its setup, and the row that it leaves.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "duet/backends/scene.h"
#include "duet/experiment/plan/episode.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/rollout/act_episode.h"

namespace duet {

std::string utc_now();  // "2026-11-23T15:00:00Z"

// The scene with the perturbation's ground and robot; `robot` is the controller's nominal one.
Scene episode_scene(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot);

// The leader of an episode in the place of the suite's own policy.
struct EpisodeLead {
  PolicyMaker policy = {};                // empty: the suite's own, loaded for this episode alone
  std::function<bool()> stop_asked = {};  // empty: signals alone stop it
  // Filled with what the clip's partner does; the policy may then change what comes after the tick that it plans at
  // (Episode::led_partner). Null: the partner follows the clip.
  std::shared_ptr<PointTracks> partner = {};
};

// One episode, the setup of it, and what it left. Exceptions become rows with outcome `error`, but StorageError (a full
// disk) and std::bad_alloc: they say nothing of the episode.
RolloutSetup episode_setup(const EpisodeSpec& spec, const Suite& suite, const RobotModel& robot);
EpisodeRow run_episode(const EpisodeSpec& spec, const Suite& suite, const RunIdentity& identity,
                       const std::shared_ptr<const RobotModel>& robot, const std::string& trajectory_folder = "",
                       const EpisodeLead& lead = {});

}  // namespace duet
