// The partner over a socket: message, calibration, age by reception, 50 Hz, and the player that stands in for a camera.
#include "duet/hardware/guard/person_input.h"

#include <limits>

#include "duet/core/file.h"
#include "duet/hardware/twin/fakes.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

PersonEstimate someone(std::uint64_t sequence, const Eigen::Vector3d& p_C = {0.0, 0.0, 3.0}) {
  PersonEstimate estimate;
  estimate.sequence = sequence;
  estimate.stamp = 1e9;
  estimate.seen = true;
  estimate.joints = test::standing_adult(p_C);
  return estimate;
}

PersonFault read_again(const PersonEstimate& estimate, PersonEstimate& read) {
  PersonBuffer buffer;
  encode(estimate, buffer);
  return decode(buffer, read);
}

TEST(PersonInput, WhatIsSentIsRead) {
  PersonEstimate read;
  ASSERT_EQ(read_again(someone(7), read), PersonFault::kNone);
  EXPECT_EQ(read.sequence, 7u);
  EXPECT_EQ(read.stamp, 1e9);
  EXPECT_TRUE(read.seen);
  EXPECT_EQ(read.joints, someone(7).joints);
}

TEST(PersonInput, RefusesWhatIsNoPerson) {
  PersonEstimate read, bad = someone(1);
  bad.joints(1, 5) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(read_again(bad, read), PersonFault::kFinite);
  bad = someone(1);
  bad.joints(1, 5) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(read_again(bad, read), PersonFault::kFinite);
  EXPECT_EQ(read_again(someone(1, {0.0, 0.0, 21.0}), read), PersonFault::kFar);
  bad = someone(1);
  bad.joints.col(23).z() += 1.5;
  EXPECT_EQ(read_again(bad, read), PersonFault::kBody);
  PersonBuffer buffer;
  encode(someone(1), buffer);
  for (const std::size_t length : {0, 1, 16, 599})
    EXPECT_EQ(decode(std::span<const std::byte>(buffer).first(length), read), PersonFault::kForm) << length;
  buffer[0] ^= std::byte{1};
  EXPECT_EQ(decode(buffer, read), PersonFault::kForm);
  EXPECT_EQ(read.sequence, 0u);  // untouched throughout
}

// x right, y down, z ahead, on a base that looks along +y.
Pose camera_ahead() {
  Eigen::Matrix3d R_BC;
  R_BC << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {Eigen::Quaterniond(R_BC), {0.1, 0.0, 0.5}};
}

TEST(PersonTrack, IsTurnedFromTheCameraIntoTheFrameOfOdometry) {
  PersonTrack track(camera_ahead());
  const Pose X_WB{yaw_rotation(std::numbers::pi / 2.0), {1.0, 2.0, 0.74}};
  PersonEstimate estimate = someone(1);
  estimate.joints.colwise() = Eigen::Vector3d(0.5, -0.2, 3.0);  // to the right, up, ahead
  EXPECT_EQ(track.receive(estimate, X_WB, 10.0), PersonFault::kNone);
  // In B: ahead 3.1, left -0.5, up 0.7. B's x is W's y.
  EXPECT_LE((track.newest().col(0) - Eigen::Vector3d(1.0 + 0.5, 2.0 + 3.1, 0.74 + 0.7)).norm(), 1e-12);
}

TEST(PersonTrack, AgeIsThatOfReceptionWhateverTheSenderSays) {
  PersonTrack track(Pose{});
  EXPECT_EQ(track.at(1.0), nullptr);
  PersonEstimate future = someone(1);
  future.stamp = 1e12;  // T7: stamps in the future
  track.receive(future, {}, 10.0);
  EXPECT_EQ(track.newest_at(), 10.0);
  EXPECT_NE(track.at(10.25), nullptr);
  EXPECT_EQ(track.at(10.26), nullptr);
}

TEST(PersonTrack, OldRepeatedAndUnseenEstimatesAreLeftOut) {
  PersonTrack track(Pose{});
  EXPECT_EQ(track.receive(someone(5), {}, 10.0), PersonFault::kNone);
  EXPECT_EQ(track.receive(someone(5), {}, 10.03), PersonFault::kOld);
  EXPECT_EQ(track.receive(someone(4), {}, 10.03), PersonFault::kOld);
  PersonEstimate nobody = someone(6);
  nobody.seen = false;
  EXPECT_EQ(track.receive(nobody, {}, 10.06), PersonFault::kUnseen);
  EXPECT_EQ(track.newest_at(), 10.0);
  EXPECT_EQ(track.receive(someone(1), {}, 11.5), PersonFault::kOld);
  EXPECT_EQ(track.receive(someone(2), {}, 11.53), PersonFault::kNone);  // an estimator that was started anew
  EXPECT_EQ(track.restarts(), 1);
}

// Thirty a second, ragged by up to 10 ms: at 50 Hz somebody who walks evenly is seen to walk evenly.
TEST(PersonTrack, AtFiftyHertzLiesBetweenTheEstimates) {
  PersonTrack track(Pose{}, 0.05);
  Random random(19, 31);
  double at = 0.0;
  std::uint64_t sequence = 0;
  for (int tick = 0; tick < 500; ++tick) {
    const double now = 0.02 * tick;
    while (at <= now) {
      track.receive(someone(++sequence, {0.5 * at, 0.0, 3.0}), {}, at);
      at += 1.0 / 30.0 + random.uniform(-0.01, 0.01);
    }
    if (now < 0.2) continue;
    const HumanJoints* joints = track.at(now);
    ASSERT_NE(joints, nullptr);
    EXPECT_NEAR((*joints)(0, 0), 0.5 * (now - 0.05), 1e-9) << now;
  }
}

TEST(PersonTrack, BeyondTheNewestItStays) {
  PersonTrack track(Pose{}, 0.04);
  track.receive(someone(1, {0.0, 0.0, 3.0}), {}, 1.0);
  track.receive(someone(2, {0.1, 0.0, 3.0}), {}, 1.033);
  EXPECT_EQ((*track.at(1.2))(0, 0), 0.1);
  EXPECT_EQ((*track.at(1.033))(0, 0), 0.0);  // before the first: the first
}

// Over the socket to the guard: the person is known, stands still to it, and is lost in a quarter of a second.
TEST(PersonInput, TheGuardHearsOfThePersonAndLosesThem) {
  const test::ScratchFolder folder;
  test::GuardedTwin robot(test::twin_guard(true));
  robot.sees = false;
  PersonInput input(DatagramSocket::at_path(folder / "person"), camera_ahead());
  DatagramSocket camera = DatagramSocket::to_path(folder / "person");
  PersonBuffer buffer;
  std::uint64_t sequence = 0;
  bool sends = true;
  const auto run_for = [&](double seconds) {
    for (double left = seconds; left > 0.5 * test::GuardedTwin::kDt; left -= test::GuardedTwin::kDt) {
      PersonEstimate estimate = someone(++sequence);
      for (int j = 0; j < 24; ++j)
        estimate.joints.col(j) = camera_ahead().inverse() * (estimate.joints.col(j) + Eigen::Vector3d(4.0, 0.0, -3.0));
      encode(estimate, buffer);
      if (sends && robot.ticks % 17 == 0) camera.send(buffer);
      input.poll(robot.now, robot.guard);
      robot.tick();
    }
  };
  robot.hold_key(RemoteKey::kR1);
  run_for(2.2);
  robot.guard.arm();
  robot.hold_key(RemoteKey::kStart);
  run_for(1.0);
  robot.hold_key(RemoteKey::kA);
  run_for(0.2);
  EXPECT_EQ(robot.state(), SafetyState::kRun) << stop_cause_name(robot.cause());
  EXPECT_GT(input.used(), 50);
  ASSERT_NE(robot.guard.limiter_input().person, nullptr);
  EXPECT_NEAR(robot.guard.limiter_input().person->col(0).x(), 4.0, 0.02);
  sends = false;
  run_for(0.3);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_EQ(robot.cause(), StopCause::kPersonAge);
}

TEST(PersonInput, CountsWhyAnEstimateWasNotUsed) {
  const test::ScratchFolder folder;
  test::GuardedTwin robot(test::twin_guard(true));
  PersonInput input(DatagramSocket::at_path(folder / "person"), {});
  DatagramSocket camera = DatagramSocket::to_path(folder / "person");
  PersonBuffer buffer;
  encode(someone(1), buffer);
  camera.send(buffer);
  camera.send(buffer);
  camera.send(std::span<const std::byte>(buffer).first(100));
  std::vector<std::byte> longer(buffer.begin(), buffer.end());
  longer.push_back(std::byte{0});
  camera.send(longer);
  input.poll(1000.0, robot.guard);
  EXPECT_EQ(input.used(), 1);
  EXPECT_EQ(input.faults()[static_cast<std::size_t>(PersonFault::kOld)], 1);
  EXPECT_EQ(input.faults()[static_cast<std::size_t>(PersonFault::kForm)], 2);
}

TEST(PersonPlayer, WithoutNoiseGivesTheClipBack) {
  const InteractionClip clip = synthesize(Task::kHandshake, {});
  const Pose X_WB = base_of_reactor(clip.reactor_motion(), 0.74);
  PersonPlayer player(clip.actor_motion(), X_WB, camera_ahead(), {.noise = 0.0});
  PersonTrack track(camera_ahead());
  PersonEstimate estimate;
  int frames = 0;
  while (player.next(estimate)) {
    PersonEstimate read;
    ASSERT_EQ(read_again(estimate, read), PersonFault::kNone) << frames;
    track.receive(read, X_WB, frames / 30.0);
    if (frames % 3 == 0) {  // a frame of the clip's own, at 50 Hz
      EXPECT_LE((track.newest() - clip.actor_motion().joints.frame(frames / 3 * 5)).cwiseAbs().maxCoeff(), 1e-9)
          << frames;
    }
    ++frames;
  }
  EXPECT_EQ(frames, player.frames());
  EXPECT_GT(frames, 60);
}

TEST(PersonPlayer, NoiseAndGapsAreThoseOfItsSeed) {
  const InteractionClip clip = synthesize(Task::kHandshake, {});
  const PersonPlay play{.noise = 0.02, .unseen = 0.2, .seed = 3};
  PersonPlayer one(clip.actor_motion(), {}, {}, play), two(clip.actor_motion(), {}, {}, play);
  PersonPlayer clean(clip.actor_motion(), {}, {}, {.noise = 0.0});
  PersonEstimate a, b, c;
  int unseen = 0;
  double squares = 0.0;
  while (one.next(a) && two.next(b) && clean.next(c)) {
    EXPECT_EQ(a.joints, b.joints);
    unseen += a.seen ? 0 : 1;
    squares += (a.joints - c.joints).squaredNorm();
  }
  const double frames = clean.frames();
  EXPECT_NEAR(unseen / frames, 0.2, 4.0 * std::sqrt(0.16 / frames));
  EXPECT_NEAR(std::sqrt(squares / (72.0 * frames)), 0.02, 4.0 * 0.02 / std::sqrt(2.0 * 72.0 * frames));
}

TEST(PersonPlayer, NamesWhatIsWrong) {
  const InteractionClip clip = synthesize(Task::kHandshake, {});
  const auto refusal = [&](const PersonPlay& play) {
    return test::thrown_message<std::invalid_argument>([&] { PersonPlayer player(clip.actor_motion(), {}, {}, play); });
  };
  EXPECT_SENTENCE(refusal({.rate = 0.0}));
  EXPECT_SENTENCE(refusal({.noise = -0.1}));
  EXPECT_SENTENCE(refusal({.unseen = 1.5}));
}

}  // namespace
}  // namespace duet
