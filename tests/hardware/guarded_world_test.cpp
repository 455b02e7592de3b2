// An episode behind the guard: the same loop as in an engine, and every way in which the guard ends it is an outcome.
#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <limits>

#include "duet/archives/recording_file.h"
#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/hardware/episodes/guarded_episode.h"
#include "duet/hardware/log/limiter_replay.h"
#include "duet/hardware/log/run_log.h"
#include "duet/hardware/twin/lock_step.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

// Stands, and from 1 s on wants to be `goal` ahead; the left elbow is bent by 0.5 rad meanwhile.
class AheadReference final : public ReferenceSource {
 public:
  explicit AheadReference(double goal) : goal_(goal) {}
  void begin(const RobotState& start) override { reference_ = {start.X_WB, start.q}; }
  const Reference* at(const TickView& present) override {
    if (present.tick == 50) {
      reference_.X_WB.p += reference_.X_WB.R * Eigen::Vector3d(goal_, 0.0, 0.0);
      reference_.q[test::g1()->roles.arms[0][3]] += 0.5;
    }
    return &reference_;
  }

 private:
  double goal_;
  Reference reference_;
};

Episode episode_of(double seconds, const Pose& start = {}) {
  Episode episode;
  episode.start = test::g1()->standing_state(start);
  episode.ticks = ticks_of(seconds);
  return episode;
}

GuardedEpisode guarded() {
  GuardedEpisode episode;
  episode.joints = test::arms_of(*test::g1()).joints;
  return episode;
}

struct Behind {
  explicit Behind(const GuardSetup& setup = test::twin_guard(), GuardedEpisode episode = guarded(),
                  std::vector<TwinFault> faults = {}, RunLog* log = nullptr)
      : link(setup, {}, nullptr, log, std::move(faults)), world(std::move(episode), test::g1(), link) {}
  Rollout roll(double seconds, double goal = 0.5, const Pose& start = {}) {
    AheadReference source(goal);
    return roll_out(episode_of(seconds, start), world, source, "twin");
  }
  TwinInProcess link;
  GuardedWorld world;
};

TEST(GuardedWorld, AnEpisodeIsRecordedAsInAnEngine) {
  Behind behind;
  const Pose start{yaw_rotation(1.0), {3.0, -2.0, 0.0}};
  const Rollout rollout = behind.roll(8.0, 0.5, start);
  const Recording& recording = rollout.recording;
  EXPECT_EQ(recording.outcome, Outcome::kOk) << recording.message;
  ASSERT_EQ(recording.frames(), 400);
  EXPECT_EQ(recording.reference.size(), 400u);
  EXPECT_EQ(recording.q_target.size(), 400u);
  // It begins where the episode does, wherever the twin stands, and goes ahead in the episode's own frame.
  EXPECT_NEAR((recording.robot.front().X_WB.p - start.p).head<2>().norm(), 0.0, 1e-6);
  EXPECT_NEAR(yaw_of(recording.robot.front().X_WB.R), 1.0, 1e-6);
  const Eigen::Vector3d gone = yaw_rotation(-1.0) * (recording.robot.back().X_WB.p - recording.robot.front().X_WB.p);
  EXPECT_GT(gone.x(), 0.5 - 0.15);  // A.4.3 stops up to 0.15 m short
  EXPECT_LT(gone.x(), 0.5 + 1e-3);
  EXPECT_NEAR(gone.y(), 0.0, 0.02);
  const int elbow = test::g1()->roles.arms[0][3];
  EXPECT_NEAR(recording.robot.back().q[elbow] - recording.robot.front().q[elbow], 0.5, 0.05);
  EXPECT_EQ(behind.world.held_ticks(), 0);
  EXPECT_EQ(behind.world.missed_reports(), 0);
}

TEST(GuardedWorld, TheSameSeedGivesTheSameStates) {
  Behind a, b;
  EXPECT_EQ(a.roll(2.0).state_hash, b.roll(2.0).state_hash);
}

TEST(GuardedWorld, AHoldForLostStatesIsRiddenOutAndCounted) {
  // States are lost for 60 ms: too long not to hold, too short to damp. The operator asks to run again.
  Behind behind(test::twin_guard(), guarded(), {parse_twin_fault("drop@10:10.06=100")});
  const Rollout rollout = behind.roll(8.0);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk) << rollout.recording.message;
  EXPECT_EQ(rollout.recording.frames(), 400);
  EXPECT_GT(behind.world.held_ticks(), 0);
  EXPECT_LT(behind.world.held_ticks(), 40);
}

TEST(GuardedWorld, LostStatesThatDampEndTheEpisodeWithTheirCause) {
  Behind behind(test::twin_guard(), guarded(), {parse_twin_fault("drop@10:10.2=100")});
  const Rollout rollout = behind.roll(8.0);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kError);
  EXPECT_GT(rollout.recording.frames(), 0);
  EXPECT_LT(rollout.recording.frames(), 400);
  EXPECT_THAT(rollout.recording.message, HasSubstr("ended the run at"));
  EXPECT_THAT(rollout.recording.message, HasSubstr("damp (state_age)"));
}

// Beside a person who stands within reach from the beginning the robot would not even stand up.
TEST(GuardedWorld, AGuardThatMindsThePersonHasThemComeNearOnceItRuns) {
  PointTracks partner(200, 24);
  for (int t = 0; t < 200; ++t) partner.frame(t) = test::standing_adult({0.7, 0.0, 0.95});
  GuardedEpisode episode = guarded();
  episode.person = partner_of_clip(partner);
  episode.keeps_distance = true;
  Behind behind(test::twin_guard(true), episode);
  const Rollout rollout = behind.roll(3.0, 0.0);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk) << rollout.recording.message;
  EXPECT_EQ(behind.world.held_ticks(), 0);
  EXPECT_EQ(behind.link.guard().status().bad_messages, 0) << "nobody jumped";
  const LimiterInput& last = behind.link.guard().limiter_input();
  ASSERT_NE(last.person, nullptr);
  EXPECT_NEAR((last.person->col(0) - last.state.X_WB.p).head<2>().norm(), 0.7, 0.05);
}

// A hand is laid on the robot's chest: the engine has the contact, in the episode's frame, and the limits hear of it.
TEST(GuardedWorld, APersonWhoIsSolidTouchesTheTwin) {
  constexpr int kHand = 22, kWrist = 20;
  PointTracks partner(100, kSmplJoints);
  for (int t = 0; t < 100; ++t) {
    HumanJoints joints = test::standing_adult({1.0, 0.0, 0.95});
    const double reach = std::max(0.45 - 0.01 * t, 0.14);
    joints.col(kWrist) = Eigen::Vector3d(reach + 0.1, 0.0, 0.95);
    joints.col(kHand) = Eigen::Vector3d(reach, 0.0, 0.95);
    partner.frame(t) = joints;
  }
  TwinOptions options;
  options.engine = "mujoco";
  GuardedEpisode episode = guarded();
  episode.solid = SolidPerson{test::adult_body(), load_contact_limits(default_contact_limits_path())};
  TwinInProcess link(test::twin_guard(), options, std::make_unique<Walker>("wbc_sim", ControllerOptions{}, test::g1()),
                     nullptr);
  GuardedWorld world(episode, test::g1(), link);
  AheadReference source(0.0);
  const Pose start{yaw_rotation(1.0), {3.0, -2.0, 0.0}};
  Episode setup = episode_of(1.9, start);
  for (int t = 0; t < 100; ++t)
    for (int j = 0; j < kSmplJoints; ++j)
      partner.frame(t).col(j) = start.p + start.R * Eigen::Vector3d(partner.frame(t).col(j));
  setup.partner = partner;
  const Rollout rollout = roll_out(setup, world, source, "twin");
  ASSERT_TRUE(rollout.safety.has_value());
  EXPECT_GT(rollout.safety->peak_force, 1.0);
  ASSERT_FALSE(rollout.recording.contacts.empty());
  bool hand = false;
  for (const auto& [tick, contact] : rollout.recording.contacts) {
    if (contact.side != ContactSide::kHuman) continue;
    hand = true;
    EXPECT_LT((contact.p_WC - start.p).head<2>().norm(), 0.4);
  }
  EXPECT_TRUE(hand);
}

TEST(GuardedWorld, APersonWhoIsSolidNeedsATwinWithAnEngine) {
  GuardedEpisode episode = guarded();
  episode.solid = SolidPerson{test::adult_body(), load_contact_limits(default_contact_limits_path())};
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { Behind(test::twin_guard(), episode); }));
}

TEST(GuardedWorld, ARobotThatTiltsIsStoppedAndTheEpisodeSaysSo) {
  Behind behind(test::twin_guard(), guarded(), {parse_twin_fault("tilt@10:60=1.2")});
  const Rollout rollout = behind.roll(8.0);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kFell);
  EXPECT_LT(rollout.recording.frames(), 400);
  EXPECT_THAT(rollout.recording.message, HasSubstr("the robot fell at"));
}

TEST(GuardedWorld, AGuardThatDoesNotRunSaysWhatItIsAt) {
  GuardedEpisode impatient = guarded();
  impatient.most_wait = 1.0;
  Behind behind(test::twin_guard(), impatient);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)behind.roll(1.0); }));
}

TEST(GuardedWorld, ATwinOfAnotherRobotIsNeverArmed) {
  GuardSetup setup = test::twin_guard();
  setup.mode_machine = 6;
  GuardedEpisode episode = guarded();
  episode.most_wait = 8.0;
  Behind behind(setup, episode);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)behind.roll(1.0); }));
  EXPECT_EQ(behind.link.twin().obeyed_frames(), 0);
}

// A guard that is killed after so many reports.
class DyingLink final : public GuardLink {
 public:
  DyingLink(GuardLink& link, int reports) : link_(link), left_(reports) {}
  bool send(const PlannerMessage& message) override { return link_.send(message); }
  bool send(const PersonMessage& message) override { return link_.send(message); }
  bool stop() override { return link_.stop(); }
  bool next(GuardReport& report) override { return left_-- > 0 && link_.next(report); }
  [[nodiscard]] double patience() const override { return 2.0; }
  [[nodiscard]] std::string name() const override { return "the guard at 'somewhere'"; }

 private:
  GuardLink& link_;
  int left_;
};

TEST(GuardedWorld, AGuardThatIsKilledEndsTheEpisodeAndWhatWasRecordedStays) {
  TwinInProcess twin(test::twin_guard(), {}, nullptr, nullptr);
  DyingLink link(twin, 600);
  GuardedWorld world(guarded(), test::g1(), link);
  AheadReference source(0.5);
  const Rollout rollout = roll_out(episode_of(60.0), world, source, "twin");
  EXPECT_EQ(rollout.recording.outcome, Outcome::kError);
  EXPECT_SENTENCE(rollout.recording.message);
  EXPECT_GT(rollout.recording.frames(), 200);
  EXPECT_LT(rollout.recording.frames(), 600);
}

TEST(GuardedWorld, AGuardThatIsGoneBeforeItBeginsIsSaid) {
  TwinInProcess twin(test::twin_guard(), {}, nullptr, nullptr);
  DyingLink link(twin, 0);
  GuardedWorld world(guarded(), test::g1(), link);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { world.begin(test::g1()->standing_state()); }));
}

TEST(GuardedWorld, ThePersonIsSeenThirtyTimesASecondWhereTheClipHasThem) {
  PointTracks partner(200, 24);
  for (int t = 0; t < 200; ++t) partner.frame(t) = test::standing_adult({4.0 + 0.001 * t, 0.0, 0.95});
  const PartnerSource source = partner_of_clip(partner);
  PersonMessage estimate;
  int seen = 0;
  for (int tick = 0; tick < 50; ++tick) {
    if (!source(tick, estimate)) continue;
    ++seen;
    EXPECT_EQ(estimate.joints, partner.frame(tick));
  }
  EXPECT_EQ(seen, 30);
  GuardedEpisode episode = guarded();
  episode.person = partner_of_clip(partner);
  Behind behind(test::twin_guard(true), episode);
  const Rollout rollout = behind.roll(3.0, 0.3);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk) << rollout.recording.message;
  EXPECT_EQ(behind.link.guard().status().bad_messages, 0);
}

// The observations of the policy, by tick.
class WatchingReference final : public ReferenceSource {
 public:
  void begin(const RobotState& start) override { reference_ = {start.X_WB, start.q}; }
  const Reference* at(const TickView& present) override {
    shown.push_back(*present.partner);
    return &reference_;
  }
  std::vector<HumanJoints> shown;

 private:
  Reference reference_;
};

// Somebody who walks up at 0.5 m/s; the episode's own partner stands elsewhere.
struct Watched {
  explicit Watched(const TwinCamera& camera, GuardedEpisode episode = guarded(), double seconds = 3.0) {
    PointTracks walks(300, 24);
    for (int t = 0; t < 300; ++t) walks.frame(t) = place(t);
    episode.person = partner_of_clip(walks, camera);
    episode.perceives = true;
    Behind behind(test::twin_guard(), episode);
    Episode of_clip = episode_of(seconds, {yaw_rotation(1.0), {3.0, -2.0, 0.0}});
    of_clip.partner = PointTracks(of_clip.ticks + 1, kSmplJoints);
    rollout = roll_out(of_clip, behind.world, source, "twin");
    unseen_ticks = behind.world.unseen_ticks();
    counts = behind.link.guard().status().person;
  }
  static HumanJoints place(int tick) {
    return test::standing_adult({7.0 - 0.01 * std::clamp(tick, 0, 299), -2.0, 0.95});
  }
  WatchingReference source;
  Rollout rollout;
  int unseen_ticks = 0;
  PersonCounts counts{};
};

// In the episode's own frame, as late as the estimates are and the track looks back: 40 ms, or 140 with a camera of
// 100.
TEST(GuardedWorld, ThePolicySeesThePersonWhomTheGuardTracks) {
  for (const double latency : {0.0, 0.1}) {
    const Watched watched({.latency = latency});
    ASSERT_EQ(watched.rollout.recording.outcome, Outcome::kOk) << watched.rollout.recording.message;
    ASSERT_EQ(watched.source.shown.size(), 150u);
    EXPECT_EQ(watched.unseen_ticks, 0);
    const double behind = 1.0 / 50.0 + 0.04 + latency;  // the report is of the tick before
    for (int tick = 20; tick < 150; ++tick) {
      const double x = 7.0 - 0.5 * (0.02 * tick - behind);
      // The wire's numbers of odometry are short, and the twin creeps as it stands: some millimetres.
      EXPECT_NEAR(watched.source.shown[static_cast<std::size_t>(tick)](0, 0), x, 0.012) << tick;
      EXPECT_NEAR(watched.source.shown[static_cast<std::size_t>(tick)](1, 0), -2.0, 0.012) << tick;
    }
    // Scores go by where the person was.
    EXPECT_EQ(watched.rollout.recording.partner.frame(100), HumanJoints(HumanJoints::Zero()));
  }
}

TEST(GuardedWorld, GapsAndJumpsOfTheCameraReachThePolicyAsAPersonWhoStays) {
  for (const TwinCamera& camera : {TwinCamera{.jumps = 0.1, .seed = 5}, TwinCamera{.unseen = 0.3, .seed = 5}}) {
    const Watched watched(camera);
    ASSERT_EQ(watched.rollout.recording.outcome, Outcome::kOk);
    EXPECT_EQ(watched.counts[static_cast<std::size_t>(PersonFault::kJump)] > 0, camera.jumps > 0.0);
    for (std::size_t tick = 20; tick < 150; ++tick) {
      const double x = watched.source.shown[tick](0, 0);
      EXPECT_NEAR(x, 7.0 - 0.5 * (0.02 * static_cast<double>(tick) - 0.06), 0.12) << tick;
      EXPECT_NEAR(watched.source.shown[tick](1, 0), -2.0, 0.02) << tick << ": nobody jumped";
    }
  }
}

TEST(GuardedWorld, APersonWhoIsLostStaysWhereTheyWereLastSeen) {
  GuardedEpisode episode = guarded();
  PointTracks stands(2, 24);
  stands.frame(0) = stands.frame(1) = Watched::place(0);
  const PartnerSource source = partner_of_clip(stands);
  episode.person = [&source](int tick, PersonMessage& seen) { return tick < 50 && source(tick, seen); };
  episode.perceives = true;
  Behind behind(test::twin_guard(), episode);
  WatchingReference policy;
  Episode of_clip = episode_of(3.0);
  of_clip.partner = PointTracks(of_clip.ticks + 1, kSmplJoints);
  const Rollout rollout = roll_out(of_clip, behind.world, policy, "twin");
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk);
  EXPECT_NEAR(behind.world.unseen_ticks(), 100 - 12, 3);  // a quarter of a second after the last estimate
  EXPECT_NEAR(policy.shown.back()(0, 0), 7.0, 0.02);
}

TEST(GuardedWorld, WhereNobodyKnowsBetterTheRecordingHasThePersonWhoWasSeen) {
  GuardedEpisode episode = guarded();
  episode.records_seen = true;
  const Watched watched({}, episode);
  for (int tick = 0; tick < 150; ++tick)
    EXPECT_EQ(watched.rollout.recording.partner.frame(tick), watched.source.shown[static_cast<std::size_t>(tick)]);
}

TEST(GuardedWorld, AnEpisodeDoesNotBeginWithoutAPersonWhoIsTracked) {
  GuardedEpisode episode = guarded();
  episode.most_wait = 10.0;
  episode.perceives = true;
  Behind behind(test::twin_guard(), episode);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)behind.roll(1.0); }));
}

TEST(TwinCamera, IsReadFromItsWords) {
  const TwinCamera camera = parse_twin_camera("noise=0.02,latency=0.1,unseen=0.05,jumps=0.01");
  EXPECT_EQ(camera.noise, 0.02);
  EXPECT_EQ(camera.latency, 0.1);
  EXPECT_EQ(camera.unseen, 0.05);
  EXPECT_EQ(camera.jumps, 0.01);
  EXPECT_EQ(parse_twin_camera("").noise, 0.0);
  for (const char* text : {"blur=1", "noise", "noise=x", "latency=0.3", "unseen=-0.1", "noise=0.1,"})
    EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)parse_twin_camera(text); }));
}

TEST(GuardedWorld, WithoutAPersonWhoHasToBeSeenTheGuardDoesNotRun) {
  GuardedEpisode episode = guarded();
  episode.most_wait = 10.0;
  Behind behind(test::twin_guard(true), episode);
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { (void)behind.roll(1.0); }));
}

// The log of an episode: the same bits through the limiter again, and a recording of the same states.
struct Logged {
  explicit Logged(const test::ScratchFolder& folder) {
    const GuardSetup setup = test::twin_guard();
    RunLog log(folder / "run.mcap", setup);
    Behind behind(setup, guarded(), {}, &log);
    rollout = behind.roll(4.0);
    behind.world.rest(0.2);
    dropped = log.dropped();
  }
  Rollout rollout;
  long dropped = 0;
};

TEST(LogRecording, ALogBecomesTheRecordingOfItsEpisode) {
  const test::ScratchFolder folder;
  const Logged logged(folder);
  ASSERT_EQ(logged.dropped, 0);
  const LogReplay replay = replay_log(folder / "run.mcap");
  EXPECT_EQ(replay.different, 0);
  EXPECT_TRUE(replay.whole);
  const LoggedRun run = recording_of_log(folder / "run.mcap", Task::kWave);
  const Recording& expected = logged.rollout.recording;
  EXPECT_EQ(run.recording.outcome, Outcome::kOk) << run.recording.message;
  EXPECT_EQ(run.recording.task, Task::kWave);
  ASSERT_EQ(run.recording.frames(), expected.frames());
  // The planner's frame t was reported a tick of the guard before the log's.
  for (int t = 0; t < expected.frames(); ++t) {
    EXPECT_LT((run.recording.robot[t].X_WB.p - expected.robot[t].X_WB.p).norm(), 0.002) << t;
    EXPECT_LT((run.recording.robot[t].q - expected.robot[t].q).norm(), 0.05) << t;
    EXPECT_LT((run.recording.reference[t].X_WB.p - expected.reference[t].X_WB.p).norm(), 1e-6) << t;
    EXPECT_EQ(run.recording.reference[t].q, expected.reference[t].q) << t;
  }
  EXPECT_EQ(std::count(run.executed.begin(), run.executed.end(), true), 5 + 14);
  EXPECT_THAT(executed_mask_text(run.executed, *test::g1()), HasSubstr("root velocity and height; 14 of 29 joints, not "
                                                                       "left_hip_pitch_joint"));
}

TEST(LogRecording, TheMaskIsKeptBesideTheRecording) {
  const test::ScratchFolder folder;
  const Logged logged(folder);
  const LoggedRun run = recording_of_log(folder / "run.mcap");
  save_logged_run(run.recording, run.executed, folder / "run.npz");
  const Npz npz = Npz::load(folder / "run.npz");
  EXPECT_EQ(read_executed_mask(npz), run.executed);
  EXPECT_EQ(read_recording(npz).frames(), run.recording.frames());
  EXPECT_EQ(read_executed_mask(recording_npz(run.recording)), std::nullopt);
}

TEST(LogRecording, AMaskThatIsNoneIsRefused) {
  Npz npz;
  npz.set("executed", std::vector<std::int64_t>(36, 2), {36});
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)read_executed_mask(npz); }));
  npz.set("executed", std::vector<std::int64_t>(7, 1), {7});
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { (void)read_executed_mask(npz); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [] { (void)executed_mask_text(ExecutedMask(20, true), *test::g1()); }));
}

TEST(LogRecording, ALogThatWasCutOffGivesWhatIsThere) {
  const test::ScratchFolder folder;
  const Logged logged(folder);
  const std::string bytes = read_file(folder / "run.mcap");
  write_file(folder / "cut.mcap", bytes.substr(0, bytes.size() * 3 / 4));
  const LoggedRun run = recording_of_log(folder / "cut.mcap");
  EXPECT_FALSE(run.whole);
  EXPECT_GT(run.recording.frames(), 20);
  EXPECT_LT(run.recording.frames(), logged.rollout.recording.frames());
}

TEST(LogRecording, WhatIsNoLogOfARunIsRefused) {
  const test::ScratchFolder folder;
  { McapWriter writer(folder / "empty.mcap"); }
  const auto refusal = [](const std::string& path) {
    return test::thrown_message<InputError>([&] { (void)recording_of_log(path); });
  };
  EXPECT_SENTENCE(refusal(folder / "empty.mcap"));
  { RunLog log(folder / "idle.mcap", test::twin_guard()); }
  EXPECT_SENTENCE(refusal(folder / "idle.mcap"));
  write_file(folder / "text", "text");
  EXPECT_SENTENCE(refusal(folder / "text"));
}

TEST(LogRecording, ADiskThatIsFullIsSaidBeforeAnythingIsArmed) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "not run: /dev/full absent";
  EXPECT_SENTENCE(test::thrown_message<StorageError>([] { RunLog log("/dev/full", test::twin_guard()); }));
}

}  // namespace
}  // namespace duet
