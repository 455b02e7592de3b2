#include "duet/hardware/guarded_episode.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/hardware/guard_loop.h"
#include "duet/robots/robot_cards.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr double kRest = 0.2;  // that it is told to stand for after an episode [s]

GuardedEpisode guarded_episode(const RolloutSetup& setup, const RobotModel& robot, const GuardedOptions& options,
                               const PointTracks& partner) {
  GuardedEpisode episode;
  episode.limits = options.config.limits;
  episode.steps_from = options.steps_from;
  for (const std::vector<int>& arm : robot.roles.arms)
    episode.joints.insert(episode.joints.end(), arm.begin(), arm.end());
  episode.act_begin = setup.reference.phases.act_begin;
  episode.act_end = setup.reference.phases.act_end;
  episode.watch = options.watch;
  if (options.config.twin) episode.person = partner_of_clip(partner);  // a robot's camera speaks for itself
  return episode;
}

Rollout roll_out_guarded(const RolloutSetup& setup, const std::shared_ptr<const RobotModel>& robot, Policy& policy,
                         GuardLink& link, const GuardedOptions& options, GuardedRun& run) {
  GuardedEpisode episode = guarded_episode(setup, *robot, options, episode_partner(setup).joints);
  run.executed = executed_mask(*robot, episode.joints, true);
  GuardedWorld world(std::move(episode), robot, link);
  Rollout rollout = roll_out(setup, world, policy, options.engine);
  run.interrupted = std::exchange(rollout.interrupted, false);
  run.clamps = world.clamps();
  run.held_ticks = world.held_ticks();
  run.guard_seconds = world.report().now - world.began_at();
  run.missed_reports = world.missed_reports();
  if (!options.recording.empty()) save_logged_run(rollout.recording, run.executed, options.recording);
  world.rest(kRest);
  return rollout;
}

std::string share_text(long k, long n, const Interval& interval) {
  return fmt::format("{} of {} = {:.1f} % [{:.1f}, {:.1f}]", k, n, n > 0 ? 100.0 * static_cast<double>(k) / n : 0.0,
                     100.0 * interval.low, 100.0 * interval.high);
}

}  // namespace

GuardedRun run_guarded_episode(const Experiment& experiment, const EpisodeSpec& spec, GuardLink& link,
                               const GuardedOptions& options) {
  GuardedRun run;
  const auto in_world = [&](const RolloutSetup& setup, Policy& policy) {
    return roll_out_guarded(setup, spec.body->robot, policy, link, options, run);
  };
  run.row = experiment.run(spec, {.stop_asked = options.stop_asked, .engine = options.engine, .world = in_world});
  return run;
}

PairedSuccess paired_success(const PairedEpisodes& episodes) {
  require(episodes.simulated.size() == episodes.guarded.size(),
          "paired episodes: expected as many rows of both, found {} and {}", episodes.simulated.size(),
          episodes.guarded.size());
  PairedSuccess result;
  result.n = static_cast<long>(episodes.simulated.size());
  EpisodePairs pairs;
  for (std::size_t i = 0; i < episodes.simulated.size(); ++i) {
    pairs.add(episodes.guarded[i], episodes.simulated[i]);
    const bool a = episodes.simulated[i].success.value_or(false), b = episodes.guarded[i].success.value_or(false);
    result.simulated += a ? 1 : 0;
    result.guarded += b ? 1 : 0;
    ++(a ? (b ? result.both : result.only_simulated) : (b ? result.only_guarded : result.neither));
  }
  result.simulated_95 = wilson(result.simulated, result.n);
  result.guarded_95 = wilson(result.guarded, result.n);
  result.difference_95 = newcombe_paired(result.both, result.only_guarded, result.only_simulated, result.neither);
  if (result.n > 0) result.p = pairs.p();
  result.clips = pairs.clips();
  const double share = result.n > 0 ? static_cast<double>(result.guarded) / static_cast<double>(result.n) : 0.0;
  result.inside = share >= result.simulated_95.low && share <= result.simulated_95.high;
  return result;
}

std::string paired_text(const PairedSuccess& success, const std::string& simulated, const std::string& guarded) {
  return fmt::format(
      "{:<24} {}\n{:<24} {}\nthe same episodes: both {}, only {} {}, only {} {}, neither {}\ndifference {:+.1f} points "
      "[{:.1f}, {:.1f}] (Newcombe, paired), exact test by clip over {} clips p = {:.3f}; {} lies {} the interval of {}",
      simulated, share_text(success.simulated, success.n, success.simulated_95), guarded,
      share_text(success.guarded, success.n, success.guarded_95), success.both, simulated, success.only_simulated,
      guarded, success.only_guarded, success.neither,
      success.n > 0 ? 100.0 * static_cast<double>(success.guarded - success.simulated) / success.n : 0.0,
      100.0 * success.difference_95.low, 100.0 * success.difference_95.high, success.clips, success.p, guarded,
      success.inside ? "inside" : "outside", simulated);
}

nlohmann::json paired_json(const PairedSuccess& success) {
  const auto interval = [](const Interval& values) { return nlohmann::json{values.low, values.high}; };
  return {{"n", success.n},
          {"simulated", success.simulated},
          {"guarded", success.guarded},
          {"both", success.both},
          {"only_simulated", success.only_simulated},
          {"only_guarded", success.only_guarded},
          {"neither", success.neither},
          {"simulated_95", interval(success.simulated_95)},
          {"guarded_95", interval(success.guarded_95)},
          {"difference_95", interval(success.difference_95)},
          {"clips", success.clips},
          {"p", success.p},
          {"inside", success.inside}};
}

Suite suite_of_clip(const std::string& clip, const std::string& policy, const std::string& start,
                    const std::string& controller) {
  const std::string file = std::filesystem::absolute(clip).lexically_normal().string();
  const nlohmann::json quoted = file;  // JSON's strings are YAML's
  std::vector<std::string_view> tasks;
  for (const Task task : all_tasks()) tasks.push_back(to_string(task));
  return parse_suite(
      fmt::format("schema: duet.suite/1\nname: hw-run\nversion: 1.0.0\nclips: {{files: [{}]}}\ntasks: [{}]\nengines: "
                  "[playback]\ncontrollers: [{}]\npolicies: [{}]\nrobot: {}\nstart: {}\nnull_arm: false\n",
                  dumped(quoted), fmt::join(tasks, ", "), controller, policy, default_robot(), start),
      "hw-run.yaml");
}

}  // namespace duet
