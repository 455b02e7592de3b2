
#include <cstring>
#include <limits>
#include <thread>

#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/guard/guard_message.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;

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

}  // namespace
}  // namespace duet
