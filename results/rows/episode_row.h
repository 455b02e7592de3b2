// One episode as one JSON line: the only thing that is stored; every table is derived from rows
// (docs/file-formats.md, "Episode row").
#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/outcome.h"

namespace duet {

inline constexpr int kRowSchema = 5;  // the only one that is read

// In the place of an engine's name: motion without physics (rollout/play_back.h).
inline constexpr std::string_view kPlaybackEngine = "playback";

struct Verdict {           // of one detector
  std::string version;     // "paper", "robot"
  std::string thresholds;  // "paper", "strict"
  bool success = false;
  std::map<std::string, bool> parts;
  std::map<std::string, double> values;   // NaN where undefined (null in JSON, as for any other that is not finite)
  std::map<std::string, double> margins;  // likewise
  int frames = 0;                         // number of evidence frames
};

// Where a few points were, to tell when two engines part on one episode.
struct StateTrace {
  double rate_hz = 10.0;             // frame i is at i / rate_hz [s]
  std::vector<std::string> points;   // "root", "left_hand", "right_hand"
  std::vector<std::vector<int>> mm;  // per frame x, y, z of each point in turn [mm], frame W; empty: not recorded
};

// How often the controller met a number that is not finite, and what it did.
struct RowFaults {
  int observations = 0;  // ticks on which the state or the reference was not finite
  int actions = 0;       // ticks on which the command was not finite
  bool stopped = false;  // the safe stop was entered

  [[nodiscard]] bool any() const { return observations > 0 || actions > 0 || stopped; }
};

// What went wrong with a policy's plans.
struct RowPolicyFaults {
  int late = 0, invalid = 0;  // plans that did not come in time, or were not finite, of the wrong size, not unit
  bool dead = false;          // it gave no plan any more
  std::string message;        // of the first fault

  [[nodiscard]] bool any() const { return late > 0 || invalid > 0 || dead; }
};

// Wall time of the policy's plans [ms]; NaN where none was asked for. Differs from run to run.
struct RowPolicyTime {
  double p50 = std::numeric_limits<double>::quiet_NaN(), p95 = p50, max = p50;
};

// Height of the lowest point of each sole over the ground, of a robot whose controller walks.
struct FootTrace {
  double rate_hz = 25.0;               // frame i is at i / rate_hz [s]
  std::vector<int> left_mm, right_mm;  // as long as one another [mm]; empty: not recorded
};

// One contact of one robot link with one capsule of a solid human.
struct RowContact {
  std::string link, region, capsule;  // "left_wrist_yaw_link", "upper_arm", "right_upper_arm"
  double begin_s = 0.0;               // from the episode's begin [s]
  double duration_s = 0.0;            // [s]
  double peak_n = 0.0;                // [N]
  double impulse_ns = 0.0;            // of the force's magnitude [N s]
  double depth_m = 0.0;               // largest [m]
  double windowed_mean_n = 0.0;       // largest mean over the window of the measurement, 0.1 s [N]
};

inline constexpr std::size_t kMostRowContacts = 16;

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
  std::string arm = "main";  // "main", "null", "shuffled"
  Outcome outcome = Outcome::kOk;
  std::string message;          // why, where outcome is not ok
  std::string detectors;        // version of the detectors' code (metrics/detector.h)
  std::optional<bool> success;  // headline: the suite's detector; false for any outcome but ok and fell
  std::vector<Verdict> verdicts;
  std::map<std::string, double> metrics;  // finite values only; undefined ones are absent
  bool fell = false;
  int frames = 0;
  double sim_s = 0.0, wall_s = 0.0;
  double contact_peak_n = 0.0, contact_impulse_ns = 0.0;  // of the human on the robot
  // Finite values only, by dotted name ("human.chest.peak_n"); the ending is the unit: _n [N], _ns [N s], _s [s],
  // _n_cm2 [N/cm^2]; any other: a ratio or a flag (1 or 0).
  std::map<std::string, double> forces;
  std::vector<RowContact> contacts;  // with a solid human: the kMostRowContacts of the largest peak force, by begin
  long contacts_total = 0;           // those that are left out included
  StateTrace trace;
  FootTrace feet;
  RowFaults faults;
  int late_plans = 0;
  RowPolicyFaults policy_faults;
  RowPolicyTime policy_ms;
  std::string state_hash;  // SHA-256 over the state trajectory
  std::string started_at;  // UTC, ISO 8601
};

// SHA-256 over what makes the episode what it is: suite hash, detectors, task, clip, episode, arm, policy and
// controller with their digests, engine and perturbation. What the profile says of the engine is in the suite hash.
std::string episode_key(const EpisodeRow& row);

// NaN and infinity are never written: such metrics and forces are left out, all other such numbers become null.
// Throws std::invalid_argument for a trace whose frames do not fit its points, and for feet of different lengths.
nlohmann::json to_json(const EpisodeRow& row);
// null reads as NaN. Throws InputError naming the key and the fault; unknown keys are refused.
EpisodeRow row_from_json(const nlohmann::json& json);

}  // namespace duet
