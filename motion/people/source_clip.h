// How two people of a file of others become a clip: the one way that every reader of motion/people/ ends in.
#pragma once

#include <string>
#include <vector>

#include "duet/motion/interaction_clip.h"
#include "duet/motion/people/people_options.h"
#include "duet/motion/people/raw_people.h"

namespace duet {

struct SourceClip {
  InteractionClip clip;               // 50 Hz (or the rate asked for), W: z up, floor at 0, metres
  std::vector<std::string> evidence;  // one line per fact that was found or overridden, for the user to read
};

// Unit, up axis, levelling, floor, mirror and rate: as the options say, else as the format is known to have them, else
// as the data show (docs/conventions.md, "Positions of others"); SMPL-24 joints by the layout; resampled; phases
// proposed where there are none. Throws InputError naming the file and the fault: nothing that can be a person, two
// lengths, a value that is not finite, no task, no rate.
SourceClip clip_of(const RawPeople& people, const PeopleOptions& options = {});

}  // namespace duet
