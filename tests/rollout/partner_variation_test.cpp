#include "duet/rollout/partner_variation.h"

#include <gmock/gmock.h>

#include "duet/backends/factory.h"
#include "duet/bench/runner.h"
#include "duet/controllers/registry.h"
#include "duet/core/require.h"
#include "duet/policies/registry.h"
#include "duet/rollout/act_episode.h"
#include "duet/rollout/perturbation.h"
#include "tests/bench/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kRounding = 1e-9;      // [frames] of a play head that adds up speeds
constexpr int kClipFrames = 300;        // 6 s
constexpr Phases kPhases = {100, 200};  // of an episode that begins at the clip's frame kClipFrame
constexpr int kClipFrame = 20;

// The x of every joint is the frame, so that a frame tells where in the clip it is from.
HumanMotion counting_clip() {
  HumanMotion clip;
  clip.joints = PointTracks(kClipFrames, kSmplJoints);
  for (int t = 0; t < kClipFrames; ++t)
    for (int j = 0; j < kSmplJoints; ++j) clip.joints.at(t, j) = Eigen::Vector3d(t, 0.1 * j, 1.0 + 0.01 * j);
  return clip;
}

double frame_at(const PartnerVariation& variation, int tick) {
  return partner_motion(counting_clip(), variation, kPhases, kClipFrame, tick + 1).joints.at(tick, 0).x() - kClipFrame;
}

TEST(PartnerVariation, NoneIsTheClipToTheBit) {
  const HumanMotion clip = counting_clip();
  const HumanMotion same = partner_motion(clip, std::nullopt, kPhases, kClipFrame, 400);
  for (int t = 0; t < 400; ++t)
    EXPECT_EQ(same.joints.frame(t), clip.joints.frame(std::min(t + kClipFrame, kClipFrames - 1))) << t;
  EXPECT_EQ(partner_motion(clip, PartnerVariation{}, kPhases, kClipFrame, 400).joints, same.joints);
}

TEST(PartnerVariation, ALaterPartnerWaits) {
  PartnerVariation later;
  later.shift_s = 1.0;
  EXPECT_EQ(frame_at(later, 50), 0.0);
  EXPECT_EQ(frame_at(later, 51), 1.0);
  EXPECT_EQ(frame_at(later, 150), 100.0);
  EXPECT_EQ(episode_ticks(later, 250), 300);
}

TEST(PartnerVariation, AnEarlierPartnerLacksPartOfItsPreparation) {
  PartnerVariation earlier;
  earlier.shift_s = -0.5;
  EXPECT_EQ(frame_at(earlier, 0), 25.0);
  EXPECT_EQ(frame_at(earlier, 10), 35.0);
  EXPECT_EQ(episode_ticks(earlier, 250), 250);
  earlier.shift_s = -10.0;
  EXPECT_EQ(frame_at(earlier, 0), 100.0);  // the act is the earliest
}

TEST(PartnerVariation, SpeedIsOfTheWholeMotion) {
  PartnerVariation slower;
  slower.speed = 0.8;
  EXPECT_NEAR(frame_at(slower, 100), 80.0, kRounding);
  EXPECT_EQ(episode_ticks(slower, 200), 250);
  PartnerVariation faster;
  faster.speed = 1.25;
  EXPECT_NEAR(frame_at(faster, 40), 50.0, kRounding);
  EXPECT_EQ(episode_ticks(faster, 200), 200);
}

TEST(PartnerVariation, AHesitatingPartnerStandsStillAtHalfOfItsPreparation) {
  PartnerVariation hesitating;
  hesitating.hesitate_s = 1.0;
  EXPECT_EQ(frame_at(hesitating, 50), 50.0);
  EXPECT_EQ(frame_at(hesitating, 100), 50.0);
  EXPECT_EQ(frame_at(hesitating, 101), 51.0);
  EXPECT_EQ(episode_ticks(hesitating, 250), 300);
}

TEST(PartnerVariation, AnAbortingPartnerGoesBackTheWayItCameAndStays) {
  PartnerVariation aborting;
  aborting.abort = true;
  EXPECT_EQ(frame_at(aborting, 150), 150.0);
  EXPECT_EQ(frame_at(aborting, 160), 140.0);
  EXPECT_EQ(frame_at(aborting, 300), 0.0);
  EXPECT_EQ(frame_at(aborting, 320), 0.0);
}

TEST(PartnerVariation, ScaleKeepsTheWayAndTheGround) {
  PartnerVariation taller;
  taller.scale = 1.1;
  const HumanMotion motion = partner_motion(counting_clip(), taller, kPhases, kClipFrame, 30);
  EXPECT_NEAR(motion.joints.at(20, kPelvis).x(), 40.0, kRounding);
  EXPECT_NEAR(motion.joints.at(20, kPelvis).z(), 1.1, kRounding);
  EXPECT_NEAR(motion.joints.at(20, kHead).z(), 1.1 * (1.0 + 0.01 * int{kHead}), kRounding);
  EXPECT_NEAR((motion.joints.at(20, kHead) - motion.joints.at(20, kPelvis)).norm(),
              1.1 * 0.01 * int{kHead} * std::hypot(10.0, 1.0), kRounding);
}

std::vector<Perturbation> read(const std::string& list) {
  return parse_suite(
             "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nperturbations: " +
                 list + "\n",
             "p.yaml")
      .perturbations;
}

TEST(PartnerVariation, IsReadStrictlyAndWrittenOut) {
  const Perturbation perturbation = read("[{name: slow, partner: {speed: 0.8, abort: true}}]")[0];
  EXPECT_EQ(perturbation.partner->speed, 0.8);
  EXPECT_TRUE(perturbation.partner->abort);
  EXPECT_EQ(perturbation.partner->scale, 1.0);
  const std::string once = to_yaml(perturbation);
  EXPECT_EQ(to_yaml(read("[" + once + "]")[0]), once);
  const auto refusal = [](const std::string& values) {
    return test::thrown_message<InputError>([&] { read("[{partner: " + values + "}]"); });
  };
  EXPECT_THAT(refusal("{speed: 0}"), AllOf(HasSubstr("p.yaml:8"), HasSubstr("speed: expected a number from 0.25")));
  EXPECT_THAT(refusal("{scale: 3}"), HasSubstr("scale: expected a number from 0.5, at most 1.5, found 3"));
  EXPECT_THAT(refusal("{hesitate_s: -1}"), HasSubstr("hesitate_s: expected"));
  EXPECT_THAT(refusal("{shift_s: 31}"), HasSubstr("shift_s: expected"));
  EXPECT_THAT(refusal("{abort: 2}"), HasSubstr("abort"));
  EXPECT_THAT(refusal("{sped: 2}"), HasSubstr("speed"));
  EXPECT_THAT(refusal("2"), HasSubstr("partner"));
}

// The partner of the recording is the varied one, the robot's reference is not touched.
TEST(PartnerVariation, IsTheRealPartnerOfAnEpisode) {
  const auto robot = test::g1();
  const PairedMotion clip = test::paired(Task::kWave, *robot);
  const EpisodeSpec spec{&clip, "playback", "pd", "replay", "main", 0, 1};
  const Suite suite = test::playback_suite();
  RolloutSetup setup = episode_setup(spec, suite, *robot);
  const auto roll = [&] {
    const auto policy = make_policy("replay", robot);
    return play_back(setup, *policy).recording;
  };
  const Recording clean = roll();
  setup.perturbation.partner = PartnerVariation{.scale = 0.9, .shift_s = 1.0};
  const Recording varied = roll();
  ASSERT_EQ(varied.frames(), clean.frames() + 50);
  EXPECT_NEAR(varied.partner.at(150, kHead).z(), 0.9 * clean.partner.at(100, kHead).z(), kRounding);
  for (int t = 0; t < clean.frames(); t += 29) EXPECT_EQ(varied.reference[t].q, clean.reference[t].q) << t;
}

}  // namespace
}  // namespace duet
