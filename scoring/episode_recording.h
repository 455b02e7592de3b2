// The part of an episode that a run keeps (`record.trajectories`): its recording, with all that scoring it again takes.
// The file is a recording (docs/file-formats.md) with more keys; a recording of anybody else is read too.
#pragma once

#include <optional>
#include <string>

#include "duet/archives/npy/npz.h"
#include "duet/scoring/scoring.h"

namespace duet {

// How the run judged the episode, and the row that it wrote but for wall_s.
struct KeptEpisode {
  EpisodeRow row;
  ScoringRules rules;
  ActSource source;
};

struct EpisodeRecording {
  Recording recording;
  std::optional<KeptEpisode> kept;  // empty: not from a run
};

// Throws InputError where the file cannot be written.
void save_episode_recording(const EpisodeRecording& episode, const std::string& path);
// Throws InputError naming the archive, the key and the fault.
EpisodeRecording read_episode_recording(const Npz& npz);

// The row again, from the motion: identity and what was measured at the physics' rate are the kept ones. Throws
// InputError for another robot than the row's.
EpisodeRow score_again(const Recording& recording, const KeptEpisode& kept, const RobotModel& robot);

}  // namespace duet
