// One episode as one JSON line: the only thing that is stored; every table is derived from rows
// (docs/file-formats.md, "Episode row").
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/outcome.h"
#include "duet/rows/row_objects.h"

namespace duet {

inline constexpr int kRowSchema = 5;  // the only one that is read

// The name in the place of an engine's: motion without physics (rollout/play_back.h).
inline constexpr std::string_view kPlaybackEngine = "playback";

// A field stands here and in the table of episode_row.cpp, and nowhere else: JSON, what is compared and published, the
// columns of results.sqlite and docs/reference/row-fields.md come from the table.
struct EpisodeRow {
  std::string key;  // episode_key of the row
  std::string suite, suite_version, suite_hash;
  std::string task, clip;
  int episode = 0;
  std::uint64_t seed = 0;
  std::string engine, engine_version;
  std::string engine_profile, profile_digest;    // "parity"; SHA-256 of the engine's resolved profile
  std::string controller, policy;                // as the suite names them
  std::string controller_digest, policy_digest;  // SHA-256 of what they are; "" where their files were absent
  std::string perturbation = "clean", robot_digest;
  std::string arm = "main";  // core/arm_role.h: kEpisodeArms
  Outcome outcome = Outcome::kOk;
  std::string message;          // why, where outcome is not ok
  RowTags tags;                 // what tables know beside names; none in rows from before there were any
  std::string detectors;        // version of the detectors' code (metrics/detector.h)
  std::optional<bool> success;  // headline: the suite's detector; false for any outcome but ok
  std::vector<Verdict> verdicts;
  NamedNumbers metrics;  // finite values only; undefined ones are absent
  bool fell = false;
  int frames = 0;
  double sim_s = 0.0, wall_s = 0.0;
  double contact_peak_n = 0.0, contact_impulse_ns = 0.0;  // of the human on the robot
  // Finite values only, by dotted name ("human.chest.peak_n"); the ending is the unit: _n [N], _ns [N s], _s [s],
  // _n_cm2 [N/cm^2]; any other: a ratio or a flag (1 or 0).
  NamedNumbers forces;
  std::vector<RowContact> contacts;  // with a solid human: the kMostRowContacts of the largest peak force, by begin
  long contacts_total = 0;           // those that are left out included
  StateTrace trace;
  FootTrace feet;
  ControllerFaults faults;
  int late_plans = 0;
  PolicyFaults policy_faults;
  PlanTimes policy_ms;
  std::string state_hash;  // SHA-256 over the state trajectory
  std::string started_at;  // UTC, ISO 8601

  // No field: where its line begins in its file, of a row that is held without what no table reads
  // (rows/row_file.h) [bytes]; below 0: the row is whole.
  std::int64_t line_at = -1;
};

// The uses of a field beside reading and writing it.
struct RowFieldUse {
  bool scanned = false;           // found without reading the row (rows/row_scan.h)
  bool repeats = true;            // false: a wall time, in which equal rows differ (rows/row_identity.h)
  bool heavy = false;             // a trace: it stands in rows only, and not in published ones
  bool tabled = true;             // false: no table is made of it
  std::string_view columns = "";  // of a part: what its columns in results.sqlite begin with; "" for its name
  void (*check)(const EpisodeRow&) = nullptr;  // throws InputError for a value that the type allows and the field not
};

struct RowField {
  JsonMember<EpisodeRow, RowTags, std::vector<Verdict>, std::vector<RowContact>, StateTrace, FootTrace, ControllerFaults,
             PolicyFaults, PlanTimes>
      json;
  RowFieldUse use = {};
};

// All fields, in the order of the columns of results.sqlite.
std::span<const RowField> row_fields();

// SHA-256 over what makes the episode what it is: suite hash, detectors, task, clip, episode, arm, policy and
// controller with their digests, engine and perturbation. The profile's settings of the engine are in the suite hash.
std::string episode_key(const EpisodeRow& row);

// NaN and infinity are never written: such metrics and forces are left out, all other such numbers become null.
// Throws std::invalid_argument for a trace whose frames do not fit its points, and for feet of different lengths.
nlohmann::json to_json(const EpisodeRow& row);
// null reads as NaN. Throws InputError naming the key and the fault; unknown keys are refused.
EpisodeRow row_from_json(const nlohmann::json& json);

}  // namespace duet
