// The values that rows hold beside names (core/episode_tags.h), made of the suite's values with the row.
#pragma once

#include "duet/core/episode_tags.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite/suite.h"

namespace duet {

// The tags of an episode's perturbation, and with them those that the suite gives its policy or, where it has commands,
// its command.
Tags with_named_tags(Tags of_perturbation, const SuitePolicy& policy, const SuiteReference* command);

// An episode's tags, with those of its clip.
Tags episode_tags(const EpisodeSpec& spec);

}  // namespace duet
