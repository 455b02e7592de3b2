// Effects of the robot's contacts on a solid human partner, per controller, policy, engine and body region: from the
// forces "human.<region>.*" of rows (metrics/contact_safety.h) of one arm, all perturbations together. Playback has no
// physics and is left out. Nothing depends on the order of rows.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"

namespace duet {

inline constexpr std::string_view kAnyRegion = "any";  // the whole body

// Figures over the episodes that touched the region; NaN where there is none. The largest is over episodes.
struct RegionContacts {
  static constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  std::string region;
  long touched = 0;               // episodes
  long over = 0;                  // of them, those over a limit: a ratio above 1
  double peak = kNone;            // largest peak force [N]
  double median_peak = kNone;     // median of the episodes' peak forces [N]
  double quasi_static = kNone;    // largest force held for more than 0.5 s [N]
  double transient = kNone;       // largest force within the first 0.5 s of a contact [N]
  double settled = kNone;         // largest later than 0.1 s after a contact's begin [N]; NaN in rows of before
  double impulse = kNone;         // largest; of any region: the regions' sum [N s]
  double pressure_n_cm2 = kNone;  // largest estimate [N/cm^2]
  double ratio = kNone;           // largest of force and pressure over their limits; NaN: no limit is stated
};

struct EngineContacts {
  std::string engine;                   // "all" for all of a group together
  long episodes = 0;                    // with a solid partner, touched or not
  std::vector<RegionContacts> regions;  // those of the group, from the head down; kAnyRegion last
};

struct ContactGroup {
  std::string controller, policy;
  long diverged = 0;                    // of the episodes; what they measured until then counts
  std::vector<EngineContacts> engines;  // by name
  EngineContacts all;                   // an episode counts once per engine
};

struct ContactTable {
  bool limits_verified = false;      // in every episode
  std::vector<ContactGroup> groups;  // by controller, policy; empty: no episode has a solid partner
};

// Throws InputError: rows of two suites or suite versions, an episode that is there twice.
ContactTable contact_table(const std::vector<EpisodeRow>& rows, const std::string& arm = "main");

bool has_solid_partner(const EpisodeRow& row);  // contacts with one were measured
bool is_over_limit(const EpisodeRow& row);      // of force or pressure, on any region

// Peak force with the ratio to the limit, a column per engine; the other figures over all engines. Warns where nobody
// has verified the limits.
Analysis contact_analysis(const ContactTable& table);

}  // namespace duet
