// Where the recordings of a replay come from: those that a run kept; other episodes are run again, and the hash of
// their states says whether they are what they were. And files: recordings, clips of people, paired motions.
#pragma once

#include <string>
#include <vector>

#include "duet/experiment/work/run_work.h"
#include "duet/replay/replay_content.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// Which episodes a replay shows: those that were asked for, or the clips on which engines and policies agree least.

struct ReplayChoice {
  // Beginnings of episode keys, or scenes ("hug/hug_000/0/clean", also without its end). Empty: the scenes on which the
  // main arm's tracks agree least.
  std::vector<std::string> episodes;
  // Only these. No controller named: the one with the best mean success over engines and policies.
  std::vector<std::string> engines, controllers, policies, perturbations, tasks;
  int scenes = 3;  // at most, where `episodes` is empty
  bool run_again = false;
  bool allow_programs = false;  // Suite::allow_programs
  std::string card;             // robot card in the place of the one of the row's digest
  int threads = 1;
};

// Rows of the choice, scene by scene, the first scene that with the most disagreement; nothing is run or read.
struct ChosenScene {
  std::string id;
  std::vector<const EpisodeRow*> rows;
};
struct ChosenRows {
  std::vector<ChosenScene> scenes;
  std::vector<std::string> notes;  // what was chosen where the user did not
};
// Throws std::invalid_argument for a name that no row has, with the nearest, and for a choice that leaves no episode.
ChosenRows chosen_rows(const std::vector<EpisodeRow>& rows, const ReplayChoice& choice);

// "hug/hug_000/0/clean".
std::string scene_id(const EpisodeRow& row);

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
