// How two people of a file of others become a clip: the one way that every reader of motion/people/ ends in.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/motion/interaction_clip.h"
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

// Joints that a tracker did not see in some frames (NaN): short gaps are filled along straight lines, longer ones are
// refused. Where PeopleOptions::fill_gaps is told, gaps up to that length are filled, those at either end with the
// nearest position that is seen.

inline constexpr double kLongestUnseen = 0.25;  // of a joint that is not seen [s]

// The gaps that were filled; none where all values are finite.
struct FilledGaps {
  int gaps = 0, values = 0, longest = 0;  // [frames]
  std::vector<bool> frames = {};          // of either person
  bool held = false;                      // some at an end
  [[nodiscard]] std::string sentence() const;
};
// In place. Throws InputError naming person, frame and joint: a value that is not finite where the layout has no gaps,
// at an end where fill_gaps is not told, or for longer than it (default: kLongestUnseen); an infinite one anywhere.
FilledGaps fill_gaps(RawPeople& people, const PeopleOptions& options);

}  // namespace duet
