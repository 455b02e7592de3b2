// Which episodes a replay shows: those that were asked for, or the clips on which engines and policies agree least.
#pragma once

#include <string>
#include <vector>

#include "duet/rows/episode_row.h"

namespace duet {

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

}  // namespace duet
