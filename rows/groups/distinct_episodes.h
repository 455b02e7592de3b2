// The one door through which rows enter statistics. Where policy, controller and start draw no random number, several
// episodes of one clip are one and the same, bit for bit; counted as independent they would make every interval and
// test narrower than it is. They count once.
#pragma once

#include <string>
#include <vector>

#include "duet/rows/episode_row.h"

namespace duet {

// Rows by task, clip and episode, of repeats of one episode (equal in every field but key, number, seed and wall times)
// the one of the lowest number. Rows without a state hash repeat nothing. Throws as require_one_suite
// (rows/groups/row_groups.h).
std::vector<const EpisodeRow*> distinct_episodes(const std::vector<EpisodeRow>& rows);

// "8 of 12 episodes repeat another one bit for bit ... and count once (mujoco/vmc/replay clean: 8)"; "" where none
// does.
std::string repeats_note(const std::vector<EpisodeRow>& rows);

}  // namespace duet
