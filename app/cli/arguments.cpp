#include "duet/app/cli/arguments.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "duet/app/command.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/actuation_limits.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/metrics/contact_limits.h"

namespace duet::cli {

void add_field(CLI::App& command, const FieldDoc& words, const std::string& values, const std::string& fallback,
               const std::function<std::string(const std::string&)>& set, bool many) {
  FieldDoc flag = words;
  flag.name = "--" + words.name;
  std::replace(flag.name.begin(), flag.name.end(), '_', '-');
  const auto read = [flag, set](const std::vector<std::string>& texts) {
    const std::string text = fmt::format("{}", fmt::join(texts, " "));
    const std::string expected = set(text);
    require(expected.empty(), field_refusal(flag, expected, text, ""));
  };
  command
      .add_option_function<std::vector<std::string>>((words.name == "output" ? "-o," : "") + flag.name, read,
                                                     fmt::format("{} ({})", words.meaning, values))
      ->expected(1, many ? CLI::detail::expected_max_vector_size : 1)
      ->type_name("")
      ->default_str(fallback);
}

namespace {

// Sets the network of a controller or a policy; a name that is neither is refused with both.
void set_network(Suite& suite, const std::string& actor, const std::string& path) {
  const std::vector<std::string> policies = suite.policy_names();
  std::vector<std::string> known = suite.controller_names();
  if (std::find(known.begin(), known.end(), actor) != known.end()) {
    set_controller_option(suite, actor, "network", path);
  } else if (std::find(policies.begin(), policies.end(), actor) != policies.end()) {
    set_policy_option(suite, actor, "network", path);
  } else {
    known.insert(known.end(), policies.begin(), policies.end());
    throw std::invalid_argument(unknown_name_message("controller or policy", actor, known));
  }
}

}  // namespace

void add_filters(CLI::App& command, EpisodeFilter& part) {
  command.add_option("--engines", part.engines, "only these")->delimiter(',');
  command.add_option("--controllers", part.controllers, "only these")->delimiter(',');
  command.add_option("--policies", part.policies, "only these (the null arm always runs)")->delimiter(',');
  command.add_option("--tasks", part.tasks, "only these")->delimiter(',');
  command.add_option("--perturbations", part.perturbations, "only these (playback is always clean)")->delimiter(',');
}

Suite suite_of(const SuiteArguments& arguments) {
  Overrides overrides;
  for (const std::string& text : arguments.overrides) overrides.push_back(split_assignment(text));
  if (!arguments.start.empty()) overrides.emplace_back("start", arguments.start);
  if (!arguments.partner.empty()) overrides.emplace_back("partner", arguments.partner);
  if (!arguments.profile.empty()) overrides.emplace_back("profile", arguments.profile);
  Suite suite = load_suite(suite_file(arguments.suite), overrides);
  suite.allow_programs = arguments.allow_programs;
  use_clips(arguments.clips, suite);
  suite.require_clips();
  for (const std::string& text : arguments.networks) {
    const auto [actor, path] = split_assignment(text);
    set_network(suite, actor, std::filesystem::absolute(path).lexically_normal().string());
  }
  // A table that is broken is told before the first episode.
  if (!suite.contact_limits.empty()) static_cast<void>(load_contact_limits(suite.contact_limits));
  require_bearable_law(suite);
  return suite;
}

void add_suite_options(CLI::App& command, SuiteArguments& arguments) {
  command.add_option("suite", arguments.suite, "suite file (YAML), or the name of one that ships (`duet list suites`)")
      ->required();
  command.add_option("--clips", arguments.clips,
                     "clips or paired motions (NPZ, folders), or a data set's people, in the place of the suite's");
  command.add_option("-s,--set", arguments.overrides, "key=value, dotted: overrides the suite (repeatable)");
  command.add_option("--network", arguments.networks,
                     "NAME=PATH: the network of one of the suite's controllers or policies (repeatable)");
  command.add_option("--start", arguments.start, "auto, clip, approach, act or sim_to_real: where episodes begin");
  command.add_option("--partner", arguments.partner, "none, ghost, solid or yielding");
  command.add_option("--profile", arguments.profile, "engine profile: parity, fast, accurate or a file");
  add_allow_programs(command, arguments.allow_programs);
}

}  // namespace duet::cli
