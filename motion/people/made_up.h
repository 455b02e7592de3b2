// Makes up parts that a recording lacks, so that it can be read: legs below upper bodies, a partner for one alone.
// The clip's `source` has the share of frames of each kind ("gaps", "legs", "partner", "rate"). Pure functions.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/task.h"
#include "duet/motion/human_motion.h"
#include "duet/motion/people/raw_people.h"

namespace duet {

inline constexpr double kAverageStature = 1.70;  // of a body of which nothing is known [m]
inline constexpr double kLowRate = 10.0;  // below it two frames lie farther apart than half of the shortest act [Hz]

// Fills the columns that a layout says are made up with straight legs of the average body, below the
// hips, the pelvis or the neck, facing as the shoulders do; both people's end on one floor. Returns the sentence of it.
// Throws InputError where neither file nor options nor the arms tell the unit, or the heads the up axis.
std::string add_legs(RawPeople& people, const PeopleOptions& options);

// Somebody of the average body who stands still, arms hanging, before the one who is recorded and faces him, as far off
// as people do the task.
HumanMotion still_partner(const HumanMotion& person, Task task);

inline constexpr std::string_view kMadeUpKey = "made_up.";  // before the kind, in a clip's `source`
using MadeUp = std::map<std::string, double>;               // the share of frames by kind
void put_made_up(const MadeUp& shares, std::map<std::string, std::string>& source);
MadeUp made_up_of(const std::map<std::string, std::string>& source);
std::string made_up_kinds(const std::map<std::string, std::string>& source);  // "gaps+legs"; "" for none

}  // namespace duet
