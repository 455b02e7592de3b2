// The status of a guard, as `duet hw` prints it: for the screen, and as JSON.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

#include "duet/app/command.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/guard/robot_guard.h"
#include "duet/hardware/log/run_log.h"

namespace duet::cli {

nlohmann::json status_json(const RobotGuard& guard);
// `seconds`: for which it has listened.
std::string status_text(const RobotGuard& guard, double seconds);
// The joint that cannot be where its states say: " (left_elbow_joint)"; "" where none is.
std::string in_doubt_text(const RobotGuard& guard);

// Asks the system for real-time priority, for this thread and those that it makes from now on, and says what came of
// it.
std::string real_time_text();

// duet hw episodes: a suite's episodes over the twin beside the same in the simulator. duet hw run --clip: one episode
// through a guard that is there. duet hw recording: a run's log as a recording.

void add_hardware_episodes(CLI::App& hardware, Session& session);

// Arguments of `duet hw run` for an episode of a clip.
struct ClipEpisodeArguments {
  std::string clip, config, policy = "replay", start = "act", walker = "homie", recording;
};
void add_clip_options(CLI::App& command, ClipEpisodeArguments& arguments);
void run_clip_episode(Session& session, const ClipEpisodeArguments& arguments, const std::string& socket);

// `duet hw holds`: every cause of a hold over the twin, and whether the robot stays on its feet.
void add_holds(CLI::App& hardware, Session& session);

// `duet hw walks`: random places over the twin, and how near to them the robot comes to rest.
void add_walks(CLI::App& hardware, Session& session);

// `duet hw report` and `duet hw status`.
void add_log_commands(CLI::App& hardware, Session& session);
// Tells `duet hw status`, where it waits beside the guard's socket, how the guard is: 10 times a second.
RunLog::Watch status_sender(const std::string& socket);

// `duet hw key` and `duet hw link`: a guard on another computer.
void add_network(CLI::App& hardware, Session& session);

// `duet hw checklist`: a form to fill in, and whether it does.
void add_checklist(CLI::App& hardware, Session& session);
// The form of a configuration, as JSON for its log; "" where it names none. Throws InputError where it is required and
// does not do; otherwise it is noted.
std::string checked_form(Session& session, const std::string& config_path, const RobotConfig& config);
// The behaviour of a robot when commands end, as its checklist has it, or that nobody knows; a sentence's end.
std::string when_commands_end(const RobotConfig& config);

// `duet hw see`: recorded estimates of a person into guard and policy.
void add_see(CLI::App& hardware, Session& session);
// `duet hw calibrate`: the camera on the body from a person at marked places.
void add_calibrate(CLI::App& hardware, Session& session);

// `duet hw play-partner`: a clip in the place of a camera.
void add_play_partner(CLI::App& hardware, Session& session);

}  // namespace duet::cli
