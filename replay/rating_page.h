// The page of `duet rate`: episodes of a run in 3-D, one at a time, for a person who is to say whether the robot did
// what it was asked to. It is blind: neither its text nor its data name a policy, an engine, a controller, a clip, a
// verdict or a force, and an episode is known by its key alone.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "duet/experiment/work/progress.h"
#include "duet/replay/replay_content.h"
#include "duet/replay/replay_page.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

struct RatingChoice {
  int count = 50;          // episodes at most
  std::uint64_t seed = 1;  // draws the episodes and their order
  std::string card = {};   // as ReplayChoice::card
};

// Episodes drawn from `rows`, about as many of each task, in the order in which they are shown. Both depend on the seed
// and the keys alone, not on the order of rows. Fewer where there are not so many.
std::vector<const EpisodeRow*> rated_rows(const std::vector<const EpisodeRow*>& rows, int count, std::uint64_t seed);

// A scene per episode: its id is the key, its name the task's prompt, its one track the motions of robot and partner.
// Draws from the episodes whose recordings the run has kept; of equal ones (rows/groups/distinct_episodes.h) one.
// Throws InputError for a run that has kept none, and as replay_of_run for a recording that cannot be shown.
ReplayContent rating_content(const Run& run, const RatingChoice& choice, Progress& progress);

// `viewer`: load_viewer("rate").
std::string rating_page(const ReplayContent& content, const ViewerBundle& viewer);

}  // namespace duet
