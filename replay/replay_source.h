// Where the recordings of a replay come from: those that a run kept; other episodes are run again, and the hash of
// their states says whether they are what they were. And files: recordings, clips of people, paired motions.
#pragma once

#include <string>
#include <vector>

#include "duet/experiment/work/progress.h"
#include "duet/replay/replay_choice.h"
#include "duet/replay/replay_content.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// Throws as chosen_rows; InputError for a recording that is broken, a robot whose card this machine lacks (it names the
// digest) and as verify_run where episodes have to be run again.
ReplayContent replay_of_run(const Run& run, const ReplayChoice& choice, Progress& progress);

// Whether the run has a recording of this episode, which replay_of_run then reads and does not run again.
bool has_kept_recording(const Run& run, const EpisodeRow& row);

// NPZ files of anybody, told apart by their schema. A recording is a track; those of one task, clip and episode are one
// scene. A clip is a scene of its two people. A paired motion is a scene of two tracks: the robot, played back without
// physics, with the adapted partner; and the people that it was made from. A paired motion is shown on the robot that
// it names, where a card has that name. Throws InputError, also for two motions of one task and id.
ReplayContent replay_of_files(const std::vector<std::string>& files, const std::string& card);

}  // namespace duet
