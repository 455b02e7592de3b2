// A suite: what is run, frozen and versioned. Strict YAML (docs/file-formats.md, "Suite"): an unknown key or name is
// refused with file, line and the nearest known one. Results are comparable only within name@version.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/controllers/controller.h"
#include "duet/core/task.h"
#include "duet/experiment/suite/profile.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/readings.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/motion/synthesis_options.h"
#include "duet/policies/phase_adaptation.h"
#include "duet/policies/policy.h"
#include "duet/policies/scheduler.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "duet/rollout/reference_source.h"

namespace duet {

// The words of suite files for what duet chooses by value.

// auto: act where the controller cannot walk, else approach
enum class SuiteStart { kAuto, kClip, kApproach, kAct, kSimToReal };
// As PartnerMode; yielding: solid, and gives way where they are touched (rollout/yielding_partner.h).
enum class SuitePartner { kNone, kGhost, kSolid, kYielding };
enum class RecordTrajectories { kNone, kFailures, kAll };
enum class ClipRoles { kOwn, kBoth };  // whom the robot replaces: whom the clip says, or each person in turn

template <typename E>
using NameTable = std::vector<std::pair<std::string, E>>;

inline constexpr const char* kNullPolicy = "null";  // of the control arm
// Whether the value of an option of that name is a file.
bool is_path_option(std::string_view option);

const NameTable<SuiteStart>& start_names();
const NameTable<Side>& side_names();
const NameTable<ActOutcome>& act_outcome_names();
const NameTable<ClipRoles>& role_names();
const NameTable<Likeness>& likeness_names();  // "rehearsed", "people", "varied"
const NameTable<SuitePartner>& partner_names();
const NameTable<RecordTrajectories>& record_names();
const NameTable<DetectorVersion>& version_names();
const NameTable<ThresholdSet>& threshold_names();

std::string_view to_string(SuiteStart start);
std::string_view to_string(SuitePartner partner);

// How engines have them: a yielding one as a solid one.
PartnerMode scene_mode(SuitePartner partner);

// Its names in the order of the enumerators, which count from 0: the choices of a field (core/field.h).
template <typename E>
std::vector<std::string> choices_of(const NameTable<E>& table) {
  std::vector<std::string> names(table.size());
  for (const auto& [name, value] : table) names.at(static_cast<std::size_t>(value)) = name;
  return names;
}

template <typename E>
std::string_view name_of(const NameTable<E>& table, E value) {
  for (const auto& [name, known] : table)
    if (known == value) return name;
  return "?";
}

// The key `reference` of a suite: roots that move by command in the place of clips and policies. Does the robot walk,
// how fast, does it fall: nobody else is there, and no clip gives the episode its length.

// The policy's name in rows; their task is kWalkRows (rows/groups/row_groups.h).
inline constexpr const char* kVelocityPolicy = "velocity";

// The upper body stays in the neutral pose, in one drawn for the episode, or moves between poses drawn for it.
enum class UpperBody { kStill, kHeld, kMoving };

struct SuiteReference {
  std::string name;                                    // in rows the clip; once per suite
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // forward, to the left [m/s], yaw rate [rad/s], in the heading
  double seconds = 14.0;                               // of the episode
  double begin = 0.0, end = 14.0;                      // when the command holds; else the root stands [s]
  double pause = 0.0;                                  // above 0: on and off in turn, each for so long [s]
  UpperBody upper_body = UpperBody::kStill;
  std::vector<std::string> perturbations = {};  // the suite's under which it is run; none: all of them
  Tags tags = {};                               // of its rows (core/task.h); they change nothing of an episode

  // Whether the command holds from the first tick to the last.
  [[nodiscard]] bool constant() const { return begin <= 0.0 && end >= seconds && pause <= 0.0; }
};

// A mapping or a list of them. Throws InputError: file, line, expected, found.
std::vector<SuiteReference> read_references(const YamlSection& suite, const std::string& file);
std::string references_yaml(const std::vector<SuiteReference>& references);  // a block; "" where there are none

// The reference by its name; throws std::invalid_argument with those that are there.
const SuiteReference& reference_of(const std::vector<SuiteReference>& references, const std::string& name);

StreamOptions stream_options(const SuiteReference& reference);

// A controller that takes a velocity by its option `command` gets the reference's, unless the suite gives it one.
bool takes_command(const ControllerInfo& controller);
ControllerOptions with_command(const ControllerInfo& controller, ControllerOptions options,
                               const SuiteReference& reference);

// Adds one copy of each synthesised clip, with this hand and contact height; all else is drawn as for its index.
struct ClipVariant {
  std::string name;  // follows the clip's id; once per suite
  std::optional<Side> side{};
  std::optional<double> target_height{};  // [m]
  std::optional<double> distance{};       // of the roots at the start [m]
  std::optional<ActOutcome> outcome{};    // of people only
  std::optional<bool> still{};            // of gestures that vary: the partner has no part in it
};

// Gives what the variant asks for to the options of its clip.
void vary(const ClipVariant& variant, SynthesisOptions& options);
// The tags that rows hold of it: side and height.
Tags tags_of(const ClipVariant& variant);

// How long both people stand as in the first and the last frame of each clip around it.
struct ClipPadding {
  double before = 0.0, after = 0.0;  // [s]

  [[nodiscard]] bool any() const { return before > 0.0 || after > 0.0; }
};

struct SuiteClips {
  int synth_per_task = 0;  // synthesised clips of each task, or
  int synth_per_file = 0;  // of each task so many for each of its files, beside these
  std::uint64_t synth_seed = 42;
  Likeness synth_like = Likeness::kScripted;
  bool synth_tracked = false;           // as a depth camera sees them (motion/people/tracked_clip.h)
  std::vector<std::string> files;       // clips or paired motions (NPZ)
  bool given = false;                   // the files are yet to be given (`duet run --clips`)
  std::vector<ClipVariant> variants{};  // of synthesised clips; none: each as it is drawn
  ClipPadding pad{};
  ClipRoles roles = ClipRoles::kOwn;

  // How often each clip is there: in each variant, in each role.
  [[nodiscard]] std::size_t copies() const;
};

// A controller as a suite names it: one of duet's, or an IO descriptor, with options, under a name of its own.
struct SuiteController {
  std::string name;        // in rows and tables; once per suite
  std::string use = name;  // for make_controller
  ControllerOptions options = {};
  std::optional<ControllerInfo> about = {};  // as it was when the suite was read; none: of a suite that no file said
};

// A policy as a suite names it, in the same way.
struct SuitePolicy {
  std::string name;        // in rows and tables; once per suite
  std::string use = name;  // for policy_maker
  PolicyOptions options = {};
  std::string prompt = {};        // the language command; empty: the task's own (rollout/act_episode.h)
  bool shuffled_partner = false;  // sees the partner of another clip of the task: whether it looks at its partner
  Tags tags = {};                 // of its rows (core/task.h); no part of what it is
};

struct Suite {
  std::string name, version;
  std::string file;  // where it came from, for messages
  std::uint64_t seed = 10000;
  SuiteClips clips;
  std::vector<SuiteReference> references = {};  // where there are any: in the place of clips, tasks and policies
  std::vector<Task> tasks;
  std::vector<std::string> engines;
  std::vector<SuiteController> controllers;
  std::vector<SuitePolicy> policies;
  std::vector<Perturbation> perturbations = {Perturbation{}};  // of engines; playback has none
  int episodes_per_clip = 1;
  std::string draws_of = {};  // NAME@VERSION of the suite whose random numbers its episodes draw; empty: its own
  SuiteStart start = SuiteStart::kAuto;
  double start_radius = 1.0;  // of `approach` [m]
  SuitePartner partner = SuitePartner::kGhost;
  int fuse_ticks = kTicksPerPlan;                             // SchedulerOptions
  double max_root_speed = SchedulerOptions{}.max_root_speed;  // [m/s]
  Profile profile;                                            // step and solver settings of the suite's engines
  DetectorVersion detector = DetectorVersion::kRobot;
  ThresholdSet thresholds = ThresholdSet::kPaper;
  std::string contact_limits;                   // table; empty: the one that ships with duet
  std::string robot;                            // card; empty: of each controller the one it was made for
  std::map<std::string, std::string> retarget;  // pair option -> value
  std::map<std::string, std::string> readings;  // "family.option" -> reading
  double wall_limit = 120.0;                    // per episode [s]
  RecordTrajectories record = RecordTrajectories::kNone;
  bool null_arm = true;
  std::vector<std::string> controls = {};  // scripted control arms (policies/controls/control_policy.h)
  bool allow_programs =
      false;  // the user's word, never a file's: policies may start programs (experiment/plan/embodiments.h)

  // Whether commanded velocities lead its episodes, in the place of clips and policies.
  [[nodiscard]] bool is_commanded() const { return !references.empty(); }

  // Throw std::invalid_argument for a name that is not in the suite, with those that are. The clean arm always is: it
  // is playback's.
  [[nodiscard]] const SuiteController& controller(const std::string& name) const;
  // The null arm's policy always is, too, and so are those of the control arms.
  [[nodiscard]] SuitePolicy policy(const std::string& name) const;
  [[nodiscard]] Perturbation perturbation(const std::string& name) const;
  [[nodiscard]] std::vector<std::string> controller_names() const;
  [[nodiscard]] std::vector<std::string> policy_names() const;
  [[nodiscard]] std::vector<std::string> perturbation_names() const;

  // The card of the robot that clips are retargeted to, and of the one that a controller runs on. Throw MissingError
  // where it is not there.
  [[nodiscard]] std::string card() const;
  [[nodiscard]] std::string card_of(const SuiteController& controller) const;
  // The table that contacts with a solid partner are held against.
  [[nodiscard]] std::string contact_limits_file() const;
  // Where episodes of one of its controllers begin.
  [[nodiscard]] StartMode start_of(const SuiteController& controller) const;
  // Throws std::invalid_argument for a reading that is unknown.
  [[nodiscard]] Readings metric_readings() const;
  // Tasks of the clips that the suite makes itself, or of its commanded velocities, which have none: any stands for it.
  [[nodiscard]] std::vector<Task> tasks_of_own_clips() const;

  // Takes the tags from all that has some; they are no part of what the suite runs.
  void clear_tags();
  // Throws InputError where the suite's clips are still to be given, saying how.
  void require_clips() const;
};

using Overrides =
    std::vector<std::pair<std::string, std::string>>;  // dotted key -> value, as `-s clips.synth.per_task=3`

// The facts known of a controller: those that the suite was read with, or those known now.
ControllerInfo about(const SuiteController& controller);

// Throws InputError: file, line, key, expected, found.
Suite load_suite(const std::string& path, const Overrides& overrides = {});
Suite parse_suite(const std::string& yaml, const std::string& name, const Overrides& overrides = {});
// The suite.yaml that a run keeps. It may name engines that this machine does not know, whose episodes cannot run here
// (can_run_in).
Suite parse_run_suite(const std::string& yaml, const std::string& name);

// All keys written out, in a fixed order: what a run directory keeps. Settings of engines are those that the profile
// says; the rest is an engine's own (resolved_settings).
std::string resolved_yaml(const Suite& suite);

}  // namespace duet
