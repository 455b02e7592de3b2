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
  PersonEstimate late = someone(8);
  late.latency = 0.12;
  ASSERT_EQ(read_again(late, read), PersonFault::kNone);
  EXPECT_EQ(read.latency, 0.12);
}

// The form of before, without a latency.
TEST(PersonInput, AMessageOfSixHundredBytesIsReadToo) {
  PersonEstimate late = someone(7), read;
  late.latency = 0.12;
  PersonBuffer buffer;
  encode(late, buffer);
  buffer[3] = std::byte{0x31};  // "DPJ1"
  ASSERT_EQ(decode(std::span<const std::byte>(buffer).first(600), read), PersonFault::kNone);
  EXPECT_EQ(read.sequence, 7u);
  EXPECT_EQ(read.joints, late.joints);
  EXPECT_EQ(read.latency, 0.0);
  EXPECT_EQ(decode(buffer, read), PersonFault::kForm);
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
  bad = someone(1);
  bad.latency = 0.26;
  EXPECT_EQ(read_again(bad, read), PersonFault::kLate);
  bad.latency = -1e-3;
  EXPECT_EQ(read_again(bad, read), PersonFault::kForm);
  bad.latency = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(read_again(bad, read), PersonFault::kFinite);
  PersonBuffer buffer;
  encode(someone(1), buffer);
  for (const std::size_t length : {0, 1, 16, 599, 600, 607})
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

// A base that does not move.
struct Placed {
  explicit Placed(const CameraMount& camera = {}, const Pose& X_WB = {}) : placer(camera) { placer.base(X_WB, 0.0); }
  PersonFault receive(const PersonEstimate& estimate, double now) { return placer.place(estimate, now, message); }
  PersonPlacer placer;
  PersonMessage message;
};

TEST(PersonPlacer, TurnsFromTheCameraIntoTheFrameOfOdometry) {
  Placed placed({camera_ahead()}, {yaw_rotation(std::numbers::pi / 2.0), {1.0, 2.0, 0.74}});
  PersonEstimate estimate = someone(1);
  estimate.joints.colwise() = Eigen::Vector3d(0.5, -0.2, 3.0);  // to the right, up, ahead
  EXPECT_EQ(placed.receive(estimate, 10.0), PersonFault::kNone);
  // In B: ahead 3.1, left -0.5, up 0.7. B's x is W's y.
  EXPECT_LE((placed.message.joints.col(0) - Eigen::Vector3d(1.0 + 0.5, 2.0 + 3.1, 0.74 + 0.7)).norm(), 1e-12);
}

// A robot that turns at 0.5 rad/s while it walks: a person who stands still is seen to stand still, whatever the
// latency, be it the message's or the camera's own. With the pose at arrival they would be 0.15 m off at 2 m.
TEST(PersonPlacer, PlacesWithThePoseOfTheBaseWhenThePictureWasTaken) {
  const Eigen::Vector3d p_WP(2.0, 0.3, 0.95);
  const auto base_at = [](double t) { return Pose{yaw_rotation(0.5 * t), {0.25 * t, 0.0, 0.74}}; };
  PersonPlacer placer({camera_ahead(), 0.05});
  PersonMessage message;
  std::uint64_t sequence = 0;
  for (int tick = 0; tick < 600; ++tick) {
    const double now = 0.002 * tick;
    placer.base(base_at(now), now);
    if (tick < 150 || tick % 17 != 0) continue;
    const double latency = 0.001 * (tick % 101);  // up to 0.1 s, mostly between two ticks
    PersonEstimate estimate = someone(++sequence);
    estimate.latency = latency;
    const Pose X_CW = (base_at(now - latency - 0.05) * camera_ahead()).inverse();
    const HumanJoints standing = test::standing_adult(p_WP);
    for (int j = 0; j < kSmplJoints; ++j) estimate.joints.col(j) = X_CW * Eigen::Vector3d(standing.col(j));
    ASSERT_EQ(placer.place(estimate, now, message), PersonFault::kNone) << now;
    EXPECT_NEAR(message.latency, latency + 0.05, 1e-12);
    // A chord of 2 ms at 0.5 rad/s is off by less than 1e-6 m at 2 m.
    EXPECT_LE((message.joints - standing).cwiseAbs().maxCoeff(), 1e-6) << now;
    const Pose X_WC = base_at(now) * camera_ahead();
    if (latency > 0.09) {
      EXPECT_GT((X_WC * Eigen::Vector3d(estimate.joints.col(0)) - p_WP).norm(), 0.1);
    }
  }
  EXPECT_GT(sequence, 20u);
}

TEST(PersonPlacer, OldRepeatedUnseenAndLateEstimatesAreLeftOut) {
  Placed placed;
  EXPECT_EQ(placed.receive(someone(5), 10.0), PersonFault::kNone);
  EXPECT_EQ(placed.receive(someone(5), 10.03), PersonFault::kOld);
  EXPECT_EQ(placed.receive(someone(4), 10.03), PersonFault::kOld);
  PersonEstimate nobody = someone(6);
  nobody.seen = false;
  EXPECT_EQ(placed.receive(nobody, 10.06), PersonFault::kUnseen);
  EXPECT_EQ(placed.message.sequence, 1u);
  EXPECT_EQ(placed.receive(someone(1), 11.5), PersonFault::kOld);
  EXPECT_EQ(placed.receive(someone(2), 11.53), PersonFault::kNone);  // an estimator that was started anew
  EXPECT_EQ(placed.message.sender_restarts, 1);
  PersonEstimate late = someone(3);
  late.latency = 0.2;
  EXPECT_EQ(placed.receive(late, 11.56), PersonFault::kNone);
  Placed slow({Pose{}, 0.06});
  EXPECT_EQ(slow.receive(late, 10.0), PersonFault::kLate);  // with the camera's own
}

// F11: a way that takes longer than the shortest is a latency; where the estimator has our clock, all of it is.
TEST(PersonPlacer, WhatItsMessageTookLongerThanItCanIsALatency) {
  const auto sent_at = [](std::uint64_t sequence, double stamp) {
    PersonEstimate estimate = someone(sequence);
    estimate.stamp = stamp;
    return estimate;
  };
  Placed placed;
  EXPECT_EQ(placed.receive(sent_at(1, 500.0), 10.0), PersonFault::kNone);
  EXPECT_EQ(placed.receive(sent_at(2, 500.1), 10.12), PersonFault::kNone);
  EXPECT_EQ(placed.message.latency, 0.0) << "less than a picture is jitter";
  EXPECT_EQ(placed.receive(sent_at(3, 500.2), 10.3), PersonFault::kNone);
  EXPECT_NEAR(placed.message.latency, 0.1, 1e-3);
  EXPECT_EQ(placed.receive(sent_at(4, 500.3), 10.6), PersonFault::kLate);
  Placed same;
  EXPECT_EQ(same.receive(sent_at(1, 9.0), 10.0), PersonFault::kNone);
  EXPECT_EQ(same.receive(sent_at(2, 9.1), 10.1), PersonFault::kLate);
  Placed clockless;
  EXPECT_EQ(clockless.receive(sent_at(1, 0.0), 1.0), PersonFault::kNone);
  EXPECT_EQ(clockless.receive(sent_at(2, 0.0), 1.3), PersonFault::kNone);
  EXPECT_EQ(clockless.message.latency, 0.0);
}

TEST(PersonTrack, IsLostWhereThePictureIsOldWhateverTheSendersClockSays) {
  PersonTrack track;
  HumanJoints joints;
  EXPECT_FALSE(track.at(1.0, joints));
  track.add(someone(1).joints, 9.9, 10.0);
  EXPECT_EQ(track.newest_at(), 9.9);
  EXPECT_TRUE(track.at(10.15, joints));
  EXPECT_FALSE(track.at(10.16, joints));
}

// Thirty a second, ragged by up to 10 ms, 0.1 s late: at 50 Hz somebody who walks evenly is seen to walk evenly.
TEST(PersonTrack, AtFiftyHertzLiesBetweenTheEstimates) {
  PersonTrack track(0.05);
  Random random(19, 31);
  HumanJoints joints;
  double at = 0.0;
  for (int tick = 0; tick < 500; ++tick) {
    const double now = 0.02 * tick;
    while (at + 0.1 <= now) {
      track.add(someone(1, {0.5 * at, 0.0, 3.0}).joints, at, at + 0.1);
      at += 1.0 / 30.0 + random.uniform(-0.01, 0.01);
    }
    if (now < 0.3) continue;
    ASSERT_TRUE(track.at(now, joints));
    EXPECT_NEAR(joints(0, 0), 0.5 * (now - 0.15), 1e-9) << now;
  }
}

TEST(PersonTrack, BeyondTheNewestItStays) {
  PersonTrack track(0.04);
  HumanJoints joints;
  track.add(someone(1, {0.0, 0.0, 3.0}).joints, 1.0, 1.0);
  track.add(someone(2, {0.1, 0.0, 3.0}).joints, 1.033, 1.033);
  ASSERT_TRUE(track.at(1.2, joints));
  EXPECT_EQ(joints(0, 0), 0.1);
  ASSERT_TRUE(track.at(1.033, joints));
  EXPECT_EQ(joints(0, 0), 0.0);  // before the first: the first
}

// 2 cm of noise are no motion, and somebody who starts to run is seen to within a tenth of a second and the picture.
TEST(PersonTrack, SpeedIsThatOfThePersonAndNotOfTheNoise) {
  Random random(7, 3);
  const auto noise = [&]() -> Eigen::Vector3d {
    return Eigen::Vector3d(random.normal(), random.normal(), random.normal()) * 0.02;
  };
  PersonTrack still, walks, runs;
  EXPECT_EQ(still.speed(), 0.0);
  double most = 0.0, sum = 0.0, noticed = 0.0;
  for (int k = 0; k < 300; ++k) {
    const double at = k / 30.0;
    still.add(someone(1, {noise().x(), noise().y(), 3.0}).joints, at, at);
    walks.add(someone(1, {1.0 * at + noise().x(), noise().y(), 3.0}).joints, at, at);
    runs.add(someone(1, {4.0 * std::max(at - 5.0, 0.0), 0.0, 3.0}).joints, at, at);
    if (k >= 12) most = std::max(most, still.speed());
    if (k >= 12) sum += walks.speed();
    if (noticed == 0.0 && runs.speed() > Engagement::kHurried) noticed = at - 5.0;
  }
  EXPECT_LT(most, Engagement::kCalm);
  EXPECT_NEAR(sum / 288, 1.0, 0.1);
  EXPECT_GT(noticed, 0.0);
  EXPECT_LT(noticed, 0.15);
}

TEST(Engagement, IsMeasuredAndNotThePlannersWord) {
  Engagement engagement;
  double now = 0.0;
  const auto after = [&](double seconds, bool asks, double apart, double speed) {
    for (double left = seconds; left > 1e-9; left -= 0.01) engagement.update(asks, apart, speed, now += 0.01);
    return engagement.engaged();
  };
  EXPECT_FALSE(after(1.0, false, 1.0, 0.0)) << "nobody asks";
  EXPECT_FALSE(after(0.2, true, 1.0, 0.0));
  EXPECT_TRUE(after(0.2, true, 1.0, 0.0));
  EXPECT_TRUE(after(1.0, true, 1.0, 1.0)) << "who is calm may step";
  EXPECT_FALSE(after(0.02, true, 1.0, 1.3));
  EXPECT_FALSE(after(1.0, true, 1.0, 1.0)) << "has to be calm again first";
  EXPECT_TRUE(after(0.5, true, 1.0, 0.5));
  EXPECT_FALSE(after(0.02, true, 2.6, 0.0)) << "too far away to be meant";
  EXPECT_TRUE(after(0.5, true, 2.4, 0.0));
  EXPECT_FALSE(after(30.0, true, 1.0, 0.0)) << "no act is so long";
  EXPECT_FALSE(after(5.0, true, 1.0, 0.0));
  after(0.02, false, 1.0, 0.0);
  EXPECT_TRUE(after(0.5, true, 1.0, 0.0));
}

// Over the socket to the guard: the person is known, stands still to it, and is lost in a quarter of a second.
TEST(PersonInput, TheGuardHearsOfThePersonAndLosesThem) {
  const test::ScratchFolder folder;
  test::GuardedTwin robot(test::twin_guard(true));
  robot.sees = false;
  PersonInput input(DatagramSocket::at_path(folder / "person"), {camera_ahead()});
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
  EXPECT_GT(robot.guard.status().person[0], 50);
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
  PersonEstimate far = someone(2), elsewhere = someone(3, {2.0, 0.0, 3.0});
  far.joints *= 24.4;  // an estimator's depth by a focal length that is not the camera's
  encode(far, buffer);
  camera.send(buffer);
  encode(elsewhere, buffer);
  camera.send(buffer);
  input.poll(1000.0, robot.guard);
  const PersonCounts& counts = robot.guard.status().person;
  const auto count = [&](PersonFault fault) { return counts[static_cast<std::size_t>(fault)]; };
  EXPECT_EQ(count(PersonFault::kNone), 1);
  EXPECT_EQ(count(PersonFault::kOld), 1);
  EXPECT_EQ(count(PersonFault::kForm), 2);
  EXPECT_EQ(count(PersonFault::kFar), 1);
  EXPECT_EQ(count(PersonFault::kJump), 1);
  EXPECT_EQ(refused_estimates(counts), 5);
  EXPECT_SENTENCE(person_counts_text(counts));
  EXPECT_EQ(person_counts_text({}), "");
}

TEST(PersonPlayer, WithoutNoiseGivesTheClipBack) {
  const InteractionClip clip = synthesize(Task::kHandshake, {});
  const Pose X_WB = base_of_reactor(clip.reactor_motion(), 0.74);
  PersonPlayer player(clip.actor_motion(), X_WB, camera_ahead(), {.noise = 0.0});
  Placed placed({camera_ahead()}, X_WB);
  PersonEstimate estimate;
  int frames = 0;
  while (player.next(estimate)) {
    PersonEstimate read;
    ASSERT_EQ(read_again(estimate, read), PersonFault::kNone) << frames;
    ASSERT_EQ(placed.receive(read, frames / 30.0), PersonFault::kNone);
    if (frames % 3 == 0) {  // a frame of the clip's own, at 50 Hz
      EXPECT_LE((placed.message.joints - clip.actor_motion().joints.frame(frames / 3 * 5)).cwiseAbs().maxCoeff(), 1e-9)
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
