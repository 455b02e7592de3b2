#include "bench/runner.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "backends/factory.h"
#include "bench/clips.h"
#include "bench/episode_recording.h"
#include "bench/interrupt.h"
#include "bench/prepared_clips.h"
#include "bench/run_inputs.h"
#include "bench/run_work.h"
#include "bench/scoring.h"
#include "bench/trust.h"
#include "core/file.h"
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

RunPart part_of(const RunOptions& options) {
  return {options.engines, options.controllers, options.policies, options.tasks, options.perturbations};
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

std::string no_locks_warning(const std::string& folder, const std::string& reason) {
  return fmt::format("'{}' is on a file system without locks ({}): let no other run work in it at the same time",
                     folder, reason);
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

void keep_episode(const Recording& recording, const RolloutSetup& setup, const Suite& suite, const EpisodeRow& row,
                  const std::string& path) {
  const ScoringRules rules{suite.detector, suite.thresholds, readings_of(suite), setup.foot_trace};
  save_episode_recording({recording, KeptEpisode{row, rules, act_source(recording, setup)}}, path);
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
  require_allowed(programs_of(policy), suite.allow_programs);
  return make_policy(policy.use, robot, policy.options);
}

void simulate(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot,
              const std::string& trajectory_folder, const PolicyMaker& make, const std::function<bool()>& stop_asked,
              EpisodeRow& row) {
  const std::unique_ptr<Backend> backend = make_backend(spec.engine, episode_scene(spec, suite, robot));
  const std::unique_ptr<Controller> controller = episode_controller(spec, suite, robot);
  const std::unique_ptr<Policy> policy = make ? make() : episode_policy(spec, suite, robot);
  row.engine_version = backend->version();
  RolloutSetup setup = episode_setup(spec, suite, *robot);
  if (stop_asked) setup.stop_asked = stop_asked;
  const Rollout rollout = roll_out(setup, *backend, *controller, *policy);
  if (rollout.interrupted) throw EpisodeInterrupted();
  if (const PolicyFaults& faults = rollout.policy_faults; faults.dead) {
    row.policy_faults = {faults.late, faults.invalid, true, faults.message};
    throw std::runtime_error(faults.message);
  }
  score_rollout(rollout, setup, suite, readings_of(suite), *robot, row);
  if (!trajectory_folder.empty() && keep_trajectory(suite, row))
    keep_episode(rollout.recording, setup, suite, row, trajectory_path(trajectory_folder, row));
}

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

EpisodeRow run_episode(const EpisodeSpec& spec, const Suite& suite, const RunIdentity& identity,
                       const std::shared_ptr<const RobotModel>& robot, const std::string& trajectory_folder,
                       const PolicyMaker& policy, const std::function<bool()>& stop_asked) {
  EpisodeRow row = row_for(spec, suite, identity, *robot);
  row.started_at = utc_now();
  const Clock::time_point begin = Clock::now();
  try {
    simulate(spec, suite, robot, trajectory_folder, policy, stop_asked, row);
  } catch (const StorageError&) {
    throw;
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

EpisodeRow run_or_refuse(const EpisodeSpec& spec, const Suite& suite, const RunIdentity& identity, const Bodies& bodies,
                         const std::string& trajectory_folder, const std::function<bool()>& stop_asked) {
  const std::shared_ptr<const RobotModel>& robot = bodies.robot(spec.controller);
  const auto absent = bodies.absent().find(spec.controller);
  if (absent != bodies.absent().end() && spec.engine != kPlayback)
    return unsupported_row(row_for(spec, suite, identity, *robot), absent->second);
  const PolicyOnBody& policy = bodies.policy(spec.controller, spec.policy);
  if (!policy.refusal.empty()) return unsupported_row(row_for(spec, suite, identity, *robot), policy.refusal);
  return run_episode(spec, suite, identity, robot, trajectory_folder, policy.make, stop_asked);
}

// For people: what profile_digest is of. The suite says less, and another machine's engines may add other defaults.
std::string settings_here(const Suite& suite) {
  std::string text;
  for (const std::string& engine : suite.engines)
    if (engine != kPlayback && is_available(engine))
      text += fmt::format("# {} here: {}\n", engine, resolved_settings(engine, suite.profile.settings(engine)));
  return text;
}

// Places in the plan of those that are asked for and not in the folder yet; counts those that are.
std::vector<std::uint32_t> missing_episodes(const EpisodePlan& plan, const RunPart& part, const RunDirectory& run,
                                            const std::function<std::string(const EpisodeSpec&)>& key_of,
                                            const StopSign& stop, RunSummary& summary) {
  std::vector<std::uint32_t> missing;
  for (std::int64_t i = 0; i < plan.size(); ++i) {
    if (i % 256 == 0 && stop.asked()) throw Stopped();
    const EpisodeSpec spec = plan.at(i);
    if (!belongs(spec, spec.clip->task, part)) continue;
    if (run.size() > 0 && run.has(key_of(spec))) {
      ++summary.already_there;
    } else {
      missing.push_back(static_cast<std::uint32_t>(i));
    }
  }
  return missing;
}

// Tasks of the clips that the suite makes itself; those of files are known when they are read.
std::vector<Task> tasks_of_clips(const Suite& suite) {
  std::vector<Task> tasks;
  const std::size_t per_task = suite.clips.synth_per_task * std::max<std::size_t>(1, suite.clips.variants.size());
  for (const Task task : suite.tasks) tasks.insert(tasks.end(), per_task, task);
  return tasks;
}

std::vector<Task> tasks_of(const std::vector<PairedMotion>& clips) {
  std::vector<Task> tasks(clips.size());
  std::ranges::transform(clips, tasks.begin(), &PairedMotion::task);
  return tasks;
}

// Says in the folder and in the summary what was asked for.
void ask_for(const Suite& suite, const std::vector<Task>& clips, const RunOptions& options, RunDirectory& run,
             RunSummary& summary) {
  const auto count = [&](const std::vector<RunPart>& parts) { return count_episodes(suite, clips, parts); };
  summary.planned = count({part_of(options)});
  run.ask_for(part_of(options), count({RunPart()}), count);
}

// Plans and runs what is missing.
void run_missing(const Suite& suite, const RunIdentity& identity, const Bodies& bodies, const RunOptions& options,
                 const StopSign& stop, Progress& progress, RunDirectory& run, RunSummary& summary) {
  const EpisodePlan plan(suite, bodies);
  const auto key_of = [&](const EpisodeSpec& spec) {
    return row_for(spec, suite, identity, *bodies.robot(spec.controller)).key;
  };
  const std::vector<std::uint32_t> missing = missing_episodes(plan, part_of(options), run, key_of, stop, summary);
  const std::string trajectories = suite.record == RecordTrajectories::kNone ? "" : inside(run.path(), "trajectories");
  SharedWork work(run, stop);
  progress.start("rolling out", static_cast<int>(missing.size()), "episodes");
  const auto key_at = [&](int i) { return key_of(plan.at(missing[i])); };
  const auto run_at = [&](int i) {
    return run_or_refuse(plan.at(missing[i]), suite, identity, bodies, trajectories, [&] { return stop.asked(); });
  };
  work.run(static_cast<int>(missing.size()), options.threads, key_at, run_at, progress);
  progress.finish();
  summary.run = work.done();
  summary.outcomes = work.outcomes();
  summary.already_there += work.done_by_others();
}

}  // namespace

namespace {

// The suite hash says nothing of policies and engines; a folder is of those that its suite.yaml names.
void require_names_of(const std::string& directory, const Suite& suite) {
  const std::string path = (std::filesystem::path(directory) / "suite.yaml").string();
  if (!has_inputs(directory)) return;  // a run that was killed before its first episode, or none
  const Suite there = parse_suite(read_text(path), path);
  const auto require_all = [&](const char* kind, const std::vector<std::string>& known,
                               const std::vector<std::string>& wanted) {
    for (const std::string& name : wanted)
      if (!chosen(known, name))
        throw InputError(
            fmt::format("'{}' holds a run of the {} {}, not of '{}': choose another folder (`duet merge` "
                        "joins two)",
                        directory, kind, fmt::join(known, ", "), name));
  };
  require_all("policies", policy_names_of(there), policy_names_of(suite));
  require_all("engines", there.engines, suite.engines);
}

}  // namespace

RunSummary run_suite(const Suite& suite, const std::string& directory, const RunOptions& options, Progress& progress) {
  check_filters(options, suite);
  RunSummary summary;
  summary.absent_engines = absent_engines(suite, options);
  const RunIdentity identity = identity_of(suite);
  Bodies bodies(suite, left_out(options.controllers, controller_names_of(suite)),
                left_out(options.policies, policy_names_of(suite)));
  check_actors(bodies, suite, options);
  summary.absent_controllers = bodies.absent();
  summary.absent_policies = bodies.absent_policies();
  const KeptSuite kept = kept_suite(suite, directory);
  const RunInfo info{.suite = suite.name,
                     .suite_version = suite.version,
                     .suite_hash = identity.suite_hash,
                     .suite_yaml = resolved_yaml(kept.suite) + settings_here(suite),
                     .argv = options.argv,
                     .created_at = utc_now(),
                     .environment = capture_environment(),
                     .policies = identity.policies,
                     .controllers = identity.controllers,
                     .certificate = options.certificate,
                     .plan = {}};
  require_names_of(directory, suite);
  RunDirectory run = RunDirectory::open(directory, info, options.retry_errors);
  keep_inputs(kept, directory);
  if (!run.lock_refusal().empty()) summary.warnings.push_back(no_locks_warning(directory, run.lock_refusal()));
  const StopSign stop(options.time_limit, options.begin);
  try {
    if (suite.clips.files.empty()) ask_for(suite, tasks_of_clips(suite), options, run, summary);
    const PrepareOptions prepare{.keep_in = directory, .stop = &stop};
    std::vector<PairedMotion> clips = prepare_clips(suite, *bodies.nominal(), options.threads, progress, prepare);
    if (!suite.clips.files.empty()) ask_for(suite, tasks_of(clips), options, run, summary);
    bodies.take_clips(std::move(clips));
    run_missing(suite, identity, bodies, options, stop, progress, run, summary);
  } catch (const Stopped&) {
    summary.end = stop.end();
    return summary;
  }
  if (summary.already_there + summary.run < summary.planned) summary.end = stop.end();
  if (run.is_finished()) remove_prepared_clips(directory);
  return summary;
}

}  // namespace duet
