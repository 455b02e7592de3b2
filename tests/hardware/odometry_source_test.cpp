#include "duet/hardware/wire/odometry_source.h"

#include <gmock/gmock.h>

#include <cstring>
#include <limits>

#include "duet/core/file.h"
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

}  // namespace
}  // namespace duet
