#include "duet/hardware/guard/guard_message.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <cstring>
#include <limits>
#include <thread>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;

std::span<const std::byte> first(const GuardBuffer& buffer, std::size_t size) {
  return std::span<const std::byte>(buffer).first(size);
}

PlannerMessage planned() {
  PlannerMessage message{.sequence = 12345678901234, .command = {}, .acting = true};
  message.command.stamp = 7.25;
  message.command.root = {0.1, -0.05, 0.2, 0.74};
  message.command.q = Eigen::VectorXd::LinSpaced(kG1Motors, -1.0, 1.0);
  return message;
}

TEST(GuardMessage, APlannersCommandIsReadAsItWasSent) {
  GuardBuffer buffer;
  const std::size_t size = encode(planned(), buffer);
  GuardMessage read;
  ASSERT_EQ(decode(first(buffer, size), read), GuardMessageKind::kPlanner);
  EXPECT_EQ(read.planner.sequence, planned().sequence);
  EXPECT_EQ(read.planner.command.stamp, 7.25);
  EXPECT_EQ(read.planner.command.root.yaw_rate, 0.2);
  EXPECT_EQ(read.planner.command.q, planned().command.q);
  EXPECT_TRUE(read.planner.acting);
}

TEST(GuardMessage, APersonIsReadAsItWasSent) {
  PersonMessage person{.sequence = 9, .latency = 0.08};
  for (int j = 0; j < 24; ++j) person.joints.col(j) = Eigen::Vector3d(j, -j, 0.5 * j);
  GuardBuffer buffer;
  const std::size_t size = encode(person, buffer);
  GuardMessage read;
  ASSERT_EQ(decode(first(buffer, size), read), GuardMessageKind::kPerson);
  EXPECT_EQ(read.person.joints, person.joints);
  EXPECT_EQ(read.person.sequence, 9u);
  EXPECT_EQ(read.person.latency, 0.08);
}

TEST(GuardMessage, AStopIsAStop) {
  GuardBuffer buffer;
  GuardMessage read;
  EXPECT_EQ(decode(first(buffer, encode_stop(buffer)), read), GuardMessageKind::kStop);
}

TEST(GuardMessage, OtherLengthsVersionsAndKindsAreRefused) {
  GuardBuffer buffer;
  const std::size_t size = encode(planned(), buffer);
  GuardMessage read;
  for (std::size_t length = 0; length < size; ++length)
    EXPECT_EQ(decode(first(buffer, length), read), GuardMessageKind::kRefused) << length;
  EXPECT_EQ(decode(first(buffer, size + 1), read), GuardMessageKind::kRefused);
  buffer[0] ^= std::byte{1};
  EXPECT_EQ(decode(first(buffer, size), read), GuardMessageKind::kRefused);
  buffer[0] ^= std::byte{1};
  for (const int kind : {0, 2, 3, 4, 255}) {
    buffer[4] = static_cast<std::byte>(kind);
    EXPECT_EQ(decode(first(buffer, size), read), GuardMessageKind::kRefused) << kind;
  }
}

TEST(GuardMessage, RandomBytesBreakNothing) {
  Random random(19, 10);
  GuardMessage read;
  for (int k = 0; k < 20000; ++k) {
    GuardBuffer buffer;
    std::size_t size = encode(planned(), buffer);
    for (int change = 0; change < 4; ++change) buffer[random.below(300)] = static_cast<std::byte>(random.below(256));
    if (random.chance(0.2)) size = static_cast<std::size_t>(random.below(static_cast<int>(kMostGuardBytes)));
    const GuardMessageKind kind = decode(first(buffer, size), read);
    EXPECT_NE(kind, GuardMessageKind::kPerson);
  }
}

TEST(DatagramSocket, CarriesDatagramsAtAPathOfItsOwners) {
  const test::ScratchFolder folder;
  DatagramSocket here = DatagramSocket::at_path(folder / "guard");
  EXPECT_EQ(std::filesystem::status(folder / "guard").permissions() & std::filesystem::perms::all,
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  DatagramSocket there = DatagramSocket::to_path(folder / "guard");
  GuardBuffer buffer;
  EXPECT_EQ(here.receive(buffer), 0u);
  EXPECT_TRUE(there.send(first(buffer, encode_stop(buffer))));
  EXPECT_EQ(here.receive(buffer), 16u);
}

TEST(DatagramSocket, SaysWhoIsNotThereAndWhoIs) {
  const test::ScratchFolder folder;
  EXPECT_NE(test::thrown_message<std::runtime_error>([&] {
              DatagramSocket::to_path(folder / "guard");
            }).find("nobody receives at"),
            std::string::npos);
  DatagramSocket here = DatagramSocket::at_path(folder / "guard");
  EXPECT_NE(test::thrown_message<std::runtime_error>([&] {
              DatagramSocket::at_path(folder / "guard");
            }).find("another process receives there"),
            std::string::npos);
  EXPECT_NE(test::thrown_message<std::runtime_error>([&] {
              DatagramSocket::at_path(std::string(200, 'x'));
            }).find("found 200"),
            std::string::npos);
}

TEST(DatagramSocket, CarriesDatagramsOverLoopback) {
  DatagramSocket here = DatagramSocket::at_port(0);
  DatagramSocket there = DatagramSocket::to_port(here.port());
  GuardBuffer buffer;
  EXPECT_FALSE(here.wait(0.001));
  EXPECT_TRUE(there.send(first(buffer, encode(planned(), buffer))));
  EXPECT_TRUE(here.wait(1.0));
  EXPECT_GT(here.receive(buffer), 16u);
  EXPECT_FALSE(here.wait(0.0));
}

GuardReport some_report() {
  GuardedTwin robot;
  robot.start();
  robot.message.command.root.forward = 0.1;
  robot.run_for(1.0);
  return report_of(robot.guard);
}

TEST(GuardReport, ArrivesAsItWasSent) {
  const GuardReport sent = some_report();
  ASSERT_EQ(sent.state, SafetyState::kRun);
  ReportBuffer buffer;
  encode(sent, buffer);
  GuardReport read;
  ASSERT_TRUE(decode(buffer, read));
  EXPECT_EQ(read.state, sent.state);
  EXPECT_EQ(read.tick, sent.tick);
  EXPECT_EQ(read.now, sent.now);
  EXPECT_EQ(read.planner_sequence, sent.planner_sequence);
  EXPECT_EQ(read.robot.q, sent.robot.q);
  EXPECT_EQ(read.robot.v, sent.robot.v);
  EXPECT_EQ(read.robot.X_WB.p, sent.robot.X_WB.p);
  EXPECT_EQ(read.robot.X_WB.R.coeffs(), sent.robot.X_WB.R.coeffs());
  EXPECT_EQ(read.q_target, sent.q_target);
  EXPECT_EQ(read.root.forward, sent.root.forward);
  EXPECT_NEAR(read.root.forward, 0.1, 1e-6);
  EXPECT_EQ(read.clamps, sent.clamps);
  EXPECT_TRUE(read.odometry);
  EXPECT_TRUE(read.tracked);
  EXPECT_EQ(read.person, sent.person);
  EXPECT_EQ(read.person, test::standing_adult({4.0, 0.0, 0.95}));
}

TEST(GuardReport, APersonWhoIsLostIsNotTrackedAnyMore) {
  GuardedTwin robot;
  robot.start();
  EXPECT_TRUE(report_of(robot.guard).tracked);
  robot.sees = false;
  robot.run_for(0.24);
  EXPECT_TRUE(report_of(robot.guard).tracked);
  robot.run_for(0.1);
  EXPECT_FALSE(report_of(robot.guard).tracked);
}

TEST(GuardReport, WhatIsNoReportIsRefused) {
  ReportBuffer good;
  encode(some_report(), good);
  GuardReport read;
  EXPECT_FALSE(decode({}, read));
  EXPECT_FALSE(decode(std::span<const std::byte>(good).first(good.size() - 1), read));
  for (const std::size_t at : {std::size_t{0}, 3 * sizeof(double), 4 * sizeof(double)}) {  // version, state, cause
    ReportBuffer bad = good;
    bad[at] = std::byte{99};
    EXPECT_FALSE(decode(bad, read)) << at;
  }
  for (std::size_t at = 12 * sizeof(double); at + sizeof(double) <= good.size() - kClampReasons * 8; at += 8) {
    ReportBuffer bad = good;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::memcpy(bad.data() + at, &nan, sizeof(nan));
    EXPECT_FALSE(decode(bad, read)) << at;
  }
}

TEST(GuardLink, ReportsGoToAPlannerThatIsThereFiftyTimesASecond) {
  const test::ScratchFolder folder;
  DatagramSocket guard_socket = DatagramSocket::at_path(folder / "guard");
  GuardedTwin robot;
  ReportSender sender(folder / "guard");
  int reports = 0;
  for (int k = 0; k < 500; ++k) {
    robot.tick();
    reports += sender.after_tick(robot.guard) ? 1 : 0;
  }
  EXPECT_EQ(reports, 0) << "nobody is there";
  SocketGuardLink link(folder / "guard", 0.05);
  GuardReport report;
  int received = 0;
  for (int k = 0; k < 500; ++k) {
    robot.tick();
    if (!sender.after_tick(robot.guard)) continue;
    ASSERT_TRUE(link.next(report));
    EXPECT_EQ(report.tick % kReportEvery, 0u);
    ++received;
  }
  EXPECT_GT(received, 35);  // it looks for a planner every tenth report
  EXPECT_FALSE(link.next(report)) << "the guard has stopped";
}

TEST(GuardLink, SaysThatNoGuardIsThereOrThatAnotherPlannerIs) {
  const test::ScratchFolder folder;
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { SocketGuardLink(folder / "guard", 0.1); }));
  DatagramSocket guard_socket = DatagramSocket::at_path(folder / "guard");
  const SocketGuardLink first(folder / "guard", 0.1);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { SocketGuardLink(folder / "guard", 0.1); }));
}

TEST(RealTime, IsGivenToTheThreadThatAsksAndToThoseThatItMakes) {
  const int before = sched_getscheduler(0);
  bool given = false;
  int own = -1, made = -1;
  std::thread([&] {
    given = ask_for_real_time();
    own = sched_getscheduler(0);
    std::thread([&] { made = sched_getscheduler(0); }).join();
  }).join();
  EXPECT_EQ(own, given ? SCHED_FIFO : before);
  EXPECT_EQ(made, own);
  EXPECT_EQ(sched_getscheduler(0), before) << "whoever did not ask stays as they were";
}

}  // namespace
}  // namespace duet
