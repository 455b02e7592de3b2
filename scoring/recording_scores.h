// Scores of recordings: of a run's kept episodes the row again, of any other motion what can be said of it.
#pragma once

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "duet/rows/row_identity.h"
#include "duet/scoring/episode_recording.h"
#include "duet/scoring/motion_scores.h"

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

}  // namespace duet
