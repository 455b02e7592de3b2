#include "duet/execution/run_episode.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <new>
#include <utility>

#include "duet/archives/recording_file.h"
#include "duet/backends/factory.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/core/clock.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/trust.h"
#include "duet/experiment/work/interrupt.h"
#include "duet/experiment/work/run_work.h"
#include "duet/metrics/contact_limits.h"
#include "duet/scoring/episode_recording.h"
#include "duet/scoring/scoring.h"

namespace duet {

std::string utc_now() { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))); }

namespace {

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

std::unique_ptr<Controller> episode_controller(const EpisodeSpec& spec, const Suite& suite,
                                               const std::shared_ptr<const RobotModel>& robot) {
  const SuiteController& controller = controller_of(suite, spec.controller);
  ControllerOptions options = controller.options;
  if (!suite.references.empty())
    options = with_command(about(controller), options, reference_of(suite.references, spec.clip->clip_id));
  if (spec.bodies != nullptr) return spec.bodies->controller(spec.controller).make(options);
  return make_controller(controller.use, robot, options);
}

std::unique_ptr<Policy> episode_policy(const EpisodeSpec& spec, const Suite& suite,
                                       const std::shared_ptr<const RobotModel>& robot) {
  const SuitePolicy policy = policy_of(suite, spec.policy);
  require_allowed(programs_of(policy), suite.allow_programs);
  return make_policy(policy.use, robot, policy.options);
}

// Runs in the spec's engine or without physics; `leader`: a policy, or the source of a reference.
template <typename Setup, typename Leader>
Rollout executed(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot,
                 const Setup& setup, Leader& leader, EpisodeRow& row) {
  row.engine_version = "1";  // of playback
  if (spec.engine == kPlaybackEngine) return play_back(setup, leader);
  const std::unique_ptr<Backend> backend = make_backend(spec.engine, episode_scene(spec, suite, robot));
  row.engine_version = backend->version();
  return roll_out(setup, *backend, *episode_controller(spec, suite, robot), leader);
}

bool signalled() { return interrupt() != Interrupt::kNone; }

EpisodeConditions conditions_of(const EpisodeSpec& spec, const Suite& suite, const RobotModel& robot,
                                const Pose& start) {
  EpisodeConditions conditions;
  conditions.start = robot.standing_state(start);
  conditions.perturbation = perturbation_of(suite, spec.perturbation);
  conditions.perturbation_seed = spec.perturbation_seed;
  conditions.fall = robot.fall;
  conditions.wall_limit = suite.wall_limit;
  conditions.stop_asked = signalled;
  return conditions;
}

// An episode that a commanded velocity leads.
void simulate_walk(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot,
                   const std::string& trajectory_folder, const std::function<bool()>& stop_asked, EpisodeRow& row) {
  const SuiteReference& reference = reference_of(suite.references, spec.clip->clip_id);
  StreamReference stream(robot, stream_options(reference), spec.seed);
  Episode episode{conditions_of(spec, suite, *robot, {}), ticks_of(reference.seconds), {}, nullptr};
  if (stop_asked) episode.stop_asked = stop_asked;
  const Rollout rollout = executed(spec, suite, robot, episode, stream, row);
  if (rollout.interrupted) throw EpisodeInterrupted();
  score_walk(rollout, reference, *robot, row);
  if (!trajectory_folder.empty() && keep_trajectory(suite, row))
    save_recording(rollout.recording, trajectory_path(trajectory_folder, row));
}

void simulate(const EpisodeSpec& spec, const Suite& suite, const std::shared_ptr<const RobotModel>& robot,
              const std::string& trajectory_folder, const EpisodeLead& lead, EpisodeRow& row) {
  if (!suite.references.empty()) {
    simulate_walk(spec, suite, robot, trajectory_folder, lead.stop_asked, row);
    return;
  }
  const std::unique_ptr<Policy> policy = lead.policy ? lead.policy() : episode_policy(spec, suite, robot);
  RolloutSetup setup = episode_setup(spec, suite, *robot);
  if (lead.stop_asked) setup.stop_asked = lead.stop_asked;
  if (lead.partner) *lead.partner = episode_partner(setup).joints;
  setup.led_partner = lead.partner;
  const Rollout rollout = executed(spec, suite, robot, setup, *policy, row);
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
  scene.partner = suite.partner;
  if (suite.references.empty()) {
    std::array<double, kSmplJoints> bones = bone_lengths(spec.clip->partner);
    if (perturbation.partner)
      for (double& bone : bones) bone *= perturbation.partner->scale;
    scene.human = make_human_body(bones);
  }
  scene.dt = settings.dt;
  scene.options = settings.options;
  return scene;
}

RolloutSetup episode_setup(const EpisodeSpec& spec, const Suite& suite, const RobotModel& robot) {
  const SuiteController& controller = controller_of(suite, spec.controller);
  AdaptationOptions options;
  options.start = start_mode(suite, controller);
  options.start_radius = suite.start_radius;
  AdaptedMotion reference = adapt_by_phase(spec.clip->robot, spec.clip->phases, robot, options, spec.seed);
  RolloutSetup setup;
  static_cast<EpisodeConditions&>(setup) = conditions_of(spec, suite, robot, reference.motion.root.front());
  setup.clip = spec.clip;
  setup.reference = std::move(reference);
  setup.prompt = policy_of(suite, spec.policy).prompt;
  if (spec.seen != nullptr)
    setup.seen_partner = partner_from_elsewhere(
        *spec.seen, adapt_by_phase(spec.seen->robot, spec.seen->phases, robot, options, spec.seed), setup.reference);
  setup.seed = spec.seed;
  setup.foot_trace = spec.engine != kPlaybackEngine && spec.arm == "main" && about(controller).walks;
  setup.fuse_ticks = suite.fuse_ticks;
  setup.max_root_speed = suite.max_root_speed;
  if (suite.partner == PartnerMode::kSolid)
    setup.limits = spec.bodies != nullptr ? spec.bodies->limits() : load_contact_limits(contact_limits_of(suite));
  return setup;
}

EpisodeRow run_episode(const EpisodeSpec& spec, const Suite& suite, const RunIdentity& identity,
                       const std::shared_ptr<const RobotModel>& robot, const std::string& trajectory_folder,
                       const EpisodeLead& lead) {
  EpisodeRow row = row_for(spec, suite, identity, *robot);
  row.started_at = utc_now();
  const auto begin = std::chrono::steady_clock::now();
  try {
    simulate(spec, suite, robot, trajectory_folder, lead, row);
  } catch (const StorageError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;  // the machine's fault, not the policy's: no row says it
  } catch (const MissingError& error) {
    row.outcome = Outcome::kUnsupported;
    row.message = error.what();
    row.success = false;
  } catch (const std::exception& error) {
    row.outcome = Outcome::kError;
    row.message = error.what();
    row.success = false;
  }
  row.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return row;
}

}  // namespace duet
