// duet hw: listen to a robot, guard it, plan for it, stop it; each says first what it will do.
#include "duet/parts/robot/hw.h"

#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <iostream>
#include <optional>
#include <random>

#include "duet/core/require.h"
#include "duet/hardware/dds/robot_side.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/guard/identification.h"
#include "duet/hardware/guard/network_door.h"
#include "duet/hardware/guard/person_input.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/twin/lock_step.h"
#include "duet/parts/robot/hw.h"
#include "duet/parts/robot/part.h"

namespace duet::cli {
namespace {

constexpr double kPlanPeriod = 0.02;  // [s]
constexpr double kSaidEvery = 3.0;    // what is missing [s]
constexpr const char* kNotSafetyRated =
    "This software is not safety-rated. It replaces neither gantry nor emergency stop nor spotter.";
constexpr const char* kTwice = "it is damped until Ctrl-C twice: a robot whose commands end does what is not known";
volatile std::sig_atomic_t asked_to_end = 0;  // how often

struct HardwareArguments {
  std::string config, socket = "duet-guard.socket", log, command = "0,0,0", person_socket = "duet-person.socket",
                      pose_socket = "duet-pose.socket", walker, walker_network;
  double seconds = 5.0;
  int velocity_port = 0;
  bool lock_step = false, identify = false;
  ClipEpisodeArguments episode;
};

// Not experiment/work/stop_token.h: there a second Ctrl-C ends the program at once, and a guard that is damping has to
// finish.
void end_on_signals() {
  asked_to_end = 0;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, [](int) { asked_to_end = asked_to_end + 1; });
}

std::string where(const RobotConfig& config) {
  return fmt::format("{} '{}', domain {} on {}", config.twin ? "twin" : "robot", config.permission.robot,
                     config.permission.domain, config.permission.interface);
}

RobotSideOptions side_options(const HardwareArguments& arguments, bool commands) {
  RobotSideOptions options;
  options.commands = commands;
  options.velocity_port = arguments.velocity_port;
  options.pose_socket = arguments.pose_socket;
  return options;
}

std::optional<PersonInput> person_input(const RobotConfig& config, const HardwareArguments& arguments) {
  if (!config.has_camera) return std::nullopt;
  return PersonInput(DatagramSocket::at_path(arguments.person_socket), config.camera);
}

// Null where the configuration names no network. Its thread has no priority, if nobody asked for it yet.
std::unique_ptr<OpenDoor> open_door(const RobotConfig& config, const HardwareArguments& arguments) {
  if (!config.has_network) return nullptr;
  return std::make_unique<OpenDoor>(network_address(config.network.bind), read_network_key(config.network.key),
                                    GuardSockets{arguments.socket, arguments.person_socket, arguments.pose_socket});
}

// Ten seconds unless somebody says otherwise: what identification takes.
constexpr double kIdentifyFor = 10.0;

void listen_for(Session& session, HardwareArguments arguments, bool with_planner) {
  if (arguments.identify) arguments.seconds = std::max(arguments.seconds, kIdentifyFor);
  const RobotConfig config = read_robot_config(arguments.config);
  note(session,
       fmt::format("listens to {} for {} s; {}. Nothing is written to it: no writer is made.", where(config),
                   arguments.seconds,
                   with_planner ? fmt::format("takes a planner's commands at '{}' and limits them", arguments.socket)
                                : "reads only"));
  const GuardSetup setup = guard_setup(config, true);
  std::unique_ptr<RunLog> log;  // its thread has no priority
  if (!arguments.log.empty())
    log = std::make_unique<RunLog>(arguments.log, setup, with_planner ? status_sender(arguments.socket) : nullptr);
  const std::unique_ptr<OpenDoor> door = open_door(config, arguments);
  note(session, real_time_text());
  RobotSide side(config, side_options(arguments, false));
  RobotGuard guard(setup, side.connection(), side.executor());
  std::optional<PersonInput> person = person_input(config, arguments);
  std::optional<DatagramSocket> planner;
  if (with_planner) planner.emplace(DatagramSocket::at_path(arguments.socket));
  std::optional<StandingIdentification> standing;
  if (arguments.identify) standing.emplace(setup.limiter.robot);
  end_on_signals();
  const double begin = monotonic_seconds();
  long seen = 0;
  run_guard(guard, side.connection(), planner ? &*planner : nullptr, setup.limiter.dt, [&](double now) {
    if (person) person->poll(now, guard);
    if (door) guard.note_network(door->counts());
    if (log) log->add(guard);
    if (standing && guard.status().states > seen) standing->see(guard.reading());
    seen = guard.status().states;
    return asked_to_end == 0 && now - begin < arguments.seconds;
  });
  nlohmann::json status = status_json(guard);
  std::string text = status_text(guard, monotonic_seconds() - begin);
  if (guard.status().states > 0 && standing) {
    const StandingFindings found = standing->findings();
    status["standing"] = findings_json(found, *setup.limiter.robot);
    text += "\n" + findings_text(found, *setup.limiter.robot);
  }
  print(session, text, status);
  if (guard.status().states == 0) throw MissingError(fmt::format("no state of {} has come", where(config)));
}

// A word for a person to type; not a secret.
std::string new_word() {
  constexpr const char* kWords[] = {"kestrel", "heron", "plover", "osprey", "dunlin", "linnet", "avocet", "merlin"};
  std::random_device random;
  return fmt::format("{}-{:03d}", kWords[random() % std::size(kWords)], random() % 1000);
}

ArmingFacts facts_for(const RobotConfig& config, const GuardSetup& setup, const HardwareArguments& arguments,
                      const RunLog& log) {
  ArmingFacts facts;
  facts.permission = config.permission;
  facts.twin = config.twin;
  facts.executor = config.executor;
  facts.odometry = config.odometry;
  facts.asked_to_arm = true;
  facts.contact_limits = setup.limiter.contact_limits;
  facts.log_is_open = log.good();
  facts.free_log_bytes =
      static_cast<double>(std::filesystem::space(std::filesystem::absolute(arguments.log).parent_path()).available);
  facts.shown_nonce = new_word();
  facts.shown_at = monotonic_seconds();
  return facts;
}

// Follows the guard until nothing was ever armed or its operator has asked twice for the end; says each change of
// state.
class ArmedRun {
 public:
  ArmedRun(Session& session, RobotGuard& guard, RobotSide& side, RunLog& log, ArmingFacts facts)
      : session_(session), guard_(guard), side_(side), log_(log), facts_(std::move(facts)) {}

  bool go_on() {
    log_.add(guard_);
    const GuardStatus& status = guard_.status();
    const SafetyState state = status.safety.state;
    if (state != last_) say_state(status);
    if (status.input.now - said_at_ >= kSaidEvery) say_what_it_waits_for(status);
    if (ModeWatch* mode = armed_ ? nullptr : side_.maker_mode()) mode->poll(monotonic_seconds());
    if (state == SafetyState::kReady && !armed_) try_to_arm(status);
    if (asked_to_end != 0) guard_.stop();
    // A robot that was armed is commanded until its operator has asked twice.
    return refusal_.empty() && asked_to_end < (status.order.writes ? 2 : 1);
  }
  [[nodiscard]] const std::string& refusal() const { return refusal_; }

 private:
  void say_state(const GuardStatus& status) {
    last_ = status.safety.state;
    said_at_ = status.input.now;
    note(session_, fmt::format("{} ({}){}{}", safety_state_name(last_), stop_cause_name(status.safety.cause),
                               next_step(), why()));
  }
  [[nodiscard]] std::string next_step() const {
    if (last_ == SafetyState::kHold) return fmt::format(": it stands until {} (with R1), or select", held_key());
    const bool damped = last_ == SafetyState::kDamp || last_ == SafetyState::kFault;
    return damped || (armed_ && last_ == SafetyState::kListen) ? fmt::format(": {}", kTwice) : "";
  }
  // The cause in words, and the joint that it is about.
  [[nodiscard]] std::string why() const {
    const std::string_view text = stop_cause_text(guard_.status().safety.cause);
    return text.empty() ? "" : fmt::format("\n  {}{}", text, in_doubt_text(guard_));
  }
  [[nodiscard]] std::string_view held_key() const { return guard_.status().input.stands ? "A" : "start"; }
  // Now and then while it waits: nobody else says why.
  void say_what_it_waits_for(const GuardStatus& status) {
    std::string waits;
    if (last_ == SafetyState::kListen && !armed_ && !status.safety.missing.empty())
      waits = fmt::format("lately missing: {}{}: {}", status.safety.missing, in_doubt_text(guard_),
                          stop_cause_text(status.safety.missing));
    if (last_ == SafetyState::kStand) waits = status.input.stands ? walk_waits(status) : stand_waits(status);
    const long refused = refused_estimates(status.person);
    if (refused > told_refused_)
      waits += fmt::format("{}{}", waits.empty() ? "" : "; ", person_counts_text(status.person));
    told_refused_ = refused;
    const long kept_out = refused_datagrams(status.network);
    if (kept_out > told_kept_out_)
      waits += fmt::format("{}{}", waits.empty() ? "" : "; ", network_counts_text(status.network));
    told_kept_out_ = kept_out;
    if (waits.empty()) return;
    said_at_ = status.input.now;
    note(session_, fmt::format("{} ({})", safety_state_name(last_), waits));
  }
  [[nodiscard]] std::string stand_waits(const GuardStatus& status) const {
    const StopCause cause = stand_waits_for(guard_.setup().rules, status.input);
    if (cause != StopCause::kNone) return fmt::format("does not move: {}", stop_cause_name(cause));
    return status.share < 0.01 ? "does not move: somebody is too near, or nobody says where the robot is" : "";
  }
  [[nodiscard]] std::string walk_waits(const GuardStatus& status) const {
    const StopCause cause = walk_waits_for(guard_.setup().rules, status.input);
    if (cause == StopCause::kNone) return "";
    return fmt::format("does not walk: {}: {}", stop_cause_name(cause), stop_cause_text(cause));
  }
  void try_to_arm(const GuardStatus& status) {
    facts_.now = monotonic_seconds();  // as the word's age is told, whatever clock the guard ticks by
    facts_.remote_key_held = status.input.now - status.input.dead_man_at < 0.1;
    facts_.reported_mode_machine = guard_.reading().mode_machine;
    facts_.executor_complaint = side_.executor().complaint();
    const ModeWatch* mode = side_.maker_mode();
    facts_.running_mode = mode == nullptr ? "" : mode->mode().value_or("");
    refusal_ = arming_refusal(facts_);
    if (!refusal_.empty()) return;
    if (!facts_.twin && mode != nullptr && !mode->mode())
      note(session_,
           "the maker's motion_switcher does not answer: whether a mode of the maker's owns the motors is not known");
    guard_.arm();
    armed_ = true;
  }

  Session& session_;
  RobotGuard& guard_;
  RobotSide& side_;
  RunLog& log_;
  ArmingFacts facts_;
  SafetyState last_ = SafetyState::kOffline;
  double said_at_ = 0.0;                       // by the guard's clock [s]
  long told_refused_ = 0, told_kept_out_ = 0;  // estimates of a person; datagrams from other computers
  bool armed_ = false;
  std::string refusal_;
};

std::string executed_text(const RobotConfig& config, const GuardSetup& setup) {
  const RobotModel& robot = *setup.limiter.robot;
  return executed_channels_text(executed_channels(config.executor, robot, setup.limiter.executed.joints, setup.walker),
                                robot);
}

// Null where none is asked for.
std::unique_ptr<Walker> walker_for(const HardwareArguments& arguments, const GuardSetup& setup) {
  if (arguments.walker.empty()) return nullptr;
  ControllerOptions options;
  if (!arguments.walker_network.empty()) options["network"] = arguments.walker_network;
  return std::make_unique<Walker>(arguments.walker, options, setup.limiter.robot);
}

void run_arm(Session& session, const HardwareArguments& arguments) {
  const RobotConfig config = read_robot_config(arguments.config);
  GuardSetup setup = guard_setup(config, false);
  setup.walker = arguments.walker;
  const std::string refusal = walker_refusal(config.executor, arguments.walker, is_told_velocities(arguments.walker));
  if (!refusal.empty()) throw InputError("not armed: " + refusal);
  setup.checklist = checked_form(session, arguments.config, config);
  const std::unique_ptr<Walker> walker = walker_for(arguments, setup);
  RunLog log(arguments.log, setup, status_sender(arguments.socket));
  ArmingFacts facts = facts_for(config, setup, arguments, log);
  if (!config.twin)
    note(session, fmt::format("where this program dies nothing commands it: {}", when_commands_end(config)));
  note(session,
       fmt::format("{}\nguards {}: damps it, stands it up at start, follows the planner at '{}' at A, moves only "
                   "while R1 is held, logs to '{}'. Ctrl-C damps it, twice ends.\n{}\ntype '{}' within {} s to arm:",
                   kNotSafetyRated, where(config), arguments.socket, arguments.log, executed_text(config, setup),
                   facts.shown_nonce, kNonceTime));
  std::getline(std::cin, facts.typed_nonce);
  facts.now = monotonic_seconds();
  facts.reported_mode_machine = config.permission.mode_machine;  // not heard yet: asked again when it is
  facts.remote_key_held = true;
  if (const std::string why = arming_refusal(facts); !why.empty()) throw InputError("not armed: " + why);
  DatagramSocket planner = DatagramSocket::at_path(arguments.socket);
  const std::unique_ptr<OpenDoor> door = open_door(config, arguments);
  if (arguments.lock_step)
    ask_for_sharp_timers();
  else
    note(session, real_time_text());
  RobotSide side(config, side_options(arguments, true));
  LockStepWire stepped(side.connection());
  RobotGuard guard(setup, arguments.lock_step ? static_cast<RobotWire&>(stepped) : side.connection(), side.executor());
  if (walker != nullptr) guard.let_walk(*walker);
  std::optional<PersonInput> person = person_input(config, arguments);
  ArmedRun run(session, guard, side, log, facts);
  ReportSender reports(arguments.socket);
  end_on_signals();
  const auto after_tick = [&](double now) {
    if (person) person->poll(now, guard);
    if (door) guard.note_network(door->counts());
    return run.go_on();
  };
  const auto in_time = [&](double now) {
    (void)reports.after_tick(guard);
    return after_tick(now);
  };
  const auto run_it = [&] {
    if (arguments.lock_step)
      run_guard_in_lock_step(guard, stepped, &planner, setup.limiter.dt,
                             {after_tick, [&] { return reports.after_tick(guard); }});
    else
      run_guard(guard, side.connection(), &planner, setup.limiter.dt, in_time);
  };
  run_or_damp(guard, run_it, [&](const std::exception& error) {
    note(session, fmt::format("{}; {}", error.what(), kTwice));
    run_guard(guard, side.connection(), nullptr, setup.limiter.dt, [&](double) { return asked_to_end < 2; });
  });
  if (!run.refusal().empty()) throw InputError("not armed: " + run.refusal());
  print(session,
        fmt::format("{}; log '{}', {} ticks left out; {} messages were old, {} streams began anew",
                    safety_state_name(guard.status().safety.state), arguments.log, log.dropped(),
                    guard.status().old_messages, guard.status().restarts),
        status_json(guard));
  if (guard.status().safety.state == SafetyState::kFault) session.exit_code = kExitGate;
}

// The first `size` bytes of `message`.
void tell(DatagramSocket& guard, const std::string& socket, const GuardBuffer& message, std::size_t size) {
  if (!guard.send(std::span<const std::byte>(message).first(size)))
    throw std::runtime_error(fmt::format("the guard at '{}' has gone", socket));
}

void run_plan(Session& session, const HardwareArguments& arguments) {
  if (!arguments.episode.clip.empty()) return run_clip_episode(session, arguments.episode, arguments.socket);
  const std::shared_ptr<const RobotModel> robot = load_shared_robot();
  PlannerMessage message;
  message.command.root = parse_velocity_command(arguments.command, HardwareLimits{}.height);
  message.command.q = robot->neutral;
  note(session,
       fmt::format("asks the guard at '{}' for {} (forward, left [m/s], turn [rad/s]) with the arms in the neutral "
                   "pose for {} s, then for standing still. The guard limits it.",
                   arguments.socket, arguments.command, arguments.seconds));
  DatagramSocket guard = DatagramSocket::to_path(arguments.socket);
  GuardBuffer buffer;
  end_on_signals();
  const double begin = monotonic_seconds();
  long sent = 0;
  message.sequence = static_cast<std::uint64_t>(begin * 1e6);
  for (double now = begin; asked_to_end == 0 && now - begin < arguments.seconds + 1.0; now = monotonic_seconds()) {
    if (now - begin > arguments.seconds) message.command.root = {0.0, 0.0, 0.0, message.command.root.height};
    message.command.stamp = now;
    ++message.sequence;
    tell(guard, arguments.socket, buffer, encode(message, buffer));
    ++sent;
    std::this_thread::sleep_for(std::chrono::duration<double>(kPlanPeriod));
  }
  print(session, fmt::format("{} commands sent", sent), {{"sent", sent}});
}

void run_stop(Session& session, const HardwareArguments& arguments) {
  note(session, fmt::format("asks the guard at '{}' to damp the robot", arguments.socket));
  DatagramSocket guard = DatagramSocket::to_path(arguments.socket);
  GuardBuffer buffer;
  tell(guard, arguments.socket, buffer, encode_stop(buffer));
  print(session, "asked", {{"asked", true}});
}

using HardwareCommand = void (*)(Session&, const HardwareArguments&);

CLI::App* add_one(CLI::App& hardware, Session& session, const std::shared_ptr<HardwareArguments>& arguments,
                  const std::string& name, const std::string& description, const std::string& example,
                  HardwareCommand command) {
  CLI::App* app = add_command(hardware, session, name, description, example);
  app->callback([&session, arguments, command] { command(session, *arguments); });
  return app;
}

void add_config(CLI::App* app, HardwareArguments& arguments) {
  app->add_option("config", arguments.config, "configuration of the robot or twin (YAML)")->required();
}

void add_socket(CLI::App* app, HardwareArguments& arguments) {
  app->add_option("--socket", arguments.socket, "local socket of the guard")->capture_default_str();
}

void add_seconds(CLI::App* app, HardwareArguments& arguments) {
  app->add_option("--seconds", arguments.seconds, "how long")->capture_default_str()->check(CLI::Range(0.1, 86400.0));
}

}  // namespace

void add_hardware(CLI::App& app, Session& session) {
  CLI::App* hardware = app.add_subcommand(
      "hw", "a real G1, or its twin: check, dry-run, arm, run, stop, status, report (not safety-rated)");
  hardware->require_subcommand(1);
  const auto arguments = std::make_shared<HardwareArguments>();
  CLI::App* check =
      add_one(*hardware, session, arguments, "check", "listen to it and say what is missing; writes nothing",
              "duet hw check examples/hardware/twin.yaml",
              [](Session& s, const HardwareArguments& a) { listen_for(s, a, false); });
  CLI::App* dry = add_one(*hardware, session, arguments, "dry-run",
                          "the whole guard with a planner, but without a writer: nothing can reach the robot",
                          "duet hw dry-run examples/hardware/twin.yaml --seconds 20",
                          [](Session& s, const HardwareArguments& a) { listen_for(s, a, true); });
  CLI::App* arm = add_one(*hardware, session, arguments, "arm", "guard it: the process that alone commands it",
                          "duet hw arm examples/hardware/twin.yaml --log run.mcap --velocity-port 15001", run_arm);
  CLI::App* plan = add_one(*hardware, session, arguments, "run", "ask the guard for a velocity, for a time",
                           "duet hw run --command 0.2,0,0 --seconds 5", run_plan);
  CLI::App* stop =
      add_one(*hardware, session, arguments, "stop", "ask the guard to damp the robot", "duet hw stop", run_stop);
  for (CLI::App* listens : {check, dry, arm}) add_config(listens, *arguments);
  for (CLI::App* talks : {dry, arm, plan, stop}) add_socket(talks, *arguments);
  for (CLI::App* lasts : {check, dry, plan}) add_seconds(lasts, *arguments);
  for (CLI::App* logs : {check, dry}) logs->add_option("--log", arguments->log, "log to make (MCAP)");
  check->add_flag("--identify", arguments->identify,
                  "compare ten seconds of standing with the card: mass, centre of mass, IMU, zeros of the legs");
  arm->add_option("--log", arguments->log, "log to make (MCAP)")->required();
  arm->add_option("--velocity-port", arguments->velocity_port,
                  "UDP port of 127.0.0.1 that takes a twin's velocities (executor 'twin')")
      ->check(CLI::Range(1, 65535));
  for (CLI::App* sees : {check, dry, arm}) {
    sees->add_option("--person-socket", arguments->person_socket,
                     "local socket where a camera's estimator sends (configuration with 'camera')")
        ->capture_default_str();
    sees->add_option("--pose-socket", arguments->pose_socket,
                     "local socket where a tracker sends the base's pose (odometry 'external')")
        ->capture_default_str();
  }
  add_play_partner(*hardware, session);
  add_network(*hardware, session);
  add_checklist(*hardware, session);
  add_see(*hardware, session);
  add_calibrate(*hardware, session);
  add_holds(*hardware, session);
  add_walks(*hardware, session);
  add_log_commands(*hardware, session);
  arm->add_option("--walker", arguments->walker, "controller that keeps it on its feet (homie, wbc_sim, ...)");
  arm->add_option("--network", arguments->walker_network, "of the walker");
  arm->add_flag("--lock-step", arguments->lock_step, "by the clock of a twin that waits for each command");
  plan->add_option("--command", arguments->command, "\"vx,vy,wz\" [m/s, m/s, rad/s]")->capture_default_str();
  add_clip_options(*plan, arguments->episode);
  add_hardware_episodes(*hardware, session);
}

}  // namespace duet::cli
