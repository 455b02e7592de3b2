#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "duet/backends/actuation.h"
#include "duet/backends/engine_module.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/experiment/suite_file/suite_key.h"
#include "duet/metrics/readings.h"
#include "duet/policies/controls/control_policy.h"
#include "duet/policies/scheduler.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

using Keys = std::vector<SuiteKey>;
using With = SuiteKey::With;

constexpr const char* kSuiteSchema = "duet.suite/1";

SuiteKey schema_key() {
  const auto read = [](const YamlSection& top, Suite&) { top.require_schema(kSuiteSchema); };
  return SchemaKey<Suite>("schema", read, {{"schema", kSuiteSchema, "required", "of this file"}},
                          [](const Suite&) { return kSuiteSchema; });
}

// Fills in what a suite of references has in the place of policies, tasks and people.
void lead_by_velocity(Suite& suite) {
  suite.policies = {SuitePolicy{.name = kVelocityPolicy, .use = "replay"}};
  suite.null_arm = false;
  suite.partner = SuitePartner::kNone;
  suite.start = SuiteStart::kClip;
}

SuiteKey reference_key() {
  const auto read = [](const YamlSection& top, Suite& suite) {
    suite.references = read_references(top, suite.file);
    if (!suite.references.empty()) lead_by_velocity(suite);
  };
  return {{"reference",
           read,
           {{"reference", "a mapping, or a list of them", "",
             "a root that moves by command, in the place of clips, tasks and policies (file-formats.md)"}},
           [](const Suite& suite) { return references_yaml(suite.references); }},
          With::kReference};
}

SuiteKey clips_key() {
  SuiteKey key({"clips", read_clips, {}, [](const Suite& suite) { return clips_yaml(suite.clips); }}, With::kClips);
  for (const FieldRow& row : field_rows(synth_fields(), SuiteClips()))
    key.rows.push_back(
        {"clips.synth." + row.name, row.values, row.name == "per_task" ? "" : row.fallback, row.meaning});
  key.rows.push_back(
      {"clips.synth.variants", "a list of {name, side, target_height, distance, outcome}", "",
       "every clip once in each (`side`: `left` or `right` hand, `target_height` of contact or gesture "
       "[m], `distance` of the roots at the start [m], `outcome` of an act like people's: `complete`, "
       "`hesitant` or `aborted`; at least one of them), all else drawn as without; ids end in the name"});
  key.rows.push_back({"clips.files", "a list of paths, or given", "",
                      "clips or paired motions (NPZ), folders of them or data sets (their people), in the place of "
                      "`synth.per_task`; `given`: who runs the suite gives them with `--clips`"});
  for (const FieldRow& row : field_rows(padding_fields(), ClipPadding()))
    key.rows.push_back({"clips.pad." + row.name, row.values, row.fallback, row.meaning});
  for (const FieldRow& row : field_rows(FieldTable<SuiteClips>{roles_field()}, SuiteClips()))
    key.rows.push_back({"clips." + row.name, row.values, row.fallback, row.meaning});
  return key;
}

std::string list_yaml(const std::vector<std::string>& names) { return fmt::format("[{}]", fmt::join(names, ", ")); }

// "all", "none" or a list of names.
SuiteKey controls_key() {
  const auto read = [](const YamlSection& top, Suite& suite) {
    if (!top.has("controls")) return;
    checked(top, "controls", [&] {
      if (top.node("controls").IsSequence())
        suite.controls = names_in(top, "controls");
      else if (const std::string word = top.text("controls"); word == "all")
        suite.controls = control_names();
      else
        require(word == "none", "expected a list, 'all' or 'none', found '{}'", word);
      for (const std::string& name : suite.controls)
        require(is_control(name), unknown_name_message("control", name, control_names()));
    });
  };
  // Left out where there are none, so that a suite from before there were any keeps its hash.
  const auto write = [](const Suite& suite) { return suite.controls.empty() ? "" : list_yaml(suite.controls); };
  return {{"controls",
           read,
           {{"controls", "a list of names, `all` or `none`", "none",
             "scripted policies that no score may reward, each an arm of its own (`duet list policies`)"}},
           write},
          With::kClips};
}

SuiteKey tasks_key() {
  const auto read = [](const YamlSection& top, Suite& suite) {
    if (!top.has("tasks")) {
      suite.tasks.assign(kPaperTasks.begin(), kPaperTasks.end());
      return;
    }
    checked(top, "tasks", [&] {
      for (const std::string& task : names_in(top, "tasks")) suite.tasks.push_back(parse_task(task));
      require(!suite.tasks.empty(), "expected at least one task, found none");
    });
  };
  return {{"tasks",
           read,
           {{"tasks", "a list of names", "the first six", "names of `duet list tasks`"}},
           [](const Suite& suite) { return list_yaml(task_names(suite.tasks)); }},
          With::kClips};
}

// `all`: playback and every engine that this machine has.
void read_engines(const YamlSection& top, Suite& suite) {
  if (top.has("engines") && top.node("engines").IsScalar() && top.text("engines") == "all") {
    suite.engines = {std::string(kPlaybackEngine)};
    for (const EngineInfo& engine : engines())
      if (engine.available) suite.engines.push_back(engine.name);
    return;
  }
  suite.engines = names_in(top, "engines");
  checked(top, "engines", [&] { require(!suite.engines.empty(), "expected at least one engine, found none"); });
}

// A suite with nothing but the clean arm says nothing of perturbations.
std::string perturbations_yaml(const Suite& suite) {
  if (suite.perturbations.size() == 1 && suite.perturbations.front().name == kCleanName) return "";
  std::string text;
  for (const Perturbation& perturbation : suite.perturbations) text += fmt::format("\n  - {}", to_yaml(perturbation));
  return text;
}

void add_lists(Keys& keys) {
  keys.emplace_back(
      SchemaKey<Suite>{"engines",
                       read_engines,
                       {{"engines", "a list of names, or all", "required",
                         "names of `duet list engines`; `all` is playback and every engine that is there"}},
                       [](const Suite& suite) { return list_yaml(suite.engines); }});
  keys.emplace_back(SchemaKey<Suite>{
      "controllers",
      read_controllers,
      {{"controllers", "a list", "required",
        "each a name (`duet list controllers`), the path of an IO descriptor, or `{name, use, options}`"}},
      controllers_yaml});
  keys.emplace_back(
      SchemaKey<Suite>{"policies",
                       read_policies,
                       {{"policies", "a list", "required",
                         "each a name (`duet list policies`), the path of a policy descriptor, or `{name, "
                         "use, options, prompt, partner, tags}`"}},
                       policies_yaml},
      With::kClips);
  keys.emplace_back(SchemaKey<Suite>{
      "perturbations",
      [](const SchemaSection& top, Suite& suite) { suite.perturbations = read_perturbations(top, suite.file); },
      {{"perturbations", "a list", "[clean]",
        "every engine, controller and policy runs under each, and so does the null arm "
        "([perturbations.md](perturbations.md)). Playback is clean"}},
      perturbations_yaml});
}

void add_start_and_partner(Keys& keys) {
  keys.push_back(
      plain_key(field<Suite>({.name = "start",
                              .meaning = "`clip` (as retargeted), `approach` (A.4.4), `act` (at the act "
                                         "position), `sim_to_real` (Algorithm 7: a straight, mildly turning "
                                         "walk, arms down until 16 frames before the act); `auto` is `act` for "
                                         "a controller that cannot walk, else `approach`",
                              .choices = choices_of(start_names())},
                             &Suite::start),
                With::kClips));
  keys.push_back(
      plain_key(field<Suite>({.name = "start_radius", .meaning = "of `approach`", .unit = "m", .range = {0.0, 5.0}},
                             &Suite::start_radius),
                With::kClips));
  keys.push_back(plain_key(field<Suite>({.name = "partner",
                                         .meaning = "`ghost` touches nothing (as in the supplement), `solid` pushes, "
                                                    "`yielding` pushes and gives way (deviations.md, E7)",
                                         .choices = choices_of(partner_names())},
                                        &Suite::partner),
                           With::kClips));
}

void add_scheduler(Keys& keys) {
  keys.push_back(plain_key(field<Suite>({.name = "fuse_ticks",
                                         .meaning = "ticks over which a new plan takes over from the one before "
                                                    "(Algorithm 9; deviations.md, P1)",
                                         .range = {1, kMostFuseTicks}},
                                        &Suite::fuse_ticks),
                           With::kClips));
  keys.push_back(
      plain_key(field<Suite>({.name = "max_root_speed",
                              .meaning = "bound of the speed of the reference's root that a policy's plans lead",
                              .unit = "m/s",
                              .range = {0.0, 10.0, false}},
                             &Suite::max_root_speed),
                With::kClips, KeyForm::kUnlessDefault));
}

// A name, a path (from the suite's folder or from here), or the mapping that a run directory keeps.
void read_profile_key(const YamlSection& top, Suite& suite) {
  checked(top, "profile", [&] {
    if (top.has("profile") && top.node("profile").IsMap()) {
      suite.profile = read_profile(top.node("profile"), suite.file);
      return;
    }
    const std::string name = top.has("profile") ? top.text("profile") : "parity";
    const std::filesystem::path beside = std::filesystem::path(suite.file).parent_path() / name;
    suite.profile = load_profile(std::filesystem::is_regular_file(beside) ? beside.string() : name);
  });
}

// Writes the profile as it is; what it leaves to an engine's defaults is left to them here too.
std::string profile_yaml(const Profile& profile) {
  std::string text = fmt::format("\n  name: {}\n  engines:{}", profile.name, profile.engines.empty() ? " {}" : "");
  for (const auto& [engine, settings] : profile.engines)
    text += fmt::format("\n    {}: {}", engine, settings_yaml(settings));
  return text;
}

// Law, armature and step of all engines: of every engine that duet knows, not of those that `engines: all` is on this
// machine, as the suite's hash says it.
SuiteKey actuation_key(const Field<EngineSettings>& value) {
  const auto read = [value](const YamlSection& top, Suite& suite) {
    if (!top.has(value.name.c_str())) return;
    for (const EngineInfo& engine : engines()) {
      EngineSettings settings = suite.profile.settings(engine.name);
      read_field(top, value, settings);
      suite.profile.engines[engine.name] = std::move(settings);
    }
  };
  return SchemaKey<Suite>{
      value.name, read, {{value.name, value.values, "the profile's", value.meaning + ", of every engine"}}};
}

void add_profile(Keys& keys) {
  keys.emplace_back(SchemaKey<Suite>{
      "profile",
      read_profile_key,
      {{"profile", "a name, a path or a mapping", "parity",
        "engine profile: a name (`duet list profiles`), a file (from the suite's folder), or its mapping"}},
      [](const Suite& suite) { return profile_yaml(suite.profile); }});
  for (const Field<EngineSettings>& known : actuation_fields<EngineSettings>()) keys.push_back(actuation_key(known));
}

void read_robot(const YamlSection& top, const Field<Suite>& robot, Suite& suite) {
  read_field(top, robot, suite);
  if (is_plain_name(suite.robot) && !suite.robot.ends_with(".yaml"))
    checked(top, "robot", [&] { suite.robot = shipped_card(suite.robot); });
  else if (!suite.robot.empty())
    suite.robot = from_folder_of(suite, suite.robot);
}

void add_files(Keys& keys) {
  const Field<Suite> limits = field<Suite>(
      {.name = "contact_limits", .meaning = "table that contacts with a solid partner are held against; a path"},
      &Suite::contact_limits);
  keys.push_back(plain_key(limits, With::kClips, KeyForm::kQuotedUnlessEmpty));
  keys.back().rows.front().fallback = "the shipped one";
  keys.back().read = [limits](const YamlSection& top, Suite& suite) {
    read_field(top, limits, suite);
    if (!suite.contact_limits.empty()) suite.contact_limits = from_folder_of(suite, suite.contact_limits);
  };
  const Field<Suite> robot = field<Suite>(
      {.name = "robot",
       .meaning = "card of the robot that all controllers get: a name (`duet list robots`) or a path; counts in the "
                  "hash by content"},
      &Suite::robot);
  keys.push_back(plain_key(robot, With::kBoth, KeyForm::kQuotedUnlessEmpty));
  keys.back().rows.front().fallback = "each controller's own";
  keys.back().read = [robot](const YamlSection& top, Suite& suite) { read_robot(top, robot, suite); };
}

void add_verdict_and_record(Keys& keys) {
  keys.emplace_back(
      group_key<Suite>(
          "detector",
          {field<Suite>({.name = "version",
                         .meaning = "which verdict is the headline; the others are stored too",
                         .choices = choices_of(version_names())},
                        &Suite::detector),
           field<Suite>(
               {.name = "thresholds",
                .meaning = "`paper`: Table S11; `strict`: the stricter set; `act`: the rules that know the act",
                .choices = choices_of(threshold_names())},
               &Suite::thresholds)}),
      With::kClips);
  keys.push_back(group_key<Suite>(
      "limits", {field<Suite>({.name = "wall_s_per_episode",
                               .meaning = "an episode that computes for longer is a time-out (a "
                                          "failure, and run again by the same command); plans, and time in "
                                          "which the process was stopped, are not counted",
                               .unit = "s",
                               .range = {0.0, 1.0e6, false}},
                              &Suite::wall_limit)}));
  keys.push_back(
      group_key<Suite>("record", {field<Suite>({.name = "trajectories",
                                                .meaning = "recordings under `trajectories/`, which `duet score` "
                                                           "scores again",
                                                .choices = choices_of(record_names())},
                                               &Suite::record)}));
  keys.push_back(
      plain_key(field<Suite>({.name = "null_arm", .meaning = "the control arm: the robot holds its neutral pose"},
                             &Suite::null_arm),
                With::kClips));
  keys.push_back(controls_key());
}

void add_choices(Keys& keys) {
  keys.push_back(choices_key(
      "retarget", {"retarget", "a mapping", "the mode `paper`", "PAIR options ([pair-options.md](pair-options.md))"},
      &Suite::retarget, [](const SuiteChoices& options) {
        const std::vector<std::pair<std::string, std::string>> list(options.begin(), options.end());
        validate(make_pair_options(list));
      }));
  keys.push_back(choices_key("readings",
                             {"readings", "a mapping", "defaults", "`family.option: reading`, `duet list readings`"},
                             &Suite::readings, [](const SuiteChoices& options) {
                               Readings readings;
                               for (const auto& [name, value] : options) set_reading(readings, name, value);
                             }));
}

SuiteKey draws_key() {
  const Field<Suite> draws = field<Suite>(
      {.name = "draws_of",
       .meaning =
           "another suite, NAME@VERSION: an episode starts as that one's of the same seed, task and clip and draws "
           "the same noise, so that the rows of both stand in pairs"},
      &Suite::draws_of);
  SuiteKey key = plain_key(draws, With::kBoth, KeyForm::kQuotedUnlessEmpty);
  key.rows.front().fallback = "itself";
  key.read = [draws](const YamlSection& top, Suite& suite) {
    read_field(top, draws, suite);
    const std::size_t at = suite.draws_of.find('@');
    checked(top, "draws_of", [&] {
      require(suite.draws_of.empty() || (at != std::string::npos && at > 0 && at + 1 < suite.draws_of.size()),
              "expected NAME@VERSION, as in hhoi-interaction@1.1.0, found '{}'", suite.draws_of);
    });
  };
  return key;
}

Keys make_keys() {
  Keys keys = {schema_key()};
  keys.reserve(29);
  keys.push_back(required_key(field<Suite>({.name = "name", .meaning = "what results are filed under"}, &Suite::name),
                              KeyForm::kAsIs));
  keys.push_back(
      required_key(field<Suite>({.name = "version", .meaning = "likewise"}, &Suite::version), KeyForm::kQuoted));
  keys.push_back(
      plain_key(field<Suite>({.name = "seed",
                              .meaning = "base of the episodes' seeds; each is a function of (suite, task, clip, "
                                         "episode)"},
                             &Suite::seed)));
  keys.push_back(reference_key());
  keys.push_back(clips_key());
  keys.push_back(tasks_key());
  add_lists(keys);
  keys.push_back(plain_key(field<Suite>(
      {.name = "episodes_per_clip", .meaning = "a suite has 10,000,000 episodes at most", .range = {.low = 1}},
      &Suite::episodes_per_clip)));
  keys.push_back(draws_key());
  add_start_and_partner(keys);
  add_scheduler(keys);
  add_profile(keys);
  add_files(keys);
  add_verdict_and_record(keys);
  add_choices(keys);
  return keys;
}

}  // namespace

const std::vector<SuiteKey>& suite_keys() {
  static const Keys table = make_keys();
  return table;
}

}  // namespace duet
