#include "bench/runner.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <mutex>

#include "backends/factory.h"
#include "bench/clips.h"
#include "bench/interrupt.h"
#include "bench/parallel.h"
#include "bench/scoring.h"
#include "core/require.h"
#include "metrics/contact_limits.h"
#include "results/environment.h"

namespace duet {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kPlayback = "playback";

std::string utc_now() { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))); }

bool chosen(const std::vector<std::string>& filter, const std::string& name) {
  return filter.empty() || std::find(filter.begin(), filter.end(), name) != filter.end();
}

bool selected(const RunOptions& options, const EpisodeSpec& spec) {
  return chosen(options.engines, spec.engine) && chosen(options.controllers, spec.controller) &&
         (spec.arm == "null" || chosen(options.policies, spec.policy)) &&
         chosen(options.tasks, std::string(to_string(spec.clip->task))) &&
         (spec.engine == kPlayback || chosen(options.perturbations, spec.perturbation));
}

// The part of a filter that the suite does not have is a mistake of the user, not an empty run.
void check_filter(const std::vector<std::string>& filter, const std::vector<std::string>& known, const char* kind) {
  for (const std::string& name : filter)
    require(std::find(known.begin(), known.end(), name) != known.end(),
            fmt::format("the suite has no {} '{}'; it has: {}", kind, name, fmt::join(known, ", ")));
}

void check_filters(const RunOptions& options, const Suite& suite) {
  std::vector<std::string> tasks;
  for (const Task task : suite.tasks) tasks.emplace_back(to_string(task));
  check_filter(options.engines, suite.engines, "engine");
  check_filter(options.controllers, controller_names_of(suite), "controller");
  check_filter(options.policies, policy_names_of(suite), "policy");
  check_filter(options.tasks, tasks, "task");
  check_filter(options.perturbations, perturbation_names_of(suite), "perturbation");
}

// Engines of the suite that this machine lacks, each with its reason. Throws MissingError where no other is left.
std::map<std::string, std::string> absent_engines(const Suite& suite, const RunOptions& options) {
  std::map<std::string, std::string> absent;
  int present = 0;
  for (const EngineInfo& engine : engines()) {
    if (std::find(suite.engines.begin(), suite.engines.end(), engine.name) == suite.engines.end()) continue;
    if (!chosen(options.engines, engine.name)) continue;
    if (engine.available)
      ++present;
    else
      absent[engine.name] = fmt::format("engine '{}' is absent: {}", engine.name, engine.reason);
  }
  if (present == 0 && !absent.empty()) throw MissingError(absent.begin()->second);
  return absent;
}

// What the filters leave out need not be there.
std::vector<std::string> left_out(const std::vector<std::string>& filter, const std::vector<std::string>& known) {
  std::vector<std::string> names;
  for (const std::string& name : known)
    if (!chosen(filter, name)) names.push_back(name);
  return names;
}

// Throws MissingError where all policies are absent, or all controllers and nothing is left that runs without one.
void check_actors(const Bodies& bodies, const Suite& suite, const RunOptions& options) {
  const std::size_t policies = suite.policies.size() - left_out(options.policies, policy_names_of(suite)).size();
  if (!bodies.absent_policies().empty() && bodies.absent_policies().size() == policies)
    throw MissingError(bodies.absent_policies().begin()->second);
  const std::size_t wanted =
      suite.controllers.size() - left_out(options.controllers, controller_names_of(suite)).size();
  const bool playback = std::find(suite.engines.begin(), suite.engines.end(), kPlayback) != suite.engines.end() &&
                        chosen(options.engines, kPlayback);
  if (!bodies.absent().empty() && bodies.absent().size() == wanted && !playback)
    throw MissingError(bodies.absent().begin()->second);
}

EpisodeRow unsupported_row(EpisodeRow row, const std::string& reason) {
  row.started_at = utc_now();
  row.robot_digest.clear();
  row.outcome = Outcome::kUnsupported;
  row.message = reason;
  row.success = false;
  return row;
}

std::string trajectory_path(const std::string& folder, const EpisodeRow& row) {
  return (std::filesystem::path(folder) / (row.key.substr(0, 16) + ".npz")).string();
}

bool keep_trajectory(const Suite& suite, const EpisodeRow& row) {
  if (suite.record == RecordTrajectories::kAll) return true;
  return suite.record == RecordTrajectories::kFailures && !row.success.value_or(false);
}

// Playback needs none: anything that fits the robot fills its place.
std::unique_ptr<Controller> episode_controller(const EpisodeSpec& spec, const Suite& suite,
                                               const std::shared_ptr<const RobotModel>& robot) {
  if (spec.engine == kPlayback) return make_controller("pd", robot);
  const SuiteController& controller = controller_of(suite, spec.controller);
  return make_controller(controller.use, robot, controller.options);
}

std::unique_ptr<Policy> episode_policy(const EpisodeSpec& spec, const Suite& suite,
                                       const std::shared_ptr<const RobotModel>& robot) {
  const SuitePolicy policy = policy_of(suite, spec.policy);
  return make_policy(policy.use, robot, policy.options);
}

void simulate(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot,
              const std::string& trajectory_folder, const PolicyMaker& make, EpisodeRow& row) {
  const std::unique_ptr<Backend> backend = make_backend(spec.engine, episode_scene(spec, suite, robot));
  const std::unique_ptr<Controller> controller = episode_controller(spec, suite, robot);
  const std::unique_ptr<Policy> policy = make ? make() : episode_policy(spec, suite, robot);
  row.engine_version = backend->version();
  const RolloutSetup setup = episode_setup(spec, suite, *robot);
  const Rollout rollout = roll_out(setup, *backend, *controller, *policy);
  if (rollout.interrupted) throw EpisodeInterrupted();
  score_rollout(rollout, setup, suite, readings_of(suite), *robot, row);
  if (!trajectory_folder.empty() && keep_trajectory(suite, row))
    save_recording(rollout.recording, trajectory_path(trajectory_folder, row));
}

// What stops a run early, asked between episodes and at every tick.
class StopSign {
 public:
  explicit StopSign(double time_limit) : limit_(time_limit), begin_(Clock::now()) {}
  [[nodiscard]] RunEnd end() const {
    switch (interrupt()) {
      case Interrupt::kInterrupted:
        return RunEnd::kInterrupted;
      case Interrupt::kTerminated:
        return RunEnd::kTerminated;
      case Interrupt::kNone:
        break;
    }
    const double elapsed = std::chrono::duration<double>(Clock::now() - begin_).count();
    return limit_ > 0.0 && elapsed > limit_ ? RunEnd::kTimeLimit : RunEnd::kComplete;
  }

 private:
  double limit_;
  Clock::time_point begin_;
};

}  // namespace

Scene episode_scene(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot) {
  const EngineSettings settings = suite.profile.settings(spec.engine);
  const Perturbation perturbation = perturbation_of(suite, spec.perturbation);
  Scene scene;
  scene.robot = perturbed_robot(perturbation, robot);
  scene.friction.robot_ground = perturbation.friction.value_or(scene.friction.robot_ground);
  std::array<double, kSmplJoints> bones = bone_lengths(spec.clip->partner);
  if (perturbation.partner)
    for (double& bone : bones) bone *= perturbation.partner->scale;
  scene.human = make_human_body(bones);
  scene.partner = suite.partner;
  scene.dt = settings.dt;
  scene.options = settings.options;
  return scene;
}

RolloutSetup episode_setup(const EpisodeSpec& spec, const Suite& suite, const RobotModel& robot) {
  const SuiteController& controller = controller_of(suite, spec.controller);
  AdaptationOptions options;
  options.start = start_mode(suite, controller);
  options.start_radius = suite.start_radius;
  RolloutSetup setup;
  setup.clip = spec.clip;
  setup.reference = adapt_by_phase(spec.clip->robot, spec.clip->phases, robot, options, spec.seed);
  setup.prompt = policy_of(suite, spec.policy).prompt;
  if (spec.seen != nullptr)
    setup.seen_partner = partner_from_elsewhere(
        *spec.seen, adapt_by_phase(spec.seen->robot, spec.seen->phases, robot, options, spec.seed), setup.reference);
  setup.start = robot.standing_state(setup.reference.motion.root.front());
  setup.seed = spec.seed;
  setup.perturbation = perturbation_of(suite, spec.perturbation);
  setup.perturbation_seed = spec.perturbation_seed;
  setup.foot_trace = spec.engine != kPlayback && spec.arm == "main" && controller_info(controller.use).walks;
  setup.wall_limit = suite.wall_limit;
  setup.fuse_ticks = suite.fuse_ticks;
  if (suite.partner == PartnerMode::kSolid)
    setup.limits =
        load_contact_limits(suite.contact_limits.empty() ? default_contact_limits_path() : suite.contact_limits);
  setup.stop_asked = [] { return interrupt() != Interrupt::kNone; };
  return setup;
}

EpisodeRow run_episode(const EpisodeSpec& spec, const Suite& suite, const std::string& hash,
                       const std::shared_ptr<const RobotModel>& robot, const std::string& trajectory_folder,
                       const PolicyMaker& policy) {
  EpisodeRow row = row_for(spec, suite, hash, *robot);
  row.started_at = utc_now();
  const Clock::time_point begin = Clock::now();
  try {
    simulate(spec, suite, robot, trajectory_folder, policy, row);
  } catch (const MissingError& error) {
    row.outcome = Outcome::kUnsupported;
    row.message = error.what();
    row.success = false;
  } catch (const std::exception& error) {
    row.outcome = Outcome::kError;
    row.message = error.what();
    row.success = false;
  }
  row.wall_s = std::chrono::duration<double>(Clock::now() - begin).count();
  return row;
}

namespace {

EpisodeRow run_or_refuse(const EpisodeSpec& spec, const Suite& suite, const std::string& hash, const Bodies& bodies,
                         const std::string& trajectory_folder) {
  const std::shared_ptr<const RobotModel>& robot = bodies.robot(spec.controller);
  const auto absent = bodies.absent().find(spec.controller);
  if (absent != bodies.absent().end() && spec.engine != kPlayback)
    return unsupported_row(row_for(spec, suite, hash, *robot), absent->second);
  const PolicyOnBody& policy = bodies.policy(spec.controller, spec.policy);
  if (!policy.refusal.empty()) return unsupported_row(row_for(spec, suite, hash, *robot), policy.refusal);
  return run_episode(spec, suite, hash, robot, trajectory_folder, policy.make);
}

// Those that are asked for and not in the run yet; counts all and those that are.
std::vector<EpisodeSpec> missing_episodes(const Suite& suite, const std::string& hash, const Bodies& bodies,
                                          const RunOptions& options, const RunDirectory& run, RunSummary& summary) {
  std::vector<EpisodeSpec> missing;
  for (const EpisodeSpec& spec : plan_episodes(suite, bodies)) {
    if (!selected(options, spec)) continue;
    ++summary.planned;
    if (run.has(row_for(spec, suite, hash, *bodies.robot(spec.controller)).key)) {
      ++summary.already_there;
    } else {
      missing.push_back(spec);
    }
  }
  return missing;
}

}  // namespace

RunSummary run_suite(const Suite& suite, const std::string& directory, const RunOptions& options, Progress& progress) {
  check_filters(options, suite);
  RunSummary summary;
  summary.absent_engines = absent_engines(suite, options);
  const std::string hash = suite_hash(suite);
  Bodies bodies(suite, left_out(options.controllers, controller_names_of(suite)),
                left_out(options.policies, policy_names_of(suite)));
  check_actors(bodies, suite, options);
  summary.absent_controllers = bodies.absent();
  summary.absent_policies = bodies.absent_policies();
  RunDirectory run = RunDirectory::open(directory, {suite.name, suite.version, hash, resolved_yaml(suite), options.argv,
                                                    utc_now(), capture_environment(), options.certificate});
  bodies.take_clips(prepare_clips(suite, *bodies.nominal(), options.threads, progress));
  const std::vector<EpisodeSpec> missing = missing_episodes(suite, hash, bodies, options, run, summary);
  const std::string trajectories =
      suite.record == RecordTrajectories::kNone ? "" : (std::filesystem::path(directory) / "trajectories").string();
  const StopSign stop(options.time_limit);
  std::mutex mutex;
  progress.start("rolling out", static_cast<int>(missing.size()), "episodes");
  parallel_for_each(static_cast<int>(missing.size()), options.threads, [&](int i) {
    if (stop.end() != RunEnd::kComplete) return;
    try {
      const EpisodeRow row = run_or_refuse(missing[i], suite, hash, bodies, trajectories);
      const std::lock_guard lock(mutex);
      run.append(row);
      ++summary.run;
      ++summary.outcomes[std::string(to_string(row.outcome))];
      progress.advance();
    } catch (const EpisodeInterrupted&) {
      return;
    }
  });
  progress.finish();
  if (summary.already_there + summary.run < summary.planned) summary.end = stop.end();
  return summary;
}

}  // namespace duet
