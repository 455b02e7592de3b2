#include "duet/hardware/wire/odometry_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/hardware/wire/sender_clock.h"
#include "tests/support.h"

namespace duet {
namespace {

ExternalPose some_pose(std::uint64_t sequence) {
  ExternalPose pose;
  pose.sequence = sequence;
  pose.X_WB = {yaw_rotation(0.7), {1.0, -2.0, 0.74}};
  pose.v_WB = {0.1, 0.2, 0.0};
  pose.valid = true;
  return pose;
}

TEST(ExternalOdometry, WhatIsSentIsRead) {
  ExternalPoseBuffer buffer;
  encode(some_pose(3), buffer);
  ExternalPose read;
  ASSERT_TRUE(decode(buffer, read));
  EXPECT_EQ(read.sequence, 3u);
  EXPECT_EQ(read.X_WB.p, some_pose(3).X_WB.p);
  EXPECT_NEAR(read.X_WB.R.angularDistance(some_pose(3).X_WB.R), 0.0, 1e-12);
  EXPECT_EQ(read.v_WB, some_pose(3).v_WB);
  EXPECT_TRUE(read.valid);
}

TEST(ExternalOdometry, RefusesAnythingElse) {
  ExternalPoseBuffer buffer;
  ExternalPose read;
  encode(some_pose(1), buffer);
  for (std::size_t length = 0; length < buffer.size(); ++length)
    EXPECT_FALSE(decode(std::span<const std::byte>(buffer).first(length), read)) << length;
  const auto spoiled = [&](const std::function<void(ExternalPose&)>& spoil) {
    ExternalPose pose = some_pose(1);
    spoil(pose);
    ExternalPoseBuffer bytes;
    encode(pose, bytes);
    return decode(bytes, read);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(spoiled([=](ExternalPose& p) { p.X_WB.p.x() = nan; }));
  EXPECT_FALSE(spoiled([=](ExternalPose& p) { p.v_WB.z() = inf; }));
  EXPECT_FALSE(spoiled([=](ExternalPose& p) { p.X_WB.R.x() = nan; }));
  EXPECT_FALSE(spoiled([](ExternalPose& p) { p.X_WB.R.coeffs() *= 1.1; }));
  EXPECT_FALSE(spoiled([](ExternalPose& p) { p.X_WB.R.coeffs().setZero(); }));
  buffer[0] ^= std::byte{1};
  EXPECT_FALSE(decode(buffer, read));
}

TEST(ExternalOdometry, TheNewestOfTheSocketCountsAndOldOnesDoNot) {
  const test::ScratchFolder folder;
  ExternalOdometry odometry(DatagramSocket::at_path(folder / "pose"));
  DatagramSocket tracker = DatagramSocket::to_path(folder / "pose");
  OdometrySample sample;
  EXPECT_FALSE(odometry.take(sample));
  ExternalPoseBuffer buffer;
  for (const std::uint64_t sequence : {1u, 2u, 4u, 3u}) {
    ExternalPose pose = some_pose(sequence);
    pose.X_WB.p.x() = static_cast<double>(sequence);
    encode(pose, buffer);
    EXPECT_TRUE(tracker.send(buffer));
  }
  EXPECT_TRUE(tracker.send(std::span<const std::byte>(buffer).first(50)));
  EXPECT_TRUE(odometry.take(sample));
  EXPECT_EQ(sample.X_WB.p.x(), 4.0);
  EXPECT_EQ(odometry.old(), 1);
  EXPECT_EQ(odometry.refused(), 1);
  EXPECT_FALSE(odometry.take(sample));
}

TEST(ExternalOdometry, ATrackerThatWasStartedAnewIsHeardAgainAfterAPause) {
  const test::ScratchFolder folder;
  double now = 100.0;
  ExternalOdometry odometry(DatagramSocket::at_path(folder / "pose"), [&] { return now; });
  DatagramSocket tracker = DatagramSocket::to_path(folder / "pose");
  OdometrySample sample;
  const auto takes = [&](std::uint64_t sequence) {
    ExternalPoseBuffer buffer;
    encode(some_pose(sequence), buffer);
    tracker.send(buffer);
    return odometry.take(sample);
  };
  EXPECT_TRUE(takes(5000));
  now += 0.9;
  EXPECT_FALSE(takes(1));
  EXPECT_FALSE(takes(2));
  now += 0.2;
  EXPECT_TRUE(takes(3));
  EXPECT_TRUE(takes(4));
  EXPECT_EQ(sample.sender_restarts, 1);
  EXPECT_EQ(odometry.old(), 2);
}

TEST(ExternalOdometry, ATrackerThatLostTheRobotSaysSo) {
  const test::ScratchFolder folder;
  ExternalOdometry odometry(DatagramSocket::at_path(folder / "pose"));
  DatagramSocket tracker = DatagramSocket::to_path(folder / "pose");
  ExternalPose pose = some_pose(1);
  pose.valid = false;
  ExternalPoseBuffer buffer;
  encode(pose, buffer);
  tracker.send(buffer);
  OdometrySample sample;
  EXPECT_TRUE(odometry.take(sample));
  EXPECT_FALSE(sample.valid);
}

// Time by the clock of whoever sends, against ours.

constexpr double kRounding = 1e-9;

TEST(StateCount, StatesThatWereNotReadAreCounted) {
  StateCount count;
  EXPECT_EQ(count.periods_to(0xFFFFFFFEu), 1.0);
  EXPECT_EQ(count.periods_to(0u), 1.0);  // two milliseconds, past 2^32
  EXPECT_EQ(count.periods_to(6u), 3.0);
  EXPECT_EQ(count.periods_to(1000u), 50.0);
}

TEST(SenderDelay, IsTheExcessOverTheFastest) {
  SenderDelay delay;
  double sent = 5e8, now = 10.0;
  EXPECT_EQ(delay.see(sent, now), 0.0);
  EXPECT_NEAR(delay.see(sent += 0.03, now += 0.02), 0.0, kRounding);  // faster than the first
  EXPECT_NEAR(delay.see(sent += 0.03, now += 0.08), 0.05, 1e-3);
  EXPECT_NEAR(delay.see(sent += 0.03, now += 0.03), 0.05, 1e-3);
}

TEST(SenderDelay, ClocksMayDrift) {
  SenderDelay ahead, behind;
  for (int k = 0; k <= 30 * 3600; ++k) {  // an hour
    const double now = k / 30.0;
    ASSERT_LE(ahead.see(1.0002 * now, now), kRounding);
    ASSERT_LE(behind.see(0.9998 * now, now), kRounding);
  }
}

TEST(SenderDelay, BeginsAnewWhereItsSenderDoes) {
  SenderDelay delay;
  (void)delay.see(100.0, 10.0);
  EXPECT_EQ(delay.see(3.0, 10.1), 0.0);  // a clock that falls
  EXPECT_EQ(delay.see(3.0, 10.2), 0.0);  // or stands: a sender without one
  EXPECT_NEAR(delay.see(3.1, 10.5), 0.2, 1e-3);
  EXPECT_EQ(delay.see(3.2, 11.1), 0.0);  // silent for longer than half a second
  EXPECT_EQ(delay.see(std::numeric_limits<double>::quiet_NaN(), 11.2), 0.0);
  EXPECT_EQ(delay.see(3.3, 11.3), 0.0);
}

TEST(SenderDelay, ASenderWithOurClockHidesNoDelay) {
  SenderDelay camera(true), robot(false), other(true);
  for (double sent = 100.0; sent < 100.2; sent += 0.03) {
    const bool first = sent == 100.0;
    EXPECT_NEAR(camera.see(sent, sent + 1.0), first ? 0.0 : 1.0, 1e-3);
    EXPECT_NEAR(robot.see(sent, sent + 1.0), 0.0, kRounding);
    EXPECT_NEAR(other.see(sent, sent + 50.0), 0.0, kRounding);
  }
}

// States of a robot that counts `unit`, `delay` later from second 2 on; the steady delay at the end.
double steady_delay(double unit, double delay, double seconds = 4.0) {
  StateDelay states;
  Random random(3, 4);
  double received = 0.0;
  for (double sent = 0.0; sent < seconds; sent += 0.002) {
    received = std::max(received, 70.0 + sent + random.uniform(0.0, 0.004) + (sent > 2.0 ? delay : 0.0));
    states.see(static_cast<std::uint32_t>(std::lround(sent / unit)), received);
  }
  return states.steady();
}

TEST(StateDelay, IsFoundWhateverTheRobotCounts) {
  for (const double unit : {0.002, 0.001}) {
    EXPECT_LT(steady_delay(unit, 0.0), 0.004) << unit;
    EXPECT_NEAR(steady_delay(unit, 0.06), 0.06, 0.004) << unit;
  }
  EXPECT_EQ(steady_delay(0.00137, 0.06), 0.0) << "no unit that is known";
}

TEST(StateDelay, IsNoneWhereAStateInATenthOfASecondIsFast) {
  StateDelay states;
  for (std::uint32_t k = 0; k < 2000; ++k) states.see(k, 70.0 + 0.002 * k + (k > 1500 && k % 40 != 0 ? 0.08 : 0.0));
  EXPECT_LT(states.steady(), 0.001);
}

}  // namespace
}  // namespace duet
