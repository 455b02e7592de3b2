#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/policies/language.h"
#include "duet/training/dstar/demonstrations.h"
#include "duet/training/dstar/trainer.h"
#include "duet/training/dstar/windows.h"
#include "tests/support.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

// A robot that walks along x and lifts an arm beside a partner that stands ahead.
RobotMotion made_motion(const RobotModel& robot, int frames) {
  RobotMotion motion;
  motion.joint_names = robot.joint_names();
  motion.q = Eigen::MatrixXd::Zero(robot.dof(), frames);
  for (int t = 0; t < frames; ++t) {
    motion.root.push_back({yaw_rotation(0.3), {0.004 * t, 1.0, 0.76}});
    motion.q.col(t) = robot.neutral;
    motion.q(15, t) += 0.002 * t;
  }
  return motion;
}

PointTracks made_partner(int frames) {
  PointTracks partner(frames, kSmplJoints);
  for (int t = 0; t < frames; ++t)
    for (int j = 0; j < kSmplJoints; ++j) partner.at(t, j) = Eigen::Vector3d(2.0 + 0.001 * t, 1.0 + 0.01 * j, 0.05 * j);
  return partner;
}

// A full disk or a folder that is gone stops a training instead of leaving a curve with holes.
TEST(DstarLog, ACurveThatCannotBeWrittenIsAnError) {
  const test::ScratchFolder scratch;
  DstarRun run;
  run.folder = scratch / "run";
  DstarLog log(run, 0, 0.0);
  log.validated(0.5, 0.9, 10, 1e-4);
  EXPECT_THAT(read_file(dstar_curves(run)), ::testing::HasSubstr("\n10,"));
  std::filesystem::remove(dstar_curves(run));
  std::filesystem::create_directory(dstar_curves(run));
  EXPECT_THROW(log.validated(0.4, 0.9, 20, 1e-4), InputError);
}

Demonstration entry(const std::string& id) { return {id, std::string(64, id.back()), Task::kHandshake, {50, 100}}; }

DemonstrationSet made_set(const RobotModel& robot) {
  DemonstrationSet set;
  set.robot_digest = robot.digest;
  set.origin = "3 clips";
  for (const char* id : {"clip-a", "clip-b", "clip-c"}) {
    const RobotMotion motion = made_motion(robot, 150);
    set.add(entry(id), states_of(motion), motion, made_partner(150));
  }
  return set;
}

TEST(Demonstrations, StatesOfAMotionHaveItsVelocities) {
  const std::vector<RobotState> states = states_of(made_motion(*test::g1(), 50));
  EXPECT_NEAR(states[20].v_WB.x(), 0.2, 1e-9);
  EXPECT_NEAR(states[20].v[15], 0.1, 1e-9);
  EXPECT_NEAR(states[20].w_WB_B.norm(), 0.0, 1e-9);
}

TEST(Demonstrations, SurviveAFile) {
  const test::ScratchFolder folder;
  const std::string path = folder / "set.safetensors";
  const DemonstrationSet set = made_set(*test::g1());
  save_demonstrations(set, path);
  const DemonstrationSet read = load_demonstrations(path, test::g1()->digest, "3 clips");
  ASSERT_EQ(read.list.size(), 3U);
  EXPECT_EQ(read.list[1].clip_id, "clip-b");
  EXPECT_EQ(read.list[1].begin, 150);
  EXPECT_EQ(read.list[2].phases, (Phases{50, 100}));
  EXPECT_EQ(read.frames(), 450);
  EXPECT_EQ(read.reference(449).q, set.reference(449).q);
  EXPECT_NEAR((read.state(200).X_WB.p - Eigen::Vector3d(0.2, 1.0, 0.76)).norm(), 0.0, 1e-6);
}

TEST(Demonstrations, OfAnotherRobotAreRefused) {
  const test::ScratchFolder folder;
  const std::string path = folder / "set.safetensors";
  save_demonstrations(made_set(*test::g1()), path);
  EXPECT_SENTENCE(
      test::thrown_message<InputError>([&] { load_demonstrations(path, std::string(64, '0'), "3 clips"); }));
}

TEST(Demonstrations, MadeOtherwiseAreRefused) {
  const test::ScratchFolder folder;
  const std::string path = folder / "set.safetensors";
  save_demonstrations(made_set(*test::g1()), path);
  EXPECT_THAT([&] { load_demonstrations(path, test::g1()->digest, "300 clips"); },
              testing::ThrowsMessage<InputError>(
                  path + ": demonstrations made otherwise: expected 300 clips, found 3 clips: choose another folder"));
}

TEST(Demonstrations, OfDifferentLengthsAreRefused) {
  DemonstrationSet set;
  const RobotMotion motion = made_motion(*test::g1(), 20);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [&] { set.add(entry("x"), states_of(motion), motion, made_partner(19)); }));
}

TEST(Demonstrations, AClipOfTheTestSplitIsRefusedByName) {
  const DemonstrationSet set = made_set(*test::g1());
  EXPECT_NO_THROW(check_held_out(set, {std::string(64, 'd')}, "split.txt"));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { check_held_out(set, {std::string(64, 'b')}, "split.txt"); }));
}

TEST(Demonstrations, ASplitWithABrokenLineIsRefusedWithItsNumber) {
  const test::ScratchFolder folder;
  const std::string path = folder / "split.txt";
  write_file(path, "# comment\n" + std::string(64, 'a') + "  clip-a\nabc  clip-b\n");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_split(path); }));
}

struct Made {
  explicit Made(const WindowOptions& options, std::uint64_t seed = 1)
      : set(made_set(*test::g1())), maker(test::g1(), set, options) {
    Random random(seed, 7);
    batch.resize(2);
    maker.make({0, 25}, random, batch, 0);
    maker.make({1, 75}, random, batch, 1);
  }
  DemonstrationSet set;
  WindowMaker maker;
  WindowBatch batch;
};

TEST(Windows, OfASetStartEveryStride) {
  const DemonstrationSet set = made_set(*test::g1());
  const std::vector<Window> windows = list_windows(set, {});
  EXPECT_EQ(windows.size(), 18U);
  EXPECT_EQ(windows[7].demonstration, 1);
  EXPECT_EQ(windows[7].frame, 25);
}

TEST(Windows, WithoutAugmentationAreTheDemonstrationInTheRobotsFrame) {
  const Made made({.augment = false});
  const auto plan = made.batch.plan.col(0);
  EXPECT_NEAR(plan[0], 0.0F, 1e-5F);  // the first anchor is where the robot is
  EXPECT_NEAR(plan[2], 0.76F, 1e-5F);
  EXPECT_NEAR(plan[3], 1.0F, 1e-5F);  // its heading is the frame's
  EXPECT_NEAR(plan[36], 0.1F * std::cos(0.3F), 1e-5F);
  EXPECT_NEAR(plan[37], -0.1F * std::sin(0.3F), 1e-5F);
  EXPECT_NEAR(plan[4 * 36 + 7 + 15], 0.002F * 125, 1e-5F);
  EXPECT_EQ(made.batch.phase[0], 0);
  EXPECT_EQ(made.batch.phase[1], 1);
  EXPECT_EQ(made.batch.prompt[0], 0);
}

TEST(Windows, OfOneWhoLeadsHaveCommandsThatSayIt) {
  DemonstrationSet set = made_set(*test::g1());
  for (Demonstration& entry : set.list) entry.leads = true;
  const std::vector<std::string> commands = commands_of(set.list[0].task, true);
  EXPECT_EQ(commands.size(), 2 * commands_of(set.list[0].task, false).size());
  WindowBatch batch;
  batch.resize(1);
  for (const bool augment : {false, true}) {
    WindowMaker maker(test::g1(), set, {.augment = augment});
    for (int i = 0; i < 20; ++i) {
      Random random(i, 1);
      maker.make({0, 25}, random, batch, 0);
      EXPECT_THAT(commands.at(batch.prompt[0]), testing::EndsWith(" first"));
    }
  }
}

TEST(Windows, LookBackByTheStrideOfTheLongStream) {
  const Made far({.long_stride = 5, .augment = false}), near({.augment = false});
  const auto frame = [](const Eigen::MatrixXf& frames, int i) {
    return frames.col(1).segment(kFrameSize * i, kFrameSize);
  };
  EXPECT_EQ(near.batch.past, near.batch.frames);
  EXPECT_EQ(far.batch.frames, near.batch.frames);
  EXPECT_EQ(frame(far.batch.past, 11), frame(far.batch.frames, 11));
  EXPECT_EQ(frame(far.batch.past, 10), frame(far.batch.frames, 6));  // five ticks before
  EXPECT_NE(frame(far.batch.past, 0), frame(far.batch.frames, 0));
}

TEST(Windows, TellWhereThePartnerWillBe) {
  const Made made({.augment = false});
  const int hand = kLossPoints - 1, joint = kRightHand;
  const Eigen::Vector3f later = made.batch.partner.col(0).segment<3>(3 * (kLossPoints * 4 + hand));
  const Eigen::Vector3d p_W(2.0 + 0.125, 1.0 + 0.01 * joint, 0.05 * joint);
  const Eigen::Vector3d p_E = yaw_rotation(-0.3) * Eigen::Vector3d(p_W - Eigen::Vector3d(0.1, 1.0, 0.0));
  EXPECT_LT((later.cast<double>() - p_E).norm(), 1e-5);
}

TEST(Windows, WithTheSameRandomNumbersAreTheSameBits) {
  const Made one({}, 3), two({}, 3), other({}, 4);
  EXPECT_EQ(one.batch.frames, two.batch.frames);
  EXPECT_EQ(one.batch.plan, two.batch.plan);
  EXPECT_NE(one.batch.frames, other.batch.frames);
}

// The partner's joint beside where the demonstration has it, in each frame of a window.
std::vector<double> beside(const WindowBatch& batch, const WindowBatch& plain, int column, int joint) {
  std::vector<double> distances;
  for (int i = 0; i < kHistoryFrames; ++i) {
    const int at = kFrameSize * i + 3 + 3 * joint;
    distances.push_back((batch.frames.col(column).segment<3>(at) - plain.frames.col(column).segment<3>(at)).norm());
  }
  return distances;
}

// As long as somebody waits: all joints but the pelvis stay beside their places; hands come back in the act, not
// before.
TEST(Windows, OfAMisplacedPartnerKeepItsHandsOnceTheActHasBegun) {
  WindowOptions options = {.stride = 1,
                           .root = 0.0,
                           .heading = 0.0,
                           .tilt = 0.0,
                           .astray = 0.0,
                           .turned = 0.0,
                           .joints = 0.0,
                           .rates = 0.0,
                           .jitter = 0.0,
                           .dropout = 0.0};
  const DemonstrationSet set = made_set(*test::g1());
  const int begin = set.list[0].phases.act_begin;
  WindowOptions plain_options = options;
  plain_options.augment = false;
  WindowMaker maker(test::g1(), set, options), plain_maker(test::g1(), set, plain_options);
  WindowBatch batch, plain;
  batch.resize(60);
  plain.resize(60);
  int misplaced = 0;
  for (int i = 0; i < 60; ++i) {
    const int frame = i % 2 == 0 ? begin - 1 : begin + 40;
    Random random(5, static_cast<std::uint64_t>(i)), other(5, static_cast<std::uint64_t>(i));
    maker.make({0, frame}, random, batch, i);
    plain_maker.make({0, frame}, other, plain, i);
    const std::vector<double> ankle = beside(batch, plain, i, kLeftAnkle), hand = beside(batch, plain, i, kRightHand);
    EXPECT_NEAR(*std::ranges::max_element(ankle), *std::ranges::min_element(ankle), 1e-5);
    if (ankle.front() == 0.0) continue;
    ++misplaced;
    EXPECT_LT(ankle.front(), 1.0);
    if (i % 2 == 0) {
      EXPECT_GT(hand.back(), 1e-4);
      EXPECT_NEAR(hand.front(), hand.back(), 1e-5);
    } else {
      EXPECT_NEAR(hand.back(), 0.0, 1e-5);
    }
  }
  EXPECT_GT(misplaced, 25);  // two of three
  EXPECT_LT(misplaced, 55);
}

TEST(Windows, OfADisplacedRobotLeadBackToTheDemonstration) {
  WindowOptions options;
  options.stride = 1;  // no shift in time
  options.jitter = options.dropout = options.misplaced = 0.0;
  const DemonstrationSet set = made_set(*test::g1());
  WindowMaker maker(test::g1(), set, options);
  WindowBatch batch;
  batch.resize(200);
  Random random(1, 9);
  double largest = 0.0;
  for (int i = 0; i < batch.size; ++i) {
    maker.make({0, 60}, random, batch, i);
    largest = std::max<double>(largest, batch.plan.col(i).head<2>().norm());
  }
  EXPECT_GT(largest, 0.1);  // the first anchor is not where the displaced robot is
  EXPECT_LT(largest, 0.4);
}

TEST(Windows, OfARobotAstrayLeadBackAtAWalk) {
  WindowOptions options;
  options.stride = 1;
  options.astray = 3.0;
  options.turned = 3.0;
  const DemonstrationSet set = made_set(*test::g1());
  WindowMaker maker(test::g1(), set, options);
  WindowBatch batch;
  batch.resize(200);
  Random random(1, 9);
  double farthest = 0.0, most_turned = 0.0;
  for (int i = 0; i < batch.size; ++i) {
    maker.make({0, 60}, random, batch, i);
    for (int k = 0; k < kAnchors; ++k) {
      const auto anchor = batch.plan.col(i).segment<7>(kAnchorSize * k).cast<double>();
      const double distance = anchor.head<2>().norm(), seconds = 0.5 * k;
      const double turn = std::abs(yaw_of(Eigen::Quaterniond(anchor[3], anchor[4], anchor[5], anchor[6])));
      EXPECT_LE(distance, options.reach + options.speed * seconds + 1e-5);
      EXPECT_LE(turn, options.turn_reach + options.turn_rate * seconds + 1e-5);
      farthest = std::max(farthest, distance - options.reach - options.speed * seconds);
      most_turned = std::max(most_turned, turn - options.turn_reach - options.turn_rate * seconds);
    }
  }
  EXPECT_NEAR(farthest, 0.0, 1e-4);  // some would have to run
  EXPECT_NEAR(most_turned, 0.0, 1e-4);
}

TEST(Windows, StatisticsNormaliseTheirOwnSample) {
  const DemonstrationSet set = made_set(*test::g1());
  WindowMaker maker(test::g1(), set, {});
  const WindowStatistics statistics = window_statistics(maker, list_windows(set, {}), 1);
  EXPECT_EQ(statistics.frame_mean.size(), kFrameSize);
  EXPECT_EQ(statistics.plan_mean.size(), kPlanSize);
  EXPECT_GE(statistics.plan_deviation.minCoeff(), 0.01F);
  EXPECT_NEAR(statistics.plan_mean[2], 0.76F, 0.01F);
}

TEST(DstarVariants, SwitchOffWhatTheirNamesSay) {
  DstarRun run;
  set_variant(run, "dp");
  EXPECT_FALSE(run.config.phase_attention);
  EXPECT_FALSE(run.config.spatial_reasoning);
  EXPECT_EQ(run.loss.lambda_auxiliary, 0.0);
  EXPECT_EQ(run.name, "dp");
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { set_variant(run, "dstr"); }));
}

}  // namespace
}  // namespace duet
