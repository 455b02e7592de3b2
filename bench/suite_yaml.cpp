// Reads suite files: strict YAML -> Suite.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <utility>

#include "duet/backends/factory.h"
#include "duet/bench/clips.h"
#include "duet/bench/episode.h"
#include "duet/bench/suite.h"
#include "duet/bench/suite_actors.h"
#include "duet/bench/suite_names.h"
#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/plain_name.h"
#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/metrics/readings.h"
#include "duet/policies/scheduler.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

// Runs `read` and puts file, line and key before the message of a std::invalid_argument.
void checked(const YamlSection& section, const char* key, const std::function<void()>& read) {
  try {
    read();
  } catch (const std::invalid_argument& error) {
    section.fail(section.has(key) ? section.line(key) : section.line(), fmt::format("{}: {}", key, error.what()));
  }
}

void get(const YamlSection& section, const char* key, std::string& out) {
  if (section.has(key)) out = section.text(key);
}

void get(const YamlSection& section, const char* key, double& out) {
  if (section.has(key)) out = section.number(key);
}

template <typename Integer>
void get_integer(const YamlSection& section, const char* key, Integer lowest, Integer& out) {
  if (!section.has(key)) return;
  const double value = section.number(key);
  checked(section, key, [&] {
    const double most = std::min(9.0e15, static_cast<double>(std::numeric_limits<Integer>::max()));
    require(value == std::floor(value) && value >= static_cast<double>(lowest) && value <= most,
            fmt::format("expected a whole number, {} to {:.0f}, found {}", lowest, most, value));
  });
  out = static_cast<Integer>(value);
}

template <typename E>
void get_enum(const YamlSection& section, const char* key, const NameTable<E>& table, E& out) {
  if (!section.has(key)) return;
  const std::string text = section.text(key);
  std::vector<std::string> known;
  for (const auto& [name, value] : table) {
    known.push_back(name);
    if (name == text) {
      out = value;
      return;
    }
  }
  section.fail(section.line(key), unknown_name_message(key, text, known));
}

// The names of a list; none where the key is absent.
std::vector<std::string> get_texts(const YamlSection& section, const char* key) {
  std::vector<std::string> names;
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar())
      section.fail(section.line(key), fmt::format("{}: expected names, found {}", key, describe(item)));
    names.push_back(item.Scalar());
  }
  return names;
}

// A section below `parent`, empty where absent.
YamlSection below(const YamlSection& parent, const std::string& file, const char* key,
                  std::initializer_list<const char*> known) {
  return {file, parent.has(key) ? parent.node(key) : YAML::Load("{}"), key, known};
}

void get_names(const YamlSection& top, const char* key, const char* kind, const std::vector<std::string>& known,
               std::vector<std::string>& out) {
  out = get_texts(top, key);
  checked(top, key, [&] {
    require(!out.empty(), fmt::format("expected at least one {}, found none", kind));
    for (const std::string& name : out)
      require(std::find(known.begin(), known.end(), name) != known.end(), unknown_name_message(kind, name, known));
  });
}

std::vector<std::string> engine_names() {
  std::vector<std::string> names = {std::string(kPlaybackEngine)};
  for (const EngineInfo& engine : engines()) names.push_back(engine.name);
  return names;
}

ClipVariant read_variant(const YAML::Node& node, const std::string& file) {
  const YamlSection item(file, node, "variant", {"name", "side", "target_height"});
  ClipVariant variant;
  variant.name = item.text("name");
  if (!is_plain_name(variant.name))
    item.fail(item.line("name"), fmt::format("name: {}", plain_name_message(variant.name)));
  if (item.has("side")) get_enum(item, "side", side_names(), variant.side.emplace());
  variant.target_height = item.optional_number("target_height");
  if (!variant.side && !variant.target_height) item.fail(item.line(), "expected side or target_height, found neither");
  return variant;
}

// What a variant asks of a task that cannot give it is refused here, not when its clips are made.
void check_variant(const YamlSection& top, const ClipVariant& variant, const Suite& suite) {
  checked(top, "clips", [&] {
    for (const Task task : suite.tasks) {
      SynthesisOptions options;
      options.side = variant.side;
      options.target_height = variant.target_height;
      check_synthesis_options(task, options);
    }
  });
}

void read_variants(const YamlSection& synth, Suite& suite) {
  for (const YAML::Node& node : synth.items("variants")) {
    suite.clips.variants.push_back(read_variant(node, suite.file));
    const std::string& name = suite.clips.variants.back().name;
    const auto same = [&](const ClipVariant& other) { return other.name == name; };
    if (std::count_if(suite.clips.variants.begin(), suite.clips.variants.end(), same) > 1)
      synth.fail(synth.line("variants"), fmt::format("variants: '{}' is there twice; names tell clips apart", name));
  }
}

// Paths from the suite's folder; a folder is the files in it. That a file is there is asked when it is read.
void use_clip_files(const YamlSection& clips, Suite& suite) {
  std::vector<std::string> files;
  for (const std::string& file : suite.clips.files) {
    const std::string path = from_folder_of(suite, file);
    try {
      const bool folder = std::filesystem::is_directory(path);
      for (std::string& found : folder ? find_motion_files({path}) : std::vector{path})
        files.push_back(std::move(found));
    } catch (const InputError& error) {
      clips.fail(clips.line("files"), fmt::format("files: {}", error.what()));
    }
  }
  suite.clips.files = std::move(files);
}

void read_clips(const YamlSection& top, Suite& suite) {
  const YamlSection clips = below(top, suite.file, "clips", {"synth", "files"});
  const YamlSection synth = below(clips, suite.file, "synth", {"per_task", "seed", "variants"});
  get_integer(synth, "per_task", 1, suite.clips.synth_per_task);
  get_integer<std::uint64_t>(synth, "seed", 0, suite.clips.synth_seed);
  read_variants(synth, suite);
  if (clips.has("files")) suite.clips.files = get_texts(clips, "files");
  const bool synthetic = suite.clips.synth_per_task > 0;
  if (synthetic != suite.clips.files.empty())
    clips.fail(clips.line(),
               fmt::format("clips: expected either synth.per_task or files, found {}", synthetic ? "both" : "neither"));
  if (!synthetic && !suite.clips.variants.empty())
    clips.fail(synth.line("variants"), "variants: expected per_task, as only synthesised clips have variants");
  use_clip_files(clips, suite);
}

// `all`: playback and every engine that this machine has.
void read_engines(const YamlSection& top, Suite& suite) {
  if (!top.has("engines") || !top.node("engines").IsScalar() || top.text("engines") != "all") {
    get_names(top, "engines", "engine", engine_names(), suite.engines);
    return;
  }
  suite.engines = {std::string(kPlaybackEngine)};
  for (const EngineInfo& engine : engines())
    if (engine.available) suite.engines.push_back(engine.name);
}

// A root that moves by command leaves nothing for these keys to say.
void refuse_clips(const YamlSection& top) {
  for (const char* key : {"clips", "tasks", "policies", "start", "start_radius", "partner", "fuse_ticks", "detector",
                          "contact_limits", "null_arm", "retarget", "readings"})
    if (top.has(key))
      top.fail(top.line(key), fmt::format("{}: expected no such key beside `reference`, which has neither clips nor "
                                          "policies nor people",
                                          key));
}

// A command that comes and goes is nothing for a controller that takes one for the whole episode.
void check_commands(const YamlSection& top, const Suite& suite) {
  for (const SuiteController& controller : suite.controllers) {
    if (!takes_command(controller.use)) continue;
    for (const SuiteReference& reference : suite.references)
      if (!reference.constant())
        top.fail(top.line("reference"),
                 fmt::format("reference '{}': controller '{}' takes one velocity for the whole episode: expected no "
                             "begin, end and pause",
                             reference.name, controller.name));
  }
}

// What a suite of references has in the place of policies, tasks and people.
void lead_by_velocity(Suite& suite) {
  suite.policies = {SuitePolicy{.name = kVelocityPolicy, .use = "replay"}};
  suite.null_arm = false;
  suite.partner = PartnerMode::kNone;
  suite.start = SuiteStart::kClip;
}

void read_lists(const YamlSection& top, Suite& suite) {
  if (!suite.references.empty()) {
    read_engines(top, suite);
    read_controllers(top, suite);
    suite.perturbations = read_perturbations(top, suite.file);
    check_commands(top, suite);
    lead_by_velocity(suite);
    return;
  }
  if (top.has("tasks")) {
    checked(top, "tasks", [&] {
      for (const std::string& task : get_texts(top, "tasks")) suite.tasks.push_back(parse_task(task));
      require(!suite.tasks.empty(), "expected at least one task, found none");
    });
  } else {
    suite.tasks.assign(kPaperTasks.begin(), kPaperTasks.end());
  }
  read_engines(top, suite);
  read_controllers(top, suite);
  read_policies(top, suite);
  suite.perturbations = read_perturbations(top, suite.file);
  for (const ClipVariant& variant : suite.clips.variants) check_variant(top, variant, suite);
}

// A name, a path (from the suite's folder or from here), or the mapping that a run directory keeps. `dt` is the step of
// all engines.
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
  if (!top.has("dt")) return;
  const double dt = top.number("dt");
  checked(top, "dt", [&] { check_step(dt); });
  // Of every engine that duet knows, not of those that `engines: all` is on this machine: the suite's hash says it.
  for (const EngineInfo& engine : engines())
    suite.profile.engines[engine.name] = {dt, suite.profile.settings(engine.name).options};
}

void read_episode(const YamlSection& top, Suite& suite) {
  get_integer(top, "episodes_per_clip", 1, suite.episodes_per_clip);
  get_enum(top, "start", start_names(), suite.start);
  get(top, "start_radius", suite.start_radius);
  checked(top, "start_radius", [&] {
    require(suite.start_radius >= 0.0 && suite.start_radius <= 5.0,
            fmt::format("expected 0 to 5 m, found {}", suite.start_radius));
  });
  get_enum(top, "partner", partner_names(), suite.partner);
  get_integer(top, "fuse_ticks", 1, suite.fuse_ticks);
  checked(top, "fuse_ticks", [&] { static_cast<void>(Scheduler({.fuse_ticks = suite.fuse_ticks})); });
  get(top, "robot", suite.robot);
  if (is_plain_name(suite.robot) && !suite.robot.ends_with(".yaml"))
    checked(top, "robot", [&] { suite.robot = shipped_card(suite.robot); });
  else if (!suite.robot.empty())
    suite.robot = from_folder_of(suite, suite.robot);
  if (top.has("contact_limits")) suite.contact_limits = from_folder_of(suite, top.text("contact_limits"));
  if (top.has("null_arm")) suite.null_arm = top.flag_or("null_arm", true);
  const YamlSection detector = below(top, suite.file, "detector", {"version", "thresholds"});
  get_enum(detector, "version", version_names(), suite.detector);
  get_enum(detector, "thresholds", threshold_names(), suite.thresholds);
  const YamlSection limits = below(top, suite.file, "limits", {"wall_s_per_episode"});
  get(limits, "wall_s_per_episode", suite.wall_limit);
  checked(limits, "wall_s_per_episode", [&] {
    require(suite.wall_limit > 0.0 && suite.wall_limit <= 1.0e6,
            fmt::format("expected more than 0 s and at most 1000000 s, found {}", suite.wall_limit));
  });
  const YamlSection record = below(top, suite.file, "record", {"trajectories"});
  get_enum(record, "trajectories", record_names(), suite.record);
}

// A map whose keys and values another room checks.
template <typename Set>
void read_choices(const YamlSection& top, const char* key, const Set& set, std::map<std::string, std::string>& out) {
  if (!top.has(key)) return;
  const YAML::Node node = top.node(key);
  if (!node.IsMap()) top.fail(top.line(key), fmt::format("{}: expected a mapping, found {}", key, describe(node)));
  for (const auto& entry : node) {
    const std::string name = entry.first.as<std::string>();
    if (!entry.second.IsScalar())
      top.fail(entry.first.Mark().line + 1,
               fmt::format("{}.{}: expected one value, found {}", key, name, describe(entry.second)));
    try {
      set(name, entry.second.Scalar());
    } catch (const std::invalid_argument& error) {
      top.fail(entry.first.Mark().line + 1, fmt::format("{}: {}", key, error.what()));
    }
    out[name] = entry.second.Scalar();
  }
}

Suite read_suite(const YAML::Node& document, const std::string& file) {
  Suite suite;
  suite.file = file;
  const YamlSection top(
      file, document, "suite",
      {"schema",         "name",         "version",     "seed",       "clips",         "reference",
       "tasks",          "engines",      "controllers", "policies",   "perturbations", "episodes_per_clip",
       "start",          "start_radius", "partner",     "fuse_ticks", "profile",       "dt",
       "contact_limits", "robot",        "detector",    "limits",     "record",        "null_arm",
       "retarget",       "readings"});
  const std::string schema = top.text("schema");
  if (schema != "duet.suite/1")
    top.fail(top.line("schema"), fmt::format("schema: expected 'duet.suite/1', found '{}'", schema));
  suite.name = top.text("name");
  suite.version = top.text("version");
  get_integer<std::uint64_t>(top, "seed", 0, suite.seed);
  suite.references = read_references(top, file);
  if (suite.references.empty())
    read_clips(top, suite);
  else
    refuse_clips(top);
  read_lists(top, suite);
  read_profile_key(top, suite);
  read_episode(top, suite);
  const std::size_t variants = std::max<std::size_t>(1, suite.clips.variants.size());
  const std::size_t made = suite.clips.synth_per_task * suite.tasks.size() * variants;
  require_sane_size(suite, static_cast<std::int64_t>(made + suite.clips.files.size() + suite.references.size()));
  PairOptions pair;
  Readings readings;
  read_choices(
      top, "retarget", [&](const auto& name, const auto& value) { set_pair_option(pair, name, value); },
      suite.retarget);
  read_choices(
      top, "readings", [&](const auto& name, const auto& value) { set_reading(readings, name, value); },
      suite.readings);
  return suite;
}

// Sets document[a][b]... = value for the key "a.b...". Names of readings have a dot of their own.
void apply_override(const YAML::Node& document, const std::string& key, const std::string& value,
                    const std::string& file) {
  YAML::Node node(document);  // yaml-cpp nodes are references; reset() points one elsewhere
  std::string rest = key;
  for (size_t dot = rest.find('.'); dot != std::string::npos; dot = rest.find('.')) {
    const std::string head = rest.substr(0, dot);
    const YAML::Node child = node[head];
    node.reset(child);
    rest = rest.substr(dot + 1);
    if (head == "readings") break;
  }
  node[rest] = parse_yaml(value, file);
}

Suite read_with(const std::string& yaml, const std::string& name, const Overrides& overrides) {
  const YAML::Node document = parse_yaml(yaml, name);
  if (!document.IsMap())
    throw InputError(fmt::format("{}:1: expected a suite (a mapping), found {}", name, describe(document)));
  for (const auto& [key, value] : overrides) {
    try {
      apply_override(document, key, value, name);
    } catch (const YAML::Exception& error) {
      throw InputError(fmt::format("{}:1: {}", name, error.msg));
    }
  }
  return read_suite(document, name);
}

// The message of the suite without one of its overrides; "" where it is in order.
std::string message_without(std::size_t left_out, const std::string& yaml, const std::string& name,
                            Overrides overrides) {
  overrides.erase(overrides.begin() + static_cast<std::ptrdiff_t>(left_out));
  try {
    static_cast<void>(read_with(yaml, name, overrides));
    return "";
  } catch (const std::exception& error) {
    return error.what();
  }
}

// Without "FILE:LINE: " at its head.
std::string without_place(const std::string& message, const std::string& file) {
  if (!message.starts_with(file + ":")) return message;
  const std::size_t digits = message.find_first_not_of("0123456789", file.size() + 1);
  if (digits == std::string::npos || digits == file.size() + 1 || !message.substr(digits).starts_with(": "))
    return message;
  return message.substr(digits + 2);
}

// An override has no line in the file: the one without which the message goes away or changes takes its place.
std::string blamed(const std::string& message, const std::string& yaml, const std::string& name,
                   const Overrides& overrides) {
  for (std::size_t i = overrides.size(); i-- > 0;)
    if (message_without(i, yaml, name, overrides) != message)
      return fmt::format("override '{}={}': {}", overrides[i].first, shown(overrides[i].second),
                         without_place(message, name));
  return message;
}

}  // namespace

Suite parse_suite(const std::string& yaml, const std::string& name, const Overrides& overrides) {
  try {
    return read_with(yaml, name, overrides);
  } catch (const InputError& error) {
    throw InputError(blamed(error.what(), yaml, name, overrides));
  }
}

Suite load_suite(const std::string& path, const Overrides& overrides) {
  return parse_suite(read_text(path), path, overrides);
}

}  // namespace duet
