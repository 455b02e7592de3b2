// duet hw episodes: a suite's episodes over the twin beside the same in the simulator. duet hw run --clip: one episode
// through a guard that is there. duet hw recording: a run's log as a recording.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "duet/app/command.h"

namespace duet::cli {

void add_hardware_episodes(CLI::App& hardware, Session& session);

// Arguments of `duet hw run` for an episode of a clip.
struct ClipEpisodeArguments {
  std::string clip, config, policy = "replay", start = "act", walker = "homie", recording;
};
void add_clip_options(CLI::App& command, ClipEpisodeArguments& arguments);
void run_clip_episode(Session& session, const ClipEpisodeArguments& arguments, const std::string& socket);

}  // namespace duet::cli
