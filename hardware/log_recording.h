// The log of a run as a recording that every metric and detector takes, with the mask of what was executed of the
// reference: what no executor moved cannot be scored as if it had been.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/core/recording.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Channels of the 36-D reference (supplement A.4.1) in the order x, y, z, quaternion w, x, y, z, then the card's
// joints; x, y and the turn are executed as a velocity.
using ExecutedMask = std::vector<bool>;
// `joints`: that a limiter moves; `height`: the walking controller is told it.
ExecutedMask executed_mask(const RobotModel& robot, const std::vector<int>& joints, bool height);
// "root velocity and height; 14 of 29 joints, not left_hip_pitch_joint, ...". Throws std::invalid_argument for a mask
// of another robot's size.
std::string executed_mask_text(const ExecutedMask& mask, const RobotModel& robot);
// The key `executed` of a recording's archive. None where it has no such key; throws InputError for one of another
// size, or with other numbers than 0 and 1.
void put_executed_mask(const ExecutedMask& mask, Npz& npz);
std::optional<ExecutedMask> read_executed_mask(const Npz& npz);

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
