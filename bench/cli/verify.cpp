// duet verify: runs episodes of a finished run again and compares the hashes of their state trajectories.
#include <fmt/format.h>

#include <algorithm>

#include "bench/bodies.h"
#include "bench/cli/command.h"
#include "bench/clips.h"
#include "bench/parallel.h"
#include "bench/runner.h"
#include "core/random.h"
#include "core/require.h"

namespace duet::cli {
namespace {

struct VerifyArguments {
  std::string run;
  int episodes = 5;
  std::uint64_t seed = 1;
  int threads = default_threads();
};

// `count` rows without replacement, from a seeded shuffle. Rows that ended with an error have no trajectory to compare.
std::vector<EpisodeRow> sample_rows(const Run& run, int count, std::uint64_t seed) {
  std::vector<EpisodeRow> rows;
  std::copy_if(run.rows.begin(), run.rows.end(), std::back_inserter(rows),
               [](const EpisodeRow& row) { return !row.state_hash.empty() && row.outcome != Outcome::kTimedOut; });
  Random random(seed, stream_key({"verify"}));
  for (size_t i = 0; i + 1 < rows.size(); ++i)
    std::swap(rows[i], rows[i + random.below(static_cast<int>(rows.size() - i))]);
  rows.resize(std::min<size_t>(rows.size(), count));
  return rows;
}

struct Check {
  EpisodeRow before;
  std::string now;  // state hash of the second run
};

std::vector<Check> run_again(const Run& run, const VerifyArguments& arguments, Progress& progress) {
  const Suite suite = parse_suite(run.info.suite_yaml, arguments.run + "/suite.yaml");
  if (suite_hash(suite) != run.info.suite_hash)
    throw InputError(fmt::format("'{}': the suite's clips are not what they were (hash {:.8}, was {:.8})",
                                 arguments.run, suite_hash(suite), run.info.suite_hash));
  Bodies bodies(suite);
  bodies.take_clips(prepare_clips(suite, *bodies.nominal(), arguments.threads, progress));
  const std::vector<EpisodeSpec> plan = plan_episodes(suite, bodies);
  std::vector<Check> checks;
  for (EpisodeRow& row : sample_rows(run, arguments.episodes, arguments.seed)) checks.push_back({std::move(row), ""});
  progress.start("running again", static_cast<int>(checks.size()), "episodes");
  parallel_for_each(static_cast<int>(checks.size()), arguments.threads, [&](int i) {
    for (const EpisodeSpec& spec : plan) {
      const std::shared_ptr<const RobotModel>& robot = bodies.robot(spec.controller);
      if (row_for(spec, suite, run.info.suite_hash, *robot).key != checks[i].before.key) continue;
      const PolicyMaker& policy = bodies.policy(spec.controller, spec.policy).make;
      checks[i].now = run_episode(spec, suite, run.info.suite_hash, robot, "", policy).state_hash;
    }
    progress.advance();
  });
  progress.finish();
  return checks;
}

void run_verify(Session& session, const VerifyArguments& arguments) {
  const Run run = load_run(arguments.run);
  Progress progress(session.progress());
  const std::vector<Check> checks = run_again(run, arguments, progress);
  nlohmann::json json = nlohmann::json::array();
  std::string text;
  int different = 0;
  for (const Check& check : checks) {
    const bool same = check.now == check.before.state_hash;
    different += same ? 0 : 1;
    text += fmt::format("{:<9} {} {}/{}/{} {} {:.12} {:.12}\n", same ? "same" : "DIFFERENT", check.before.clip,
                        check.before.engine, check.before.controller, check.before.policy, check.before.arm,
                        check.before.state_hash, check.now);
    json.push_back(
        {{"key", check.before.key}, {"same", same}, {"before", check.before.state_hash}, {"now", check.now}});
  }
  require(!checks.empty(), fmt::format("'{}' has no episode to run again", arguments.run));
  text += fmt::format("{} of {} episodes repeat bit for bit", checks.size() - different, checks.size());
  print(session, text, {{"episodes", json}, {"different", different}});
  if (different > 0) session.exit_code = kExitDeterminism;
}

}  // namespace

void add_verify(CLI::App& app, Session& session) {
  CLI::App* command = add_command(
      app, session, "verify", "run episodes of a run again and compare state hashes (exit code 5 where they differ)",
      "duet verify runs/core --episodes 10");
  auto arguments = std::make_shared<VerifyArguments>();
  command->add_option("run", arguments->run, "run directory")->required();
  command->add_option("-k,--episodes", arguments->episodes, "how many, drawn at random")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command->add_option("--seed", arguments->seed, "of the draw")->capture_default_str();
  command->add_option("-j,--threads", arguments->threads, "threads")->capture_default_str();
  command->callback([&session, arguments] { run_verify(session, *arguments); });
}

}  // namespace duet::cli
