// duet blame: whether a failed episode fails in every engine, and from when on.
#include "duet/execution/blame.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "duet/app/cli/run_notes.h"
#include "duet/app/command.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/execution/verification.h"
#include "duet/rows/groups/row_groups.h"

namespace duet::cli {
namespace {

struct BlameArguments {
  std::string run, episode;
  EpisodeFilter part;
  BlameOptions options;
  VerifyOptions setup;
};

std::string name_of(const EpisodeRow& row) {
  return fmt::format("{}/{}/{} in {} under {}, {}, {} ({:.16})", row.task, row.clip, row.episode, row.engine,
                     row.controller, row.policy, row.perturbation, row.key);
}

bool is_named(const EpisodeRow& row, const BlameArguments& arguments) {
  const std::string id = fmt::format("{}/{}/{}", row.task, row.clip, row.episode);
  const EpisodeFilter& part = arguments.part;
  return (row.key.starts_with(arguments.episode) || id == arguments.episode ||
          id.starts_with(arguments.episode + "/")) &&
         row.engine != kPlaybackEngine && chosen(part.engines, row.engine) &&
         chosen(part.controllers, row.controller) && chosen(part.policies, row.policy) &&
         chosen(part.perturbations, row.perturbation);
}

// The only failed row that is named. Throws where there is none, or where there are several.
const EpisodeRow& named_row(const Run& run, const BlameArguments& arguments) {
  constexpr std::size_t kShown = 5;
  std::vector<const EpisodeRow*> named, failed;
  for (const EpisodeRow& row : run.rows) {
    if (!is_named(row, arguments)) continue;
    named.push_back(&row);
    if (!headline_success(row)) failed.push_back(&row);
  }
  require(!named.empty(),
          "no episode in an engine begins with '{}': expected the beginning of a key, or task/clip/episode",
          excerpt(arguments.episode));
  require(!failed.empty(), "{} succeeds: there is nothing to blame", name_of(*named.front()));
  if (failed.size() == 1) return *failed.front();
  std::vector<std::string> names;
  for (const EpisodeRow* row : failed)
    if (names.size() < kShown) names.push_back(name_of(*row));
  throw std::invalid_argument(
      fmt::format("'{}' names {} failed episodes: expected one (a key, or --engine, --controller, --policy, "
                  "--perturbation); the first are {}",
                  excerpt(arguments.episode), failed.size(), fmt::join(names, "; ")));
}

void run_blame(Session& session, const BlameArguments& arguments) {
  const Run run = open_run(arguments.run);
  const EpisodeRow& row = named_row(run, arguments);
  Progress progress(session.progress());
  Blame blame;
  with_episode(run, row.key, arguments.setup, progress, [&](const Experiment& experiment, const EpisodeSpec& spec) {
    blame = blame_episode(experiment, spec, arguments.options, progress);
  });
  if (blame.row.state_hash != row.state_hash)
    warn("the episode that was run again has other states than the run's row has; `duet verify` says why");
  print(session, blame_text(blame), blame_json(blame));
  suggest_next(session, fmt::format("duet replay {} --episodes {:.16}", shell_word(arguments.run), row.key));
}

}  // namespace

void add_blame(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "blame",
      "whose is a failure: restarts a failed episode in every engine from the states that it had before, jittered",
      "duet blame runs/core hug/hug_003/0 --engine bullet --policy dstar");
  auto arguments = std::make_shared<BlameArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("episode", arguments->episode, "the beginning of an episode's key, or task/clip/episode")
      ->required();
  command->add_option("--engine", arguments->part.engines, "of the episode")->expected(1);
  command->add_option("--controller", arguments->part.controllers, "of the episode")->expected(1);
  command->add_option("--policy", arguments->part.policies, "of the episode")->expected(1);
  command->add_option("--perturbation", arguments->part.perturbations, "of the episode")->expected(1);
  command
      ->add_option("--restart-in", arguments->options.engines,
                   "engines beside the episode's own (default: all that are there)")
      ->delimiter(',');
  command->add_option("--before", arguments->options.before, "how long before the failure restarts begin [s]")
      ->delimiter(',')
      ->capture_default_str()
      ->check(CLI::Range(0.02, 60.0));
  command->add_option("--jitters", arguments->options.jitters, "restarts in each engine from each state")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  command->add_option("--seed", arguments->options.seed, "of the jitters")->capture_default_str();
  command
      ->add_option("--clips", arguments->setup.clips,
                   "file or folder with the clips, where the run was published without them")
      ->check(CLI::ExistingPath);
  arguments->options.threads = default_threads();
  add_threads(command, arguments->options.threads);
  add_allow_programs(*command, arguments->setup.allow_programs);
  command->callback([&session, arguments] {
    arguments->setup.threads = arguments->options.threads;
    run_blame(session, *arguments);
  });
}

}  // namespace duet::cli
