// duet hw key, duet hw link: a guard on another computer.
#include <fmt/format.h>

#include <csignal>

#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/network_door.h"
#include "duet/parts/robot/hw.h"

namespace duet::cli {
namespace {

constexpr double kLinkWait = 0.002, kLinkSaidEvery = 10.0;  // [s]
volatile std::sig_atomic_t link_ends = 0;

struct LinkArguments {
  std::string address, key;
  GuardSockets sockets;
  int sender = 1;
  double seconds = 0.0;
};

void run_key(Session& session, const std::string& path) {
  make_network_key(path);
  print(session, fmt::format("made '{}', for its owner alone: copy it to the other computers", path), {{"key", path}});
}

NetworkAddress address_of(const std::string& text) {
  try {
    return network_address(text);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("ADDRESS: {}", error.what()));
  }
}

std::string link_text(const LinkArguments& arguments, const NetworkLink& link, bool answers) {
  if (!answers)
    return fmt::format(
        "the guard at {} does not answer: is its 'network' this address, its key this one, and the port open?",
        arguments.address);
  return fmt::format("the guard at {} answers: {} datagrams sent, {} received", arguments.address, link.sent(),
                     link.received());
}

void run_link(Session& session, const LinkArguments& arguments) {
  const NetworkKey key = read_network_key(arguments.key);
  NetworkLink link(DatagramSocket::to_address(address_of(arguments.address)), key, arguments.sockets,
                   static_cast<std::uint16_t>(arguments.sender));
  note(session,
       fmt::format("carries what comes to '{}', '{}' and '{}' to the guard at {}, and its reports and status back",
                   arguments.sockets.guard, arguments.sockets.person, arguments.sockets.pose, arguments.address));
  link_ends = 0;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, [](int) { link_ends = 1; });
  const double begin = monotonic_seconds();
  double said_at = begin - kLinkSaidEvery + 2.0 * kTicketLife;  // it has time to answer
  bool answered = false;
  for (double now = begin; link_ends == 0 && (arguments.seconds == 0.0 || now - begin < arguments.seconds);
       now = monotonic_seconds()) {
    (void)link.wait(kLinkWait);
    link.step(now);
    const bool answers = link.silence(now) <= kTicketLife;
    if (answers != answered || (!answers && now - said_at >= kLinkSaidEvery)) {
      note(session, link_text(arguments, link, answers));
      said_at = now;
    }
    answered = answers;
  }
  print(session, link_text(arguments, link, answered),
        {{"answers", answered}, {"sent", link.sent()}, {"received", link.received()}});
  if (!answered) throw MissingError(fmt::format("no guard answers at {}", arguments.address));
}

}  // namespace

void add_network(CLI::App& hardware, Session& session) {
  const auto path = std::make_shared<std::string>();
  CLI::App* key =
      add_command(hardware, session, "key", "make the key that guard, planner and estimator on several computers share",
                  "duet hw key guard.key");
  key->add_option("file", *path, "file to make; it must not be there")->required();
  key->callback([&session, path] { run_key(session, *path); });

  const auto arguments = std::make_shared<LinkArguments>();
  CLI::App* link =
      add_command(hardware, session, "link",
                  "make a guard's sockets on this computer, for planners and estimators of a guard on another",
                  "duet hw link 192.168.123.10:15100 --key guard.key");
  link->add_option("address", arguments->address, "HOST:PORT of the guard ('network: bind' of its configuration)")
      ->required();
  link->add_option("--key", arguments->key, "file of the key ('duet hw key')")->required();
  link->add_option("--sender", arguments->sender, "number of this link, another for each that talks to one guard")
      ->capture_default_str()
      ->check(CLI::Range(0, static_cast<int>(kMostSenders) - 1));
  link->add_option("--socket", arguments->sockets.guard, "local socket of the guard")->capture_default_str();
  link->add_option("--person-socket", arguments->sockets.person, "local socket where an estimator sends")
      ->capture_default_str();
  link->add_option("--pose-socket", arguments->sockets.pose, "local socket where a tracker sends")
      ->capture_default_str();
  link->add_option("--seconds", arguments->seconds, "how long; 0: until Ctrl-C")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 86400.0));
  link->callback([&session, arguments] { run_link(session, *arguments); });
}

}  // namespace duet::cli
