#include "duet/parts/robot/hw_partner.h"

#include <fmt/format.h>

#include <csignal>
#include <thread>

#include "duet/hardware/guard_loop.h"
#include "duet/hardware/person_player.h"
#include "duet/hardware/robot_config.h"
#include "duet/motion/interaction_clip.h"

namespace duet::cli {
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
    PersonPlayer player(clip.actor_motion(), X_WB, config.X_BC, play);
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
  command->add_option("--unseen", arguments->play.unseen, "share of estimates in which nobody is seen")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--seed", arguments->play.seed, "of noise and gaps")->capture_default_str();
  command->add_flag("--again", arguments->again, "from the beginning when the clip ends, until it is stopped");
  command->callback([&session, arguments] { run_play_partner(session, *arguments); });
}

}  // namespace duet::cli
