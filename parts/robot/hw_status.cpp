#include <fmt/format.h>

#include <csignal>
#include <thread>

#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/twin/fakes.h"
#include "duet/motion/interaction_clip.h"
#include "duet/parts/robot/hw.h"

namespace duet::cli {
namespace {

// Why it is not ready, or "ready".
std::string readiness(const RobotGuard& guard) {
  const GuardStatus& status = guard.status();
  if (status.safety.state == SafetyState::kOffline) return "no state has come";
  const std::string_view missing = missing_for_arming(guard.setup().rules, status.safety, status.input);
  if (!missing.empty()) return fmt::format("missing: {}{}", missing, in_doubt_text(guard));
  const std::string state(safety_state_name(status.safety.state));
  const bool was_missing = status.safety.state == SafetyState::kListen && !status.safety.missing.empty();
  return was_missing ? fmt::format("{} (lately missing: {})", state, status.safety.missing) : state;
}

std::string clamp_text(const ClampCounts& clamps) {
  std::string text;
  for (std::size_t k = 0; k < kClampReasons; ++k)
    if (clamps[k] > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", kClampNames[k], clamps[k]);
  return text.empty() ? "none" : text;
}

// The keys that the guard reads, as they are held.
std::string keys_text(const RemoteControl& remote) {
  constexpr std::pair<RemoteKey, const char*> kKeys[] = {{RemoteKey::kR1, "R1"},         {RemoteKey::kStart, "start"},
                                                         {RemoteKey::kSelect, "select"}, {RemoteKey::kL2, "L2"},
                                                         {RemoteKey::kA, "A"},           {RemoteKey::kB, "B"}};
  std::string text;
  for (const auto& [key, name] : kKeys)
    if (remote.holds(key)) text += fmt::format("{}{}", text.empty() ? "" : ", ", name);
  return text.empty() ? "no key held" : text + " held";
}

// Readings to be compared with the robot at hand.
std::string reading_text(const RobotGuard& guard) {
  const RobotReading& reading = guard.reading();
  if (!reading.any) return "";
  std::string text =
      fmt::format("\n  mode_machine {} (configured: {}), mode_pr {}\n  joints [rad]:", reading.mode_machine,
                  guard.setup().mode_machine, reading.mode_pr);
  const std::vector<RobotJoint>& joints = guard.setup().limiter.robot->joints;
  constexpr std::size_t kInALine = 5;
  for (std::size_t j = 0; j < joints.size(); ++j)
    text += fmt::format("{}{} {:.3f}", j % kInALine == 0 ? "\n    " : ", ", joints[j].name,
                        reading.state.q[static_cast<Eigen::Index>(j)]);
  return text;
}

}  // namespace

std::string real_time_text() {
  return ask_for_real_time() ? "real-time priority: yes"
                             : "real-time priority: no (it takes CAP_SYS_NICE or a limit rtprio); a machine that is "
                               "busy with other things will be late, and hold the robot";
}

std::string in_doubt_text(const RobotGuard& guard) {
  const int joint = guard.status().input.health.joints.joint;
  return joint < 0 ? "" : fmt::format(" ({})", guard.setup().limiter.robot->joints[joint].name);
}

nlohmann::json status_json(const RobotGuard& guard) {
  const GuardStatus& status = guard.status();
  nlohmann::json clamps = nlohmann::json::object(), estimates = nlohmann::json::object(), network;
  for (std::size_t k = 0; k < kPersonFaults; ++k) estimates[estimate_name(k)] = status.person[k];
  for (std::size_t k = 0; k < kSealRefusals; ++k) network[datagram_name(k)] = status.network[k];
  for (std::size_t k = 0; k < kClampReasons; ++k) clamps[std::string(kClampNames[k])] = status.clamps[k];
  return {{"state", safety_state_name(status.safety.state)},
          {"cause", stop_cause_name(status.safety.cause)},
          {"readiness", readiness(guard)},
          {"states", status.states},
          {"checksum_faults", status.checksum_faults},
          {"tick_faults", status.tick_faults},
          {"number_faults", status.number_faults},
          {"old_messages", status.old_messages},
          {"restarts", status.restarts},
          {"estimates", estimates},
          {"network", network},
          {"clamps", clamps}};
}

std::string status_text(const RobotGuard& guard, double seconds) {
  const GuardStatus& status = guard.status();
  const RobotHealth& health = status.input.health;
  const std::string estimates = person_counts_text(status.person), network = network_counts_text(status.network);
  return fmt::format(
      "{}\n  {} states in {:.1f} s; {} with a wrong checksum, {} old, {} not finite\n  tilt {:.3f} rad, hottest casing "
      "{:.0f} and winding {:.0f} degrees C, charge {:.0f} %, remote control {}\n  other writers of commands: {}{}{}\n  "
      "clamps: {}{}",
      readiness(guard), status.states, seconds, status.checksum_faults, status.tick_faults, status.number_faults,
      health.tilt, health.casing, health.winding, health.charge,
      status.input.remote_at == kNever ? "not heard" : "heard, " + keys_text(guard.reading().remote),
      status.input.foreign_writer ? "yes" : "none", estimates.empty() ? "" : "\n  person: " + estimates,
      network.empty() ? "" : "\n  " + network, clamp_text(status.clamps), reading_text(guard));
}

namespace {

struct PlayArguments {
  std::string clip, config, socket = "duet-person.socket";
  PersonPlay play;
  bool again = false;
};
volatile std::sig_atomic_t play_ends = 0;

// Sends the clip once; false where it was stopped.
bool play_once(PersonPlayer& player, double rate, DatagramSocket& guard, long& sent, std::uint64_t& sequence) {
  PersonEstimate estimate;
  PersonBuffer buffer;
  auto next = std::chrono::steady_clock::now();
  while (player.next(estimate)) {
    if (play_ends != 0) return false;
    estimate.sequence = ++sequence;
    encode(estimate, buffer);
    sent += guard.send(buffer) ? 1 : 0;
    next += std::chrono::nanoseconds(static_cast<long>(1e9 / rate));
    std::this_thread::sleep_until(next);
  }
  return true;
}

void run_play_partner(Session& session, const PlayArguments& arguments) {
  const RobotConfig config = read_robot_config(arguments.config);
  const InteractionClip clip = load_clip(arguments.clip);
  const Pose X_WB = base_of_reactor(clip.reactor_motion(), config.limits.height);
  note(session,
       fmt::format("sends the partner of '{}' to '{}' as a camera would, {} times a second with {} m of noise; "
                   "the robot is taken to stand where the clip's other person does",
                   clip.id, arguments.socket, arguments.play.rate, arguments.play.noise));
  DatagramSocket guard = DatagramSocket::to_path(arguments.socket);
  play_ends = 0;
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { play_ends = 1; });
  long sent = 0;
  auto sequence = static_cast<std::uint64_t>(monotonic_seconds() * 1e3);  // above those of a player before
  bool goes_on = true;
  for (std::uint64_t round = 0; goes_on && (round == 0 || arguments.again); ++round) {
    PersonPlay play = arguments.play;
    play.seed += round;
    PersonPlayer player(clip.actor_motion(), X_WB, config.camera.X_BC, play);
    goes_on = play_once(player, play.rate, guard, sent, sequence);
  }
  print(session, fmt::format("{} estimates sent", sent), {{"sent", sent}});
}

}  // namespace

void add_play_partner(CLI::App& hardware, Session& session) {
  CLI::App* command = add_command(hardware, session, "play-partner", "send a clip's partner as a camera would see them",
                                  "duet hw play-partner clip.npz --config examples/hardware/camera.yaml --noise 0.02");
  const auto arguments = std::make_shared<PlayArguments>();
  command->add_option("clip", arguments->clip, "two people (.npz of `duet synth` or `import`)")->required();
  command->add_option("--config", arguments->config, "configuration of the robot, with its 'camera'")->required();
  command->add_option("--socket", arguments->socket, "local socket of the guard")->capture_default_str();
  command->add_option("--rate", arguments->play.rate, "estimates a second")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 1000.0));
  command->add_option("--noise", arguments->play.noise, "on each axis of each joint [m]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--latency", arguments->play.latency, "from a picture to its message, which says so [s]")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--unseen", arguments->play.unseen, "share of estimates in which nobody is seen")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--seed", arguments->play.seed, "of noise and gaps")->capture_default_str();
  command->add_flag("--again", arguments->again, "from the beginning when the clip ends, until it is stopped");
  command->callback([&session, arguments] { run_play_partner(session, *arguments); });
}

}  // namespace duet::cli
