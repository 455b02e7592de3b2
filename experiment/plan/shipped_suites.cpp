#include "duet/experiment/plan/shipped_suites.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <sstream>

#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_section.h"
#include "duet/rows/folder/run_info.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

std::string path_of(const std::string& name) {
  return share_file(fmt::format("suite '{}'", name), fmt::format("suites/{}.yaml", name));
}

// The comment lines that begin the file, in one.
std::string head_comment(const std::string& yaml) {
  std::istringstream lines(yaml);
  std::string comment;
  for (std::string line; std::getline(lines, line) && line.starts_with("# ");)
    comment += (comment.empty() ? "" : " ") + line.substr(2);
  return comment;
}

// The suite that ships and calls itself so in its file; none where there is none.
std::optional<Suite> suite_that_ships(const std::string& name) {
  for (const std::string& file : shipped_suite_names())
    if (Suite suite = load_suite(path_of(file)); suite.name == name) return suite;
  return std::nullopt;
}

// Keys of a suite as it is written out, with their values; without those that its hash leaves out.
std::map<std::string, std::string> hashed_keys(Suite suite) {
  suite.policies.clear();
  suite.engines.clear();
  suite.clear_tags();
  std::map<std::string, std::string> keys;
  for (const auto& entry : parse_yaml(resolved_yaml(suite), "suite.yaml")) {
    const auto name = entry.first.as<std::string>();
    if (name != "policies" && name != "engines") keys[name] = YAML::Dump(entry.second);
  }
  return keys;
}

std::vector<std::string> differing_keys(const Suite& one, const Suite& other) {
  const std::map<std::string, std::string> a = hashed_keys(one), b = hashed_keys(other);
  std::vector<std::string> names;
  for (const auto& [name, value] : a)
    if (const auto found = b.find(name); found == b.end() || found->second != value) names.push_back(name);
  for (const auto& [name, value] : b)
    if (!a.contains(name)) names.push_back(name);
  std::ranges::sort(names);
  return names;
}

// Names the cause of a different hash: keys of the suite, or files that they name.
std::string difference_note(const Suite& shipped, const RunInfo& info) {
  const Suite run = parse_run_suite(info.suite_yaml, info.suite_file);
  const std::vector<std::string> keys = differing_keys(shipped, run);
  if (keys == std::vector<std::string>{"clips"} && !run.clips.files.empty())
    return "as it ships but for its clips, which were given";
  return fmt::format("NOT the suite of that name that ships with this program: it differs in {}",
                     keys.empty() ? "its robots, limits or detectors" : fmt::format("{}", fmt::join(keys, ", ")));
}

}  // namespace

std::vector<std::string> shipped_suite_names() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(fs::path(path_of("demo")).parent_path()))
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  std::ranges::sort(names);
  return names;
}

ShippedSuite shipped_suite(const std::string& name) {
  const std::string file = path_of(name);
  const Suite suite = load_suite(file);
  return {name, fmt::format("{} {}", suite.name, suite.version), first_sentence(read_file(file)),
          count_episodes(suite, suite.tasks_of_own_clips(), {EpisodeFilter()}), suite.clips.given};
}

std::string suite_file(const std::string& suite) {
  std::error_code ignored;
  const bool is_path = suite.ends_with(".yaml") || suite.find('/') != std::string::npos;
  if (is_path || (fs::exists(suite, ignored) && !fs::is_directory(suite, ignored))) return suite;
  const std::vector<std::string> names = shipped_suite_names();
  if (std::ranges::find(names, suite) == names.end())
    throw std::invalid_argument(unknown_name_message("suite", suite, names) + "; or the path of a file");
  return path_of(suite);
}

std::optional<Suite> shipped_suite_of(const RunInfo& info) {
  std::optional<Suite> shipped = suite_that_ships(info.suite);
  const bool same = shipped && !shipped->clips.given && suite_hash(*shipped) == info.suite_hash;
  return same ? std::move(shipped) : std::nullopt;
}

std::string shipped_suite_note(const RunInfo& info) {
  try {
    const std::optional<Suite> shipped = suite_that_ships(info.suite);
    if (!shipped) return "";
    for (const SuiteController& controller : shipped->controllers)  // where a robot is absent nothing can be said
      (void)load_shared_robot(shipped->card_of(controller));
    const bool same = !shipped->clips.given && suite_hash(*shipped) == info.suite_hash;
    return fmt::format("{} ({})", same ? "as it ships" : difference_note(*shipped, info),
                       excerpt(short_digest(info.suite_hash)));
  } catch (const MissingError&) {
    return "";
  } catch (const InputError&) {  // a suite.yaml that this program does not read is none that ships
    return fmt::format("NOT the suite of that name that ships with this program ({})",
                       excerpt(short_digest(info.suite_hash)));
  }
}

std::string first_sentence(const std::string& yaml) {
  std::string comment = head_comment(yaml);
  for (std::size_t i = 0; i < comment.size(); ++i) {
    const bool ends = comment[i] == '.' || comment[i] == '?';
    if (ends && (i + 1 == comment.size() || comment[i + 1] == ' ')) return comment.substr(0, i + 1);
  }
  return comment;
}

}  // namespace duet
