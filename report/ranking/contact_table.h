// Effects of the robot's contacts on a solid human partner, per controller, policy, engine and body region: from the
// forces "human.<region>.*" of rows (metrics/contact_safety.h) of one arm, all perturbations together. Playback has no
// physics and is left out. Nothing depends on the order of rows.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"

namespace duet {

inline constexpr const char* kAnyRegion = "any";  // the whole body

// The engines of each controller and policy, and "all" of them together, where an episode counts once per engine; `of`
// is the region: `touched` and `over` a limit (a ratio above 1), of the episodes with a solid partner, touched or not;
// and over the episodes that touched it the median of peak forces and the largest of all others (NaN where there is
// none): `peak`, `quasi_static` (held for more than 0.5 s), `transient` (within the first 0.5 s of a contact),
// `settled` (later than 0.1 s after its begin), `impulse` (of any region: the regions' sum), `pressure`, `ratio` (of
// force and pressure over their limits; NaN: no limit is stated). Throws InputError: rows of two suites or suite
// versions, an episode that is there twice. Warns where nobody has verified the limits.
Analysis contact_analysis(const std::vector<EpisodeRow>& rows, const std::string& arm = "main");

bool has_solid_partner(const EpisodeRow& row);  // contacts with one were measured
bool is_over_limit(const EpisodeRow& row);      // of force or pressure, on any region

}  // namespace duet
