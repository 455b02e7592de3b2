// Whether the people of a clip that others wrote are people on a floor: where a wrong unit, axis, side or floor shows.
// Pure functions.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "duet/motion/interaction_clip.h"

namespace duet {

// Bones from the head through pelvis, hip and knee to the ankle, mean of both sides; the head joint is not the crown.
inline constexpr double kShortestPerson = 1.2, kTallestPerson = 2.1;  // [m]
inline constexpr double kUprightCosine = 0.8;  // of the mean direction head above ankles with the up axis

struct LengthUnit {
  const char* name;
  double metres;
};
// No two differ by less than the factor kTallestPerson / kShortestPerson, so at most one fits a person.
inline constexpr std::array<LengthUnit, 5> kLengthUnits = {{{"metre", 1.0},
                                                            {"CMU unit (1 inch / 0.45)", 0.056444},
                                                            {"inch", 0.0254},
                                                            {"centimetre", 0.01},
                                                            {"millimetre", 0.001}}};

// The length above, mean over frames. [m]
double stature(const HumanMotion& person);

// One sentence each. A fault cannot be right of people who stand on a floor; an oddity may be, and should be looked at.
struct Plausibility {
  std::vector<std::string> faults;
  std::vector<std::string> oddities;
};

// Stature, up axis, floor, left against right, and how far the two are apart. The clip is valid.
Plausibility judge_people(const InteractionClip& clip);

// A clip from a file that others may have written, and what its reader should know: phases that were proposed,
// oddities.
struct ImportedClip {
  InteractionClip clip;
  std::vector<std::string> notes;
};

// Faults are refused with an InputError that names the file, or taken and noted.
enum class Implausible { kRefused, kAllowed };
ImportedClip read_foreign_clip(const Npz& npz, Implausible implausible = Implausible::kRefused);

}  // namespace duet
