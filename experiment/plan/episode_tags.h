// The values that rows hold beside names (core/episode_tags.h), made of the suite's values with the row.
#pragma once

#include <string>

#include "duet/core/episode_tags.h"
#include "duet/experiment/suite/suite.h"
#include "duet/motion/paired_motion.h"

namespace duet {

// The tags of an episode's perturbation, and with them those that the suite gives its policy or its command. Throws
// std::invalid_argument for names that are not in the suite.
Tags with_named_tags(Tags of_perturbation, const Suite& suite, const std::string& clip, const std::string& policy);

// An episode's tags, with those of its clip.
Tags episode_tags(Tags of_perturbation, const Suite& suite, const PairedMotion& clip, const std::string& policy);

}  // namespace duet
