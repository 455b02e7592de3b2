#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <map>
#include <optional>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/file_batch.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/shipped_suites.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/hardware/dds/twin_over_dds.h"
#include "duet/hardware/episodes/guarded_episode.h"
#include "duet/hardware/twin/lock_step.h"
#include "duet/parts/robot/hw.h"

namespace duet::cli {
namespace {

enum class TwinClock { kInProcess, kLockStep, kRealTime };
const std::vector<std::string> kClockNames = {"in-process", "lock-step", "real-time"};

struct EpisodesArguments {
  std::string config, suite, walker, engine = "mujoco", clock = "lock-step", output, camera, beside = "simulator";
  std::vector<std::string> overrides;
  int limit = 0;
  double noise = 1.0;

  [[nodiscard]] bool beside_clip() const { return beside == "clip"; }
};

TwinClock parse_clock(const std::string& name) {
  for (std::size_t k = 0; k < kClockNames.size(); ++k)
    if (kClockNames[k] == name) return static_cast<TwinClock>(k);
  throw std::invalid_argument(unknown_name_message("clock of the twin", name, kClockNames));
}

// The state that all episodes of a command share.
class TwinEpisodes {
 public:
  TwinEpisodes(const TwinEpisodes&) = delete;  // it points into its own experiment
  TwinEpisodes& operator=(const TwinEpisodes&) = delete;
  TwinEpisodes(Session& session, const EpisodesArguments& arguments)
      : session_(session),
        arguments_(arguments),
        clock_(parse_clock(arguments.clock)),
        camera_(parse_twin_camera(arguments.camera)),
        config_(read_robot_config(arguments.config)),
        experiment_(read_suite(arguments)),
        walker_(arguments.walker.empty() ? experiment_.suite().controllers.front()
                                         : experiment_.suite().controller(arguments.walker)) {
    if (!config_.twin)
      throw InputError(fmt::format("{}: expected a twin's configuration (twin: true)", arguments.config));
    if (!config_.permission.allow_motion)
      throw InputError(fmt::format("{}: it does not allow motion: 'allow_motion' is not true", arguments.config));
    if (experiment_.suite().partner == SuitePartner::kYielding)
      throw InputError(
          fmt::format("{}: expected a partner who is none, ghost or solid, found yielding: the twin has "
                      "no person who gives way",
                      arguments.suite));
    if (is_solid() && clock_ != TwinClock::kInProcess)
      throw InputError(
          fmt::format("a person who can be touched (partner: solid in '{}') needs --clock in-process, found "
                      "'{}'",
                      arguments.suite, arguments.clock));
    const ControllerOnBody& body = experiment_.bodies().controller(walker_.name);
    if (!body.refusal.empty()) throw MissingError(body.refusal);
    make_walker_ = Walker::load(walker_.use, walker_.options, body.robot);
    const ArchivedSuite kept = archive_inputs(experiment_.suite(), arguments.output, experiment_.identity().files);
    rows_.emplace(RunDirectory::open(arguments.output, new_run_info(experiment_, kept, session.argv, {})));
    keep_inputs(kept, arguments.output);
  }

  void run() {
    say_first();
    Progress progress(session_.progress());
    experiment_.prepare(1, progress);
    int done = 0;
    for (std::int64_t i = 0; i < experiment_.size() && interrupt() == Interrupt::kNone; ++i) {
      const EpisodeSpec spec = experiment_.at(i);
      if (spec.engine != arguments_.engine || spec.controller != &walker_ || spec.perturbation->name != kCleanName)
        continue;
      if (arguments_.limit > 0 && done >= arguments_.limit) break;
      try {
        run_both(spec, done++);
      } catch (const EpisodeInterrupted&) {  // it leaves no row
        break;
      }
    }
    print_result();
  }

 private:
  static Suite read_suite(const EpisodesArguments& arguments) {
    Overrides overrides;
    for (const std::string& text : arguments.overrides) overrides.push_back(split_assignment(text));
    overrides.emplace_back("engines", fmt::format("[{}]", arguments.engine));
    return load_suite(suite_file(arguments.suite), overrides);
  }

  [[nodiscard]] bool is_solid() const { return experiment_.suite().partner == SuitePartner::kSolid; }

  void say_first() const {
    note(session_,
         fmt::format(
             "rolls out each episode of {} {} twice under '{}': {}, and over a twin with {} behind it ({}, "
             "domain {}), behind the guard of '{}' whose log goes to '{}'. The twin is armed by this program; a "
             "robot cannot be.",
             experiment_.suite().name, experiment_.suite().version, walker_.name,
             arguments_.beside_clip() ? "over a twin with the clip's partner before the policy's eyes"
                                      : "in " + arguments_.engine,
             arguments_.engine, arguments_.clock, config_.permission.domain, arguments_.config, arguments_.output));
  }

  [[nodiscard]] std::string path(int index, const std::string& ending) const {
    return (std::filesystem::path(arguments_.output) / fmt::format("episode-{:03d}{}", index, ending)).string();
  }

  [[nodiscard]] GuardSetup setup() const { return guard_setup(config_, false); }

  std::unique_ptr<GuardLink> make_link(const EpisodeSpec& spec, std::unique_ptr<Walker> walker, RunLog& log) const {
    TwinOptions twin = noisy_twin(arguments_.noise, arguments_.engine, spec.seed);
    twin.mode_machine = config_.permission.mode_machine;
    if (clock_ == TwinClock::kInProcess) return std::make_unique<TwinInProcess>(setup(), twin, std::move(walker), &log);
    const TwinOverDdsOptions options{.program = twin_program(),
                                     .place = config_.place(),
                                     .twin = twin,
                                     .lock_step = clock_ == TwinClock::kLockStep,
                                     .more = {},
                                     .socket = scratch_ / "guard.socket"};
    return std::make_unique<TwinOverDds>(options, setup(), std::move(walker), &log);
  }

  GuardedRun run_guarded(const EpisodeSpec& spec, int index, bool sees_clip) {
    std::unique_ptr<Walker> walker = make_walker_();
    GuardedOptions options;
    options.config = config_;
    options.least_steps = walker->least_steps();
    options.engine = fmt::format("twin-{}", arguments_.engine);
    options.camera = camera_;
    options.camera.seed = spec.seed;
    options.policy_sees_clip = sees_clip;
    options.solid = is_solid();
    const std::string which = sees_clip ? "-clip" : "";
    options.recording = path(index, which + ".npz");
    options.stop_asked = [] { return interrupt() != Interrupt::kNone; };
    std::filesystem::remove(path(index, which + ".mcap"));
    RunLog log(path(index, which + ".mcap"), setup());
    const std::unique_ptr<GuardLink> link = make_link(spec, std::move(walker), log);
    GuardedRun run = run_guarded_episode(experiment_, spec, *link, options);
    dropped_ += log.dropped();
    return run;
  }

  void run_both(const EpisodeSpec& spec, int index) {
    const GuardedRun other = arguments_.beside_clip() ? run_guarded(spec, index, true) : GuardedRun{};
    const EpisodeRow simulated = arguments_.beside_clip() ? other.row : experiment_.run(spec);
    const GuardedRun guarded = run_guarded(spec, index, false);
    if (guarded.interrupted || other.interrupted) throw EpisodeInterrupted();
    if (!arguments_.beside_clip()) keep(simulated);  // two rows of one episode have one key
    keep(guarded.row);
    episodes_.simulated.push_back(simulated);
    episodes_.guarded.push_back(guarded.row);
    runs_.push_back(guarded);
    note(session_,
         fmt::format("{:3d} {:<10} {:<8} {} {} {}; {} {} {}{}; held {} ticks, {} reports missed, nobody tracked in {}, "
                     "{:.1f} s in {:.1f} s",
                     index, guarded.row.task, guarded.row.policy, names().first, to_string(simulated.outcome),
                     simulated.success.value_or(false) ? "success" : "-", names().second,
                     to_string(guarded.row.outcome), guarded.row.success.value_or(false) ? "success" : "-",
                     guarded.row.message.empty() ? "" : " (" + guarded.row.message + ")", guarded.held_ticks,
                     guarded.missed_reports, guarded.unseen_ticks, guarded.guard_seconds, guarded.row.wall_s));
  }

  // Nothing that is finished is lost; a row that the folder has from before stands.
  void keep(const EpisodeRow& row) {
    if (rows_->claim(row.key) == Claim::kMine) rows_->append(row);
  }

  [[nodiscard]] std::pair<std::string, std::string> names() const {
    if (arguments_.beside_clip()) return {"clip's partner", "tracked person"};
    return {"simulator", "twin"};
  }

  [[nodiscard]] std::string by_task() const {
    std::map<std::string, std::array<int, 3>> counts;
    for (std::size_t i = 0; i < runs_.size(); ++i) {
      std::array<int, 3>& count = counts[episodes_.guarded[i].task];
      ++count[0];
      count[1] += episodes_.simulated[i].success.value_or(false) ? 1 : 0;
      count[2] += episodes_.guarded[i].success.value_or(false) ? 1 : 0;
    }
    std::string text;
    for (const auto& [task, count] : counts)
      text += fmt::format("  {:<10} {} {} of {}, {} {} of {}\n", task, names().first, count[1], count[0],
                          names().second, count[2], count[0]);
    return text;
  }

  // How near the robot came to a head, and how hard it was touched where the person is solid.
  [[nodiscard]] std::string nearness() const {
    double head = BodyGaps::kFar, most = 0.0, settled = 0.0;
    long touched = 0, over = 0;
    for (const GuardedRun& run : runs_) {
      head = std::min(head, run.head_distance);
      const auto force = [&](const char* name) {
        const auto found = run.row.forces.find(name);
        return found == run.row.forces.end() ? 0.0 : found->second;
      };
      most = std::max(most, force("human.peak_n"));
      settled = std::max(settled, force("human.settled_ratio"));
      touched += force("human.peak_n") > 0.0 ? 1 : 0;
      over += force("human.worst_ratio") > 1.0 ? 1 : 0;
    }
    std::string text = fmt::format("nearest to a head or neck {:.2f} m", head);
    if (is_solid())
      text += fmt::format(
          "; touched in {} of {} episodes, at most {:.0f} N, over a limit of contact in {} (settled: at "
          "most {:.2f} of it)",
          touched, runs_.size(), most, over, settled);
    return text + "\n";
  }

  [[nodiscard]] std::string clamp_totals() const {
    std::string text;
    for (std::size_t k = 0; k < kClampReasons; ++k) {
      long total = 0;
      for (const GuardedRun& run : runs_) total += run.clamps[k];
      if (total > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", kClampNames[k], total);
    }
    return text.empty() ? "none" : text;
  }

  void print_result() {
    const PairedSuccess success = paired_success(episodes_);
    double guard_seconds = 0.0, wall = 0.0;
    int held = 0, missed = 0;
    for (const GuardedRun& run : runs_) {
      guard_seconds += run.guard_seconds;
      wall += run.row.wall_s;
      held += run.held_ticks;
      missed += run.missed_reports;
    }
    const std::string executed =
        runs_.empty() ? "nothing" : executed_mask_text(runs_.front().executed, *experiment_.bodies().nominal());
    const std::string text = fmt::format(
        "{}\n{}{}executed of the reference: {}\nclamps of the guard (its ticks): {}\n{:.1f} s of episodes in {:.1f} s "
        "of "
        "wall time with the wait for the guard ({}); held {} of the planner's ticks, {} reports missed, {} ticks left "
        "out of logs",
        paired_text(success, names().first, names().second), by_task(), runs_.empty() ? "" : nearness(), executed,
        clamp_totals(), guard_seconds, wall, arguments_.clock, held, missed, dropped_);
    nlohmann::json json = paired_json(success);
    json["clock"] = arguments_.clock;
    json["guard_seconds"] = guard_seconds;
    json["wall_seconds"] = wall;
    json["held_ticks"] = held;
    json["missed_reports"] = missed;
    print(session_, text, json);
    if (interrupt() != Interrupt::kNone) session_.exit_code = kExitInterrupted;
  }

  Session& session_;
  const EpisodesArguments& arguments_;
  TwinClock clock_;
  TwinCamera camera_;
  RobotConfig config_;
  Experiment experiment_;
  std::optional<RunDirectory> rows_;  // the output folder: a run that `duet report` reads
  const SuiteController& walker_;
  ScratchFolder scratch_;  // of the guard's socket
  std::function<std::unique_ptr<Walker>()> make_walker_;
  PairedEpisodes episodes_;
  std::vector<GuardedRun> runs_;
  long dropped_ = 0;
};

void run_recording(Session& session, const std::string& log, const std::string& task, const std::string& output) {
  std::optional<Task> known;
  if (!task.empty()) known = parse_task(task);
  const LoggedRun run = recording_of_log(log, known);
  save_logged_run(run.recording, run.executed, output);
  print(session,
        fmt::format("{}: {} frames, outcome {}{}, {}; executed: {}; the log {}", output, run.recording.frames(),
                    to_string(run.recording.outcome),
                    run.recording.message.empty() ? "" : " (" + run.recording.message + ")",
                    run.recording.partner.empty() ? "nobody was seen" : "with a person",
                    executed_mask_text(run.executed, *load_shared_robot()), run.whole ? "is whole" : "was cut off"),
        {{"frames", run.recording.frames()},
         {"outcome", to_string(run.recording.outcome)},
         {"whole", run.whole},
         {"events", run.events}});
}

void add_recording_command(CLI::App& hardware, Session& session) {
  struct Arguments {
    std::string log, task, output;
  };
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* command = add_command(hardware, session, "recording", "a run's log as a recording that `duet score` takes",
                                  "duet hw recording run.mcap --task wave -o run.npz");
  command->add_option("log", arguments->log, "log of `duet hw arm` or `duet hw episodes` (MCAP)")->required();
  command->add_option("--task", arguments->task, "that the run was of");
  command->add_option("-o,--output", arguments->output, "recording to make (NPZ)")->required();
  command->callback(
      [&session, arguments] { run_recording(session, arguments->log, arguments->task, arguments->output); });
}

}  // namespace

void add_hardware_episodes(CLI::App& hardware, Session& session) {
  add_recording_command(hardware, session);
  const auto arguments = std::make_shared<EpisodesArguments>();
  CLI::App* command =
      add_command(hardware, session, "episodes", "a suite's episodes over the twin beside the same in the simulator",
                  "duet hw episodes examples/hardware/twin.yaml examples/hardware/episodes.yaml -o out/twin");
  command->add_option("config", arguments->config, "configuration of the twin (YAML)")->required();
  command->add_option("suite", arguments->suite, "suite (YAML)")->required();
  command->add_option("-o,--output", arguments->output, "folder for rows, logs and recordings")->required();
  command->add_option("--walker", arguments->walker, "controller of the suite that walks; without: its first");
  command->add_option("--engine", arguments->engine, "behind the twin, and of the simulator")->capture_default_str();
  command->add_option("--clock", arguments->clock, "in-process (no wire), lock-step or real-time")
      ->capture_default_str();
  command->add_option("--noise", arguments->noise, "of the twin's sensors, as a share of the usual")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 100.0));
  command->add_option(
      "--camera", arguments->camera,
      "what the twin's camera gets wrong: noise=0.02,latency=0.1,unseen=0.05,jumps=0.01 [m, s, shares]");
  command
      ->add_option("--beside", arguments->beside,
                   "what the twin is compared with: the simulator, or the twin with a policy that sees the clip's "
                   "partner (clip) and not the one who is tracked")
      ->capture_default_str()
      ->check(CLI::IsMember({"simulator", "clip"}));
  command->add_option("-n,--limit", arguments->limit, "most episodes; 0: all")->check(CLI::Range(0, 1000000));
  command->add_option("-s,--set", arguments->overrides, "key=value of the suite")->allow_extra_args(false);
  command->callback([&session, arguments] {
    catch_interrupts();
    TwinEpisodes(session, *arguments).run();
  });
}

void add_clip_options(CLI::App& command, ClipEpisodeArguments& arguments) {
  command.add_option("--clip", arguments.clip,
                     "clip or paired motion (NPZ): an episode of it, in the place of --command");
  command.add_option("--config", arguments.config,
                     "configuration of the robot or twin, whose limits the planner keeps");
  command.add_option("--policy", arguments.policy, "that leads the episode")->capture_default_str();
  command.add_option("--start", arguments.start, "of the episode: act, approach, clip")->capture_default_str();
  command.add_option("--walker", arguments.walker, "controller that the guard walks with")->capture_default_str();
  command.add_option("--recording", arguments.recording, "recording to make (NPZ)");
}

std::string seen_text(const RobotConfig& config) {
  if (config.has_camera) return "the person whom the guard's camera tracks";
  return config.twin ? "the clip's partner as the guard tracks them"
                     : "the clip's partner: the configuration has no 'camera'";
}

void run_clip_episode(Session& session, const ClipEpisodeArguments& arguments, const std::string& socket) {
  if (arguments.config.empty()) throw InputError("--clip: expected the configuration too (--config), found none");
  const RobotConfig config = read_robot_config(arguments.config);
  Experiment experiment(suite_of_clip(arguments.clip, arguments.policy, arguments.start, "pd"));
  Progress progress(session.progress());
  experiment.prepare(1, progress);
  const EpisodeSpec spec = experiment.at(0);
  const RolloutSetup setup = experiment.setup(spec);
  note(session,
       fmt::format(
           "asks the guard at '{}' for {:.1f} s of '{}' ({}, policy '{}', start {}): the robot's arms follow the "
           "reference, its root goes at most {:.2f} m/s. The guard limits it and keeps the log; afterwards the "
           "robot is told to stand. The policy sees {}.",
           socket, episode_ticks(setup) / kTickRate, spec.clip->clip_id, to_string(spec.clip->task), arguments.policy,
           arguments.start, config.limits.forward, seen_text(config)));
  SocketGuardLink link(socket);
  GuardedOptions options;
  options.config = config;
  options.own_camera = config.has_camera;
  options.least_steps = least_steps(arguments.walker);
  options.engine = config.twin ? "twin" : "robot";
  options.recording = arguments.recording;
  catch_interrupts();
  options.stop_asked = [] { return interrupt() != Interrupt::kNone; };
  options.watch = [&](const GuardReport& report) {
    note(session, fmt::format("the guard: {} ({})", safety_state_name(report.state), stop_cause_name(report.cause)));
  };
  const GuardedRun run = run_guarded_episode(experiment, spec, link, options);
  print(
      session,
      fmt::format("{}{}; success: {}; {:.1f} s; held {} ticks, {} reports missed, nobody tracked in {}; executed: {}",
                  to_string(run.row.outcome), run.row.message.empty() ? "" : " (" + run.row.message + ")",
                  run.row.success.value_or(false) ? "yes" : "no", run.guard_seconds, run.held_ticks, run.missed_reports,
                  run.unseen_ticks, executed_mask_text(run.executed, *experiment.bodies().nominal())),
      to_json(run.row));
  if (run.row.outcome == Outcome::kError) session.exit_code = kExitErrors;
}

}  // namespace duet::cli
