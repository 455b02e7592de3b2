// A guard, and a planner on another computer: what crosses the network, what an attacker there can do (nothing), and
// what a bad network does to the robot (holds it). One simulated clock; the datagrams go over loopback, through a tap
// that loses, delays, repeats and alters them.
#include "duet/hardware/guard/network_door.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <deque>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "duet/core/digest.h"
#include "duet/core/numbers.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/guard/person_input.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using Datagram = std::vector<std::byte>;

NetworkKey key_of(int first) {
  NetworkKey key;
  key.fill(static_cast<std::byte>(first));
  return key;
}

NetworkAddress at(std::uint16_t port) { return {0x7F000001u, port}; }

// Between link and door.
class Tap {
 public:
  explicit Tap(std::uint16_t door) : here_(DatagramSocket::at_address(at(0))) { goes_to(door); }
  [[nodiscard]] std::uint16_t port() const { return here_.port(); }
  void goes_to(std::uint16_t door) { door_ = std::make_unique<DatagramSocket>(DatagramSocket::to_address(at(door))); }

  void step(double now) {
    std::array<std::byte, kMostSealedBytes + 1> buffer;
    while (const std::size_t size = here_.receive_from(buffer, from_)) {
      Datagram datagram(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
      seen.push_back(datagram);
      if (!loses || !loses(datagram)) waiting_.push_back({now + delay, std::move(datagram)});
    }
    for (; !waiting_.empty() && waiting_.front().first <= now; waiting_.pop_front())
      (void)door_->send(waiting_.front().second);
    while (const std::size_t size = door_->receive(buffer)) {
      answers.emplace_back(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
      answer(answers.back());
    }
  }
  void answer(const Datagram& datagram) { (void)here_.send_to(from_, datagram); }

  std::vector<Datagram> seen, answers;  // on their way to the door, and from it
  std::function<bool(const Datagram&)> loses;
  double delay = 0.0;  // [s]

 private:
  DatagramSocket here_;
  std::unique_ptr<DatagramSocket> door_;
  NetworkAddress from_;
  std::deque<std::pair<double, Datagram>> waiting_;
};

struct RemotePlanner {
  RemotePlanner()
      : robot(test::twin_guard()),
        here(sockets("here-")),
        there(sockets("there-")),
        guard_socket(DatagramSocket::at_path(here.guard)),
        reports(here.guard) {
    robot.plans = false;
    open_door();
    tap = std::make_unique<Tap>(door->port());
    open_link();
    robot.message.command.root.forward = 0.1;
  }
  GuardSockets sockets(const std::string& before) {
    return {folder / (before + "guard"), folder / (before + "person"), folder / (before + "pose")};
  }
  void open_door() {
    door = std::make_unique<NetworkDoor>(DatagramSocket::at_address(at(0)), key_of(1), here);
    if (tap) tap->goes_to(door->port());
  }
  void open_link(int key = 1) {
    planner.reset();
    link.reset();
    link = std::make_unique<NetworkLink>(DatagramSocket::to_address(at(tap->port())), key_of(key), there,
                                         std::uint16_t{2});
    planner = std::make_unique<DatagramSocket>(DatagramSocket::to_path(there.guard));
  }
  void tick() {
    if (plans && robot.ticks % 10 == 0) {
      ++robot.message.sequence;
      robot.message.command.stamp = robot.now;
      (void)planner->send(std::span<const std::byte>(buffer).first(encode(robot.message, buffer)));
    }
    if (attack) attack();
    link->step(robot.now);
    tap->step(robot.now);
    door->step(robot.now);
    tap->step(robot.now);
    take_messages(guard_socket, robot.guard, message, robot.now);
    robot.guard.note_network(door->counts());
    robot.tick();
    (void)reports.after_tick(robot.guard);
    if (robot.guard.status().sent) frames.update(std::as_bytes(std::span(&robot.guard.status().frame, 1)));
  }
  void run_for(double seconds) {
    for (double left = seconds; left > 0.5 * test::GuardedTwin::kDt; left -= test::GuardedTwin::kDt) tick();
  }
  void start() {
    robot.hold_key(RemoteKey::kR1);
    run_for(2.2);
    robot.guard.arm();
    tick();
    press(RemoteKey::kStart, 1.0);
    press(RemoteKey::kA, 0.0);
  }
  void press(RemoteKey key, double then) {
    robot.hold_key(key);
    run_for(0.1);
    robot.drop_key(key);
    run_for(then);
  }
  [[nodiscard]] long count(SealRefusal refusal) const { return door->counts()[static_cast<std::size_t>(refusal)]; }

  test::ScratchFolder folder;
  test::GuardedTwin robot;
  GuardSockets here, there;
  DatagramSocket guard_socket;
  ReportSender reports;
  std::unique_ptr<NetworkDoor> door;
  std::unique_ptr<Tap> tap;
  std::unique_ptr<NetworkLink> link;
  std::unique_ptr<DatagramSocket> planner;
  GuardMessage message;
  GuardBuffer buffer{};
  std::function<void()> attack;
  bool plans = true;
  Sha256 frames;  // of all that were sent to the robot
};

TEST(NetworkDoor, APlannerOnAnotherComputerWalksTheRobot) {
  RemotePlanner remote;
  remote.start();
  remote.run_for(3.0);
  EXPECT_EQ(remote.robot.state(), SafetyState::kRun) << stop_cause_name(remote.robot.cause());
  EXPECT_NEAR(remote.robot.velocity.last.forward, 0.1, 1e-6);
  EXPECT_GT(remote.count(SealRefusal::kNone), 300);
  EXPECT_EQ(refused_datagrams(remote.door->counts()), 0);
  EXPECT_EQ(remote.robot.bad_frames, 0);
}

// Plans without a seal and under another key, bytes that were altered or cut, and everything that was ever sent, again
// and again, a thousand datagrams for each plan that is genuine: the robot does, to the bit, what it does without.
TEST(NetworkDoor, WhoHasNoKeyMovesHoldsAndSlowsNothing) {
  RemotePlanner quiet;
  quiet.start();
  quiet.run_for(2.0);
  RemotePlanner flooded;
  DatagramSocket attacker = DatagramSocket::to_address(at(flooded.door->port()));
  Random random(5, 1);
  long sent = 0;
  SealedBuffer forged;
  PlannerMessage evil = flooded.robot.message;
  evil.command.root.forward = -1.0;
  flooded.attack = [&] {
    const auto shoot = [&](std::span<const std::byte> bytes) { sent += attacker.send(bytes) ? 1 : 0; };
    const auto& seen = flooded.tap->seen;
    for (int k = 0; k < 20; ++k) {
      GuardBuffer plan;
      evil.sequence = std::uint64_t{1} << 60;
      const std::span<const std::byte> bytes = std::span<const std::byte>(plan).first(encode(evil, plan));
      shoot(bytes);
      const std::size_t size = seal(key_of(9), {SealedKind::kGuard, 2, 1, evil.sequence, 1e9}, bytes, forged);
      shoot(std::span<const std::byte>(forged).first(size));
      if (seen.empty()) continue;
      Datagram old = seen[static_cast<std::size_t>(random.below(static_cast<int>(seen.size())))];
      if (seen.size() > 5) shoot(seen[seen.size() / 2]);
      old[static_cast<std::size_t>(random.below(static_cast<int>(old.size())))] ^= std::byte{64};
      shoot(old);
      old.resize(old.size() / 2);
      shoot(old);
    }
  };
  flooded.start();
  flooded.run_for(2.0);
  EXPECT_EQ(flooded.robot.state(), SafetyState::kRun) << stop_cause_name(flooded.robot.cause());
  EXPECT_GT(sent, 100'000);
  EXPECT_EQ(flooded.frames.hex(), quiet.frames.hex());
  EXPECT_EQ(flooded.count(SealRefusal::kNone), quiet.count(SealRefusal::kNone));
  EXPECT_GT(flooded.count(SealRefusal::kForged), 30'000);
  EXPECT_GT(flooded.count(SealRefusal::kVersion), 20'000);
  EXPECT_GT(flooded.count(SealRefusal::kRepeated) + flooded.count(SealRefusal::kTicket), 10'000);
  EXPECT_GT(flooded.count(SealRefusal::kShort), 5'000);
  EXPECT_EQ(flooded.robot.guard.status().network, flooded.door->counts());
}

TEST(NetworkDoor, ALostNetworkHoldsAsALatePlannerDoes) {
  RemotePlanner remote;
  remote.start();
  remote.run_for(1.0);
  ASSERT_EQ(remote.robot.state(), SafetyState::kRun);
  remote.tap->loses = [](const Datagram&) { return true; };
  double lasted = 0.0;
  for (; remote.robot.state() == SafetyState::kRun && lasted < 2.0; lasted += test::GuardedTwin::kDt) remote.tick();
  EXPECT_EQ(remote.robot.state(), SafetyState::kHold);
  EXPECT_EQ(remote.robot.cause(), StopCause::kPlannerAge);
  EXPECT_NEAR(lasted, 0.6, 0.03);
  EXPECT_EQ(remote.robot.bad_frames, 0);
}

TEST(NetworkDoor, OneDatagramOfThreeThatIsLostHoldsNothing) {
  RemotePlanner remote;
  remote.tap->loses = [k = 0](const Datagram&) mutable { return ++k % 3 == 0; };
  remote.start();
  remote.run_for(3.0);
  EXPECT_EQ(remote.robot.state(), SafetyState::kRun) << stop_cause_name(remote.robot.cause());
  EXPECT_EQ(refused_datagrams(remote.door->counts()), 0);
}

TEST(NetworkDoor, ADelayThatBeginsIsLateAndHolds) {
  RemotePlanner remote;
  remote.start();
  remote.run_for(1.0);
  ASSERT_EQ(remote.robot.state(), SafetyState::kRun);
  remote.tap->delay = 0.2;
  remote.run_for(2.0);
  EXPECT_EQ(remote.robot.state(), SafetyState::kRun);
  remote.tap->delay = 0.4;
  remote.run_for(2.0);
  EXPECT_EQ(remote.robot.state(), SafetyState::kHold);
  EXPECT_EQ(remote.robot.cause(), StopCause::kPlannerAge);
  EXPECT_GT(remote.count(SealRefusal::kLate), 20);
}

// No clock that both share, and no datagram that was faster: the ticket alone knows.
TEST(NetworkDoor, ADelayThatWasThereFromTheStartIsNeverTakenBeyondASecond) {
  RemotePlanner remote;
  remote.tap->delay = 1.2;
  remote.start();
  remote.run_for(3.0);
  EXPECT_NE(remote.robot.state(), SafetyState::kRun);
  EXPECT_EQ(remote.robot.guard.planner().sequence, 0u);
  EXPECT_EQ(remote.count(SealRefusal::kNone), 0);
}

TEST(NetworkDoor, WhatWasRecordedOfARunMovesNoGuardThatWasStartedAnew) {
  RemotePlanner remote;
  remote.start();
  remote.run_for(1.0);
  const std::vector<Datagram> recorded = remote.tap->seen;
  remote.open_door();
  DatagramSocket attacker = DatagramSocket::to_address(at(remote.door->port()));
  for (const Datagram& datagram : recorded) {
    (void)attacker.send(datagram);
    remote.door->step(remote.robot.now);
  }
  EXPECT_EQ(remote.count(SealRefusal::kNone), 0);
  EXPECT_GT(remote.count(SealRefusal::kTicket), 100);
  EXPECT_EQ(remote.count(SealRefusal::kTicket), refused_datagrams(remote.door->counts()));
}

TEST(NetworkDoor, BothEndsMayBeStartedAnew) {
  RemotePlanner remote;
  remote.start();
  remote.run_for(1.0);
  remote.open_link();
  remote.run_for(1.0);
  EXPECT_EQ(remote.robot.state(), SafetyState::kRun) << stop_cause_name(remote.robot.cause());
  EXPECT_EQ(refused_datagrams(remote.door->counts()), 0);
  remote.open_door();
  remote.run_for(0.3);
  EXPECT_GT(remote.count(SealRefusal::kNone), 5);
  EXPECT_EQ(remote.robot.state(), SafetyState::kRun) << stop_cause_name(remote.robot.cause());
  EXPECT_LT(remote.link->silence(remote.robot.now), 0.2);
}

TEST(NetworkDoor, AnotherKeyIsForgedAndItsLinkHearsNothing) {
  RemotePlanner remote;
  remote.open_link(2);
  remote.run_for(1.0);
  EXPECT_EQ(remote.count(SealRefusal::kNone), 0);
  EXPECT_GE(remote.count(SealRefusal::kForged), 9);
  EXPECT_GT(remote.link->silence(remote.robot.now), kTicketLife);
  EXPECT_EQ(remote.link->sent(), 0) << "what it had would be old";
}

TEST(NetworkDoor, ReportsAndStatusComeToWhoAsksWithTheKey) {
  RemotePlanner remote;
  SocketGuardLink planner(remote.there.guard, 0.001);
  DatagramSocket status = DatagramSocket::at_path(status_path(remote.there.guard));
  std::unique_ptr<LocalPeer> teller = std::make_unique<LocalPeer>(status_path(remote.here.guard));
  // A request that is repeated does not lead the reports to its sender.
  DatagramSocket attacker = DatagramSocket::to_address(at(remote.door->port()));
  remote.attack = [&] {
    if (!remote.tap->seen.empty()) (void)attacker.send(remote.tap->seen.back());
    (void)teller->send(std::as_bytes(std::span("fine")), remote.robot.now);
  };
  GuardReport report;
  std::array<std::byte, 100> text{};
  int reports = 0, told = 0;
  for (int k = 0; k < 1000; ++k) {
    remote.tick();
    reports += planner.next(report) ? 1 : 0;
    while (status.receive(text) > 0) ++told;
  }
  EXPECT_GT(reports, 60);
  EXPECT_GT(told, 100);
  EXPECT_GE(report.tick + 20, static_cast<std::uint64_t>(remote.robot.guard.status().ticks));
  std::array<std::byte, kMostSealedBytes> stolen;
  SealedHead head;
  std::span<const std::byte> carried;
  while (const std::size_t size = attacker.receive(stolen)) {
    ASSERT_EQ(unseal(key_of(1), std::span(stolen).first(size), head, carried), SealRefusal::kNone);
    EXPECT_EQ(head.kind, SealedKind::kTicket);
  }
}

TEST(NetworkDoor, APersonAndATrackerReachTheirSocketsOrNobody) {
  RemotePlanner remote;
  remote.run_for(0.3);
  DatagramSocket estimator = DatagramSocket::to_path(remote.there.person),
                 tracker = DatagramSocket::to_path(remote.there.pose);
  PersonBuffer person;
  PersonEstimate someone;
  someone.sequence = 5;
  encode(someone, person);
  ASSERT_TRUE(estimator.send(person));
  remote.tick();
  EXPECT_EQ(remote.count(SealRefusal::kUnwanted), 1) << "no camera is configured";
  DatagramSocket camera = DatagramSocket::at_path(remote.here.person),
                 poses = DatagramSocket::at_path(remote.here.pose);
  remote.run_for(0.2);
  ASSERT_TRUE(estimator.send(person) && tracker.send(std::span<const std::byte>(person).first(104)));
  remote.tick();
  PersonBuffer received{};
  EXPECT_EQ(camera.receive(received), kPersonBytes);
  EXPECT_EQ(received, person);
  EXPECT_EQ(poses.receive(received), 104u);
}

TEST(NetworkDoor, AnAnswerThatWasRecordedIsHeardOnce) {
  RemotePlanner remote;
  SocketGuardLink planner(remote.there.guard, 0.001);
  remote.run_for(1.0);
  const long received = remote.link->received();
  const std::vector<Datagram> recorded = std::exchange(remote.tap->answers, {});
  ASSERT_GT(received, 10);
  remote.tap->loses = [](const Datagram&) { return true; };  // the door is not asked any more
  remote.run_for(0.1);
  const long before = remote.link->received();
  remote.attack = [&] {
    for (std::size_t k = recorded.size() - 5; k < recorded.size(); ++k) remote.tap->answer(recorded[k]);
  };
  remote.run_for(1.5);
  EXPECT_GT(remote.link->silence(remote.robot.now), kTicketLife) << "old tickets are no sign of a door";
  EXPECT_LE(remote.link->received() - before, 60) << "a second of reports may come that were asked for";
}

// Messages that only the guard sends do not come back to it.
TEST(NetworkDoor, AnAnswerThatIsSentBackIsNoMessage) {
  RemotePlanner remote;
  DatagramSocket mirror = DatagramSocket::to_address(at(remote.door->port()));
  SealedBuffer buffer;
  for (const SealedKind kind : {SealedKind::kTicket, SealedKind::kReport, SealedKind::kStatus}) {
    const std::size_t size = seal(key_of(1), {kind, 0, 0, 1, 0.0}, {}, buffer);
    (void)mirror.send(std::span<const std::byte>(buffer).first(size));
  }
  remote.door->step(remote.robot.now);
  EXPECT_EQ(remote.count(SealRefusal::kKind), 3);
}

TEST(OpenDoor, OpensByItselfUntilItIsGone) {
  const test::ScratchFolder folder;
  const GuardSockets here{folder / "guard", folder / "person", folder / "pose"};
  const std::uint16_t port = DatagramSocket::at_address(at(0)).port();  // free again at once
  DatagramSocket guard = DatagramSocket::at_path(here.guard);
  const OpenDoor door(at(port), key_of(1), here);
  NetworkLink link(DatagramSocket::to_address(at(port)), key_of(1),
                   {folder / "there", folder / "there-person", folder / "there-pose"}, 1);
  DatagramSocket planner = DatagramSocket::to_path(folder / "there");
  double now = 0.0;
  for (int k = 0; k < 10'000 && link.silence(now) > kTicketLife; ++k) {
    now += 0.001;
    link.step(now);
    (void)link.wait(0.001);
  }
  ASSERT_LE(link.silence(now), kTicketLife);
  GuardBuffer buffer;
  (void)planner.send(std::span<const std::byte>(buffer).first(encode_stop(buffer)));
  link.step(now);
  EXPECT_TRUE(guard.wait(10.0));
  EXPECT_EQ(guard.receive(buffer), 16u);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] {
    NetworkLink(DatagramSocket::to_address(at(port)), key_of(1), {folder / "a", folder / "b", folder / "c"}, 16);
  }));
}

// The printed example, a process of Python's own library: three pictures of the person reach the guard's socket.
TEST(OpenDoor, TheExampleInPythonIsTaken) {
  if (std::system("python3 -c 'import hmac' >/dev/null 2>&1") != 0) GTEST_SKIP() << "not run: python3 absent";
  const test::ScratchFolder folder;
  make_network_key(folder / "guard.key");
  const std::uint16_t port = DatagramSocket::at_address(at(0)).port();
  DatagramSocket camera = DatagramSocket::at_path(folder / "person");
  const OpenDoor door(at(port), read_network_key(folder / "guard.key"),
                      {folder / "guard", folder / "person", folder / "pose"});
  const std::string example =
      std::string(DUET_SOURCE_DIR) + "/examples/hardware/estimator.py 127.0.0.1 " + std::to_string(port) + " ";
  ASSERT_EQ(std::system(("python3 " + example + (folder / "guard.key") + " 3").c_str()), 0);
  PersonBuffer buffer;
  PersonEstimate estimate;
  for (std::uint64_t number = 1; number <= 3; ++number) {
    ASSERT_TRUE(camera.wait(10.0)) << network_counts_text(door.counts());
    ASSERT_EQ(camera.receive(buffer), kPersonBytes);
    ASSERT_EQ(decode(buffer, estimate), PersonFault::kNone);
    EXPECT_EQ(estimate.sequence, number);
    EXPECT_EQ(estimate.joints.col(0), Eigen::Vector3d(0.0, 0.3, 2.0));
  }
  // With another key nothing of it is.
  make_network_key(folder / "other.key");
  ASSERT_EQ(std::system(("python3 " + example + (folder / "other.key") + " 2 2>/dev/null").c_str()), 0);
  EXPECT_FALSE(camera.wait(0.0));
  EXPECT_EQ(door.counts()[static_cast<std::size_t>(SealRefusal::kForged)], 2);
}

}  // namespace
}  // namespace duet
