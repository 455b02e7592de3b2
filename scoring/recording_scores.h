// Scores of recordings: of a run's kept episodes the row again, of any other motion what can be said of it.
#pragma once

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/robots/robot_model.h"
#include "duet/rows/row_file.h"
#include "duet/scoring/motion_scores.h"
#include "duet/scoring/scoring.h"

namespace duet {

struct RecordingScore {
  std::string file;
  Recording recording;                    // as read
  std::map<std::string, double> metrics;  // finite ones, by catalogue name
  // The task's (every task's where asked for) by version `robot` and as printed; none without a partner.
  std::vector<DetectorScore> detectors;
  std::optional<EpisodeRow> row;             // of a kept episode, made again
  std::vector<FieldDifference> differences;  // of it from the row that the run wrote
  std::string executed;                      // of the reference, where a robot's executor left some out; empty: all
};

// `robot`: null for the shipped one that a kept episode was run on, or else the default one. A kept episode is judged
// by its run's rules, and options.readings holds for the detectors of `options` alone. Throws InputError naming `file`.
RecordingScore score_recording_file(const std::string& file, const Npz& npz, std::shared_ptr<const RobotModel> robot,
                                    const ScoreOptions& options);

// One recording: what it is, its figures, its detectors.
std::string recording_text(const RecordingScore& score);
// Several: one line each.
std::string recordings_table(const std::vector<RecordingScore>& scores);

nlohmann::json recordings_json(const std::vector<RecordingScore>& scores);

// The mask of what a robot's executor did of the reference: what nothing moved cannot be scored as if it had been.

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

}  // namespace duet
