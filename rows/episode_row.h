// One episode as one JSON line: the only thing that is stored; every table is derived from rows
// (docs/file-formats.md, "Episode row").
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "duet/core/episode_facts.h"
#include "duet/core/task.h"
#include "duet/rows/json_fields.h"

namespace duet {

// Parts of an episode row beside texts and numbers: verdicts, contacts, traces, faults. Each part is one JSON
// object, declared once: its struct here and its members' table in episode_row.cpp.

// The verdict of one detector. Values and margins: NaN where undefined (null in JSON, as for any other that is not
// finite).
struct Verdict : DetectorFacts {
  std::string version;     // "paper", "robot", "interaction"
  std::string thresholds;  // "paper", "strict", "act"
  int frames = 0;          // number of evidence frames
};

// Tags of an episode (core/task.h). Rows that have the same share them.
class RowTags {
 public:
  RowTags() = default;
  explicit RowTags(Tags tags) : tags_(tags.empty() ? nullptr : std::make_shared<const Tags>(std::move(tags))) {}

  [[nodiscard]] bool empty() const { return tags_ == nullptr; }
  [[nodiscard]] const Tags& map() const;
  // "" where there is no such tag.
  [[nodiscard]] const std::string& text(std::string_view name) const;
  // NaN where there is no such tag, or it is no number.
  [[nodiscard]] double number(std::string_view name) const;
  // Takes the pool's map in the place of its own, which is the same.
  void share(NamePool& pool) {
    if (tags_) tags_ = pool.shared(tags_);
  }
  bool operator==(const RowTags& other) const { return map() == other.map(); }

 private:
  std::shared_ptr<const Tags> tags_;  // shared: nobody knows which of the rows lives longest; null: none
};

// Where a few points were, to tell when two engines part on one episode.
struct StateTrace {
  double rate_hz = 10.0;             // frame i is at i / rate_hz [s]
  std::vector<std::string> points;   // "root", "left_hand", "right_hand"
  std::vector<std::vector<int>> mm;  // per frame x, y, z of each point in turn [mm], frame W; empty: not recorded
};

// Height of the lowest point of each sole over the ground, of a robot whose controller walks.
struct FootTrace {
  double rate_hz = 25.0;               // frame i is at i / rate_hz [s]
  std::vector<int> left_mm, right_mm;  // as long as one another [mm]; empty: not recorded
};

// A contact as a row keeps it, by names.
struct RowContact : ContactFacts {
  std::string link, region, capsule;  // "left_wrist_yaw_link", "upper_arm", "right_upper_arm"
};

inline constexpr std::size_t kMostRowContacts = 16;

template <>
const JsonSchema<Verdict>& json_schema<Verdict>();
template <>
const JsonSchema<StateTrace>& json_schema<StateTrace>();
template <>
const JsonSchema<ControllerFaults>& json_schema<ControllerFaults>();
template <>
const JsonSchema<PolicyFaults>& json_schema<PolicyFaults>();
template <>
const JsonSchema<PlanTimes>& json_schema<PlanTimes>();
template <>
const JsonSchema<FootTrace>& json_schema<FootTrace>();
template <>
const JsonSchema<RowContact>& json_schema<RowContact>();

inline constexpr int kRowSchema = 5;  // the only one that is read

// The name in the place of an engine's: motion without physics (rollout/world.h).
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
  std::string arm = "main";  // core/task.h: kEpisodeArms
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
  bool scanned = false;           // found without reading the row (rows/row_file.h)
  bool repeats = true;            // false: a wall time, in which equal rows differ (rows/row_file.h)
  bool heavy = false;             // a trace: it stands in rows only, and not in published ones
  bool tabled = true;             // false: no table is made of it
  std::string_view columns = "";  // of a part: what its columns in results.sqlite begin with; "" for its name
  void (*check)(const EpisodeRow&) = nullptr;  // throws InputError for a value that the type allows and the field not
};

struct RowField : JsonKey<EpisodeRow> {
  template <typename Member>
  RowField(JsonKey<EpisodeRow> key, Member EpisodeRow::*member, RowFieldUse used = {})
      : JsonKey<EpisodeRow>(std::move(key)), use(used), clear([member](EpisodeRow& row) { row.*member = Member(); }) {
    if constexpr (std::is_constructible_v<ScannedMember, Member EpisodeRow::*>) scanned = member;
  }
  template <typename Member>
  RowField(FieldDoc words, Member EpisodeRow::*member, RowFieldUse used = {})
      : RowField(JsonKey<EpisodeRow>(std::move(words), member), member, used) {}

  using ScannedMember =
      std::variant<std::monostate, std::string EpisodeRow::*, int EpisodeRow::*, Outcome EpisodeRow::*>;

  RowFieldUse use;
  ScannedMember scanned;                   // of a type that a scan knows
  std::function<void(EpisodeRow&)> clear;  // gives the field the value that it has in a new row
};

// All fields, in the order of the columns of results.sqlite.
const std::vector<RowField>& row_fields();

// SHA-256 over what makes the episode what it is: suite hash, detectors, task, clip, episode, arm, policy and
// controller with their digests, engine and perturbation. The profile's settings of the engine are in the suite hash.
std::string episode_key(const EpisodeRow& row);

// NaN and infinity are never written: such metrics and forces are left out, all other such numbers become null.
// Throws std::invalid_argument for a trace whose frames do not fit its points, and for feet of different lengths.
nlohmann::json to_json(const EpisodeRow& row);
// null reads as NaN. Throws InputError naming the key and the fault; unknown keys are refused.
EpisodeRow row_from_json(const nlohmann::json& json);

}  // namespace duet
