#include "bench/suite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <filesystem>

#include "backends/factory.h"
#include "bench/strict_yaml.h"
#include "controllers/controller.h"
#include "core/digest.h"
#include "core/file.h"
#include "core/names.h"
#include "core/require.h"
#include "metrics/readings.h"
#include "policies/policy.h"
#include "retarget/options.h"

namespace duet {
namespace {

template <typename E>
using NameTable = std::vector<std::pair<std::string, E>>;

const NameTable<SuiteStart>& start_names() {
  static const NameTable<SuiteStart> names = {{"auto", SuiteStart::kAuto},
                                              {"clip", SuiteStart::kClip},
                                              {"approach", SuiteStart::kApproach},
                                              {"act", SuiteStart::kAct}};
  return names;
}

const NameTable<PartnerMode>& partner_names() {
  static const NameTable<PartnerMode> names = {
      {"none", PartnerMode::kNone}, {"ghost", PartnerMode::kGhost}, {"solid", PartnerMode::kSolid}};
  return names;
}

const NameTable<RecordTrajectories>& record_names() {
  static const NameTable<RecordTrajectories> names = {{"none", RecordTrajectories::kNone},
                                                      {"failures", RecordTrajectories::kFailures},
                                                      {"all", RecordTrajectories::kAll}};
  return names;
}

const NameTable<DetectorVersion>& version_names() {
  static const NameTable<DetectorVersion> names = {{"robot", DetectorVersion::kRobot},
                                                   {"paper", DetectorVersion::kPaper}};
  return names;
}

const NameTable<ThresholdSet>& threshold_names() {
  static const NameTable<ThresholdSet> names = {{"paper", ThresholdSet::kPaper}, {"strict", ThresholdSet::kStrict}};
  return names;
}

template <typename E>
std::vector<std::string> keys_of(const NameTable<E>& table) {
  std::vector<std::string> keys;
  for (const auto& [name, value] : table) keys.push_back(name);
  return keys;
}

template <typename E>
E value_of(const NameTable<E>& table, const std::string& kind, const std::string& name) {
  for (const auto& [known, value] : table)
    if (known == name) return value;
  throw std::invalid_argument(unknown_name_message(kind, name, keys_of(table)));
}

template <typename E>
std::string_view name_of(const NameTable<E>& table, E value) {
  for (const auto& [name, known] : table)
    if (known == value) return name;
  return "?";
}

template <typename E>
void get_enum(StrictMap& map, const std::string& key, const NameTable<E>& table, E& out) {
  std::string text;
  map.get(key, text);
  if (!text.empty()) map.checked(key, [&] { out = value_of(table, key, text); });
}

void check_known(StrictMap& map, const std::string& key, const std::string& kind, const std::vector<std::string>& names,
                 const std::vector<std::string>& known) {
  map.checked(key, [&] {
    require(!names.empty(), fmt::format("expected at least one {}, found none", kind));
    for (const std::string& name : names) {
      require(std::find(known.begin(), known.end(), name) != known.end(), unknown_name_message(kind, name, known));
    }
  });
}

std::vector<std::string> engine_names() {
  std::vector<std::string> names;
  for (const EngineInfo& engine : engines()) names.push_back(engine.name);
  return names;
}

void read_clips(StrictMap& top, Suite& suite) {
  StrictMap clips = top.map("clips");
  StrictMap synth = clips.map("synth");
  synth.get("per_task", suite.clips.synth_per_task);
  synth.get("seed", suite.clips.synth_seed);
  synth.finish();
  clips.get("files", suite.clips.files);
  clips.finish();
  clips.checked("files", [&] {
    require(suite.clips.synth_per_task > 0 || !suite.clips.files.empty(),
            "expected clips: either 'clips.synth.per_task' above 0 or 'clips.files'");
    require(suite.clips.synth_per_task == 0 || suite.clips.files.empty(),
            "expected either 'clips.synth' or 'clips.files', found both");
  });
  const std::filesystem::path folder = std::filesystem::path(suite.file).parent_path();
  for (std::string& file : suite.clips.files) {
    if (std::filesystem::path(file).is_relative() && !folder.empty() && !std::filesystem::exists(file)) {
      file = (folder / file).lexically_normal().string();
    }
  }
}

void read_lists(StrictMap& top, Suite& suite) {
  std::vector<std::string> tasks;
  for (const Task task : kTasks) tasks.emplace_back(to_string(task));
  top.get("tasks", tasks);
  top.checked("tasks", [&] {
    require(!tasks.empty(), "expected at least one task, found none");
    for (const std::string& task : tasks) suite.tasks.push_back(parse_task(task));
  });
  top.get("engines", suite.engines);
  top.get("controllers", suite.controllers);
  top.get("policies", suite.policies);
  check_known(top, "engines", "engine", suite.engines, engine_names());
  check_known(top, "controllers", "controller", suite.controllers, controller_names());
  check_known(top, "policies", "policy", suite.policies, policy_names());
}

void read_episode(StrictMap& top, Suite& suite) {
  top.get("episodes_per_clip", suite.episodes_per_clip);
  get_enum(top, "start", start_names(), suite.start);
  top.get("start_radius", suite.start_radius);
  get_enum(top, "partner", partner_names(), suite.partner);
  top.get("dt", suite.dt);
  top.get("robot", suite.robot);
  StrictMap detector = top.map("detector");
  get_enum(detector, "version", version_names(), suite.detector);
  get_enum(detector, "thresholds", threshold_names(), suite.thresholds);
  detector.finish();
  StrictMap limits = top.map("limits");
  limits.get("wall_s_per_episode", suite.wall_limit);
  limits.finish();
  StrictMap record = top.map("record");
  get_enum(record, "trajectories", record_names(), suite.record);
  record.finish();
  top.get("null_arm", suite.null_arm);
  top.checked("episodes_per_clip", [&] { require(suite.episodes_per_clip >= 1, "expected 1 or more"); });
  top.checked("dt", [&] {
    require(suite.dt > 0.0 && suite.dt <= 0.02, fmt::format("expected a step in (0, 0.02] s, found {}", suite.dt));
    const double ratio = 0.02 / suite.dt;
    require(std::abs(ratio - std::round(ratio)) < 1e-9,
            fmt::format("expected a whole number of steps in 20 ms, found {:.4g}", ratio));
  });
  top.checked("start_radius",
              [&] { require(suite.start_radius >= 0.0 && suite.start_radius <= 5.0, "expected 0 to 5 m"); });
  limits.checked("wall_s_per_episode", [&] { require(suite.wall_limit > 0.0, "expected more than 0 s"); });
}

void read_options(StrictMap& top, Suite& suite) {
  StrictMap retarget = top.map("retarget");
  PairOptions options;
  for (const auto& [name, value] : retarget.entries()) {
    retarget.checked(name, [&, n = name, v = value] { set_pair_option(options, n, v); });
    suite.retarget[name] = value;
  }
  StrictMap readings = top.map("readings");
  Readings chosen;
  for (const auto& [name, value] : readings.entries()) {
    readings.checked(name, [&, n = name, v = value] { set_reading(chosen, n, v); });
    suite.readings[name] = value;
  }
}

Suite read_suite(const YAML::Node& document, const std::string& file) {
  Suite suite;
  suite.file = file;
  StrictMap top(document, file, "");
  std::string schema;
  top.get("schema", schema);
  top.checked("schema", [&] {
    require(schema == "duet.suite/1", fmt::format("expected 'duet.suite/1', found '{}'", schema));
  });
  top.get("name", suite.name);
  top.get("version", suite.version);
  top.checked("name", [&] { require(!suite.name.empty(), "expected a name, found none"); });
  top.checked("version", [&] { require(!suite.version.empty(), "expected a version, found none"); });
  top.get("seed", suite.seed);
  read_clips(top, suite);
  read_lists(top, suite);
  read_episode(top, suite);
  read_options(top, suite);
  top.finish();
  return suite;
}

void apply_override(YAML::Node document, const std::string& key, const std::string& value, const std::string& file) {
  // yaml-cpp nodes are references: assignment through a chain of them needs fresh handles, hence reset().
  YAML::Node node;
  node.reset(document);
  std::string rest = key;
  for (size_t dot = rest.find('.'); dot != std::string::npos && key.rfind("readings.", 0) != 0; dot = rest.find('.')) {
    YAML::Node child = node[rest.substr(0, dot)];
    node.reset(child);
    rest = rest.substr(dot + 1);
  }
  if (key.rfind("readings.", 0) == 0) {
    YAML::Node child = node["readings"];
    node.reset(child);
    rest = key.substr(std::string("readings.").size());
  }
  node[rest] = parse_yaml(value, fmt::format("{} (override '{}')", file, key));
}

}  // namespace

std::string_view to_string(SuiteStart start) { return name_of(start_names(), start); }
std::string_view to_string(PartnerMode partner) { return name_of(partner_names(), partner); }

Suite parse_suite(const std::string& yaml, const std::string& name, const Overrides& overrides) {
  YAML::Node document = parse_yaml(yaml, name);
  if (!document.IsMap()) throw InputError(fmt::format("{}:1: expected a suite (a map), found none", name));
  for (const auto& [key, value] : overrides) apply_override(document, key, value, name);
  return read_suite(document, name);
}

Suite load_suite(const std::string& path, const Overrides& overrides) {
  return parse_suite(read_file(path), path, overrides);
}

std::string resolved_yaml(const Suite& suite) {
  std::vector<std::string_view> tasks;
  for (const Task task : suite.tasks) tasks.push_back(to_string(task));
  std::string text = fmt::format("schema: duet.suite/1\nname: {}\nversion: \"{}\"\nseed: {}\n", suite.name, suite.version,
                                 suite.seed);
  if (suite.clips.files.empty()) {
    text += fmt::format("clips: {{synth: {{per_task: {}, seed: {}}}}}\n", suite.clips.synth_per_task,
                        suite.clips.synth_seed);
  } else {
    text += "clips:\n  files:\n";
    for (const std::string& file : suite.clips.files) text += fmt::format("    - \"{}\"\n", file);
  }
  text += fmt::format("tasks: [{}]\nengines: [{}]\ncontrollers: [{}]\npolicies: [{}]\n", fmt::join(tasks, ", "),
                      fmt::join(suite.engines, ", "), fmt::join(suite.controllers, ", "), fmt::join(suite.policies, ", "));
  text += fmt::format("episodes_per_clip: {}\nstart: {}\nstart_radius: {}\npartner: {}\ndt: {}\nrobot: \"{}\"\n",
                      suite.episodes_per_clip, to_string(suite.start), suite.start_radius, to_string(suite.partner),
                      suite.dt, suite.robot);
  text += fmt::format("detector: {{version: {}, thresholds: {}}}\n", to_string(suite.detector), to_string(suite.thresholds));
  text += fmt::format("limits: {{wall_s_per_episode: {}}}\nrecord: {{trajectories: {}}}\nnull_arm: {}\n", suite.wall_limit,
                      name_of(record_names(), suite.record), suite.null_arm);
  const auto add_map = [&](const char* key, const std::map<std::string, std::string>& map) {
    if (map.empty()) return;
    text += fmt::format("{}:\n", key);
    for (const auto& [name, value] : map) text += fmt::format("  {}: {}\n", name, value);
  };
  add_map("retarget", suite.retarget);
  add_map("readings", suite.readings);
  return text;
}

std::string suite_hash(const Suite& suite) {
  Suite by_content = suite;   // where a file lies does not matter, what is in it does
  for (std::string& file : by_content.clips.files) file = sha256_file(file);
  return sha256_hex(resolved_yaml(by_content));
}

}  // namespace duet
