#include "bench/suite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "bench/suite_names.h"
#include "core/digest.h"

namespace duet {

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

std::string_view to_string(SuiteStart start) { return name_of(start_names(), start); }
std::string_view to_string(PartnerMode partner) { return name_of(partner_names(), partner); }

std::string resolved_yaml(const Suite& suite) {
  std::vector<std::string_view> tasks;
  for (const Task task : suite.tasks) tasks.push_back(to_string(task));
  std::string text =
      fmt::format("schema: duet.suite/1\nname: {}\nversion: \"{}\"\nseed: {}\n", suite.name, suite.version, suite.seed);
  if (suite.clips.files.empty()) {
    text += fmt::format("clips: {{synth: {{per_task: {}, seed: {}}}}}\n", suite.clips.synth_per_task,
                        suite.clips.synth_seed);
  } else {
    text += "clips:\n  files:\n";
    for (const std::string& file : suite.clips.files) text += fmt::format("    - \"{}\"\n", file);
  }
  text +=
      fmt::format("tasks: [{}]\nengines: [{}]\ncontrollers: [{}]\npolicies: [{}]\n", fmt::join(tasks, ", "),
                  fmt::join(suite.engines, ", "), fmt::join(suite.controllers, ", "), fmt::join(suite.policies, ", "));
  text += fmt::format("episodes_per_clip: {}\nstart: {}\nstart_radius: {}\npartner: {}\n", suite.episodes_per_clip,
                      to_string(suite.start), suite.start_radius, to_string(suite.partner));
  std::vector<std::string> settings;
  for (const std::string& engine : suite.engines)
    if (engine != "playback")
      settings.push_back(
          fmt::format("\n    {}: {}", engine, resolved_settings(engine, suite.profile.settings(engine))));
  text += fmt::format("profile:\n  name: {}\n  engines:{}\n", suite.profile.name,
                      settings.empty() ? " {}" : fmt::format("{}", fmt::join(settings, "")));
  if (!suite.contact_limits.empty()) text += fmt::format("contact_limits: \"{}\"\n", suite.contact_limits);
  if (!suite.robot.empty()) text += fmt::format("robot: \"{}\"\n", suite.robot);
  text += fmt::format("detector: {{version: {}, thresholds: {}}}\n", to_string(suite.detector),
                      to_string(suite.thresholds));
  text += fmt::format("limits: {{wall_s_per_episode: {}}}\nrecord: {{trajectories: {}}}\nnull_arm: {}\n",
                      suite.wall_limit, name_of(record_names(), suite.record), suite.null_arm);
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
  Suite by_content = suite;  // where a file lies does not matter, what is in it does
  for (std::string& file : by_content.clips.files) file = sha256_file(file);
  if (!suite.contact_limits.empty()) by_content.contact_limits = sha256_file(suite.contact_limits);
  return sha256_hex(resolved_yaml(by_content));
}

}  // namespace duet
