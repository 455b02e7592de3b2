// The log of a run as a recording that every metric and detector takes, with the mask of what was executed of the
// reference: what no executor moved cannot be scored as if it had been.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/robots/robot_model.h"
#include "duet/scoring/executed_mask.h"

namespace duet {

struct LoggedRun {
  Recording recording;  // at 50 Hz, in the frame of odometry; its phases are not known
  ExecutedMask executed;
  std::vector<std::string> events;  // states and causes, in order
  bool whole = false;               // the log has its end
};

// The ticks of a log in which the guard ran or held for a planner with a goal; where none had one, all in which it ran
// or held: the reference's root is then the measured one. The outcome is `fell` where the robot fell (the recording
// ends there), `error` where the guard ended the run for another reason than its operator or planner, and else `ok`.
// Throws InputError for a file that is no such log, made for another robot, or without such ticks.
LoggedRun recording_of_log(const std::string& path, std::optional<Task> task = {});

// Saves the recording with the mask. Throws InputError where the file cannot be written.
void save_logged_run(const Recording& recording, const ExecutedMask& executed, const std::string& path);

}  // namespace duet
