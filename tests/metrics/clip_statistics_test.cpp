#include "duet/metrics/clip_statistics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "duet/motion/synthesis/synthesis.h"
#include "tests/support.h"

namespace duet {
namespace {

// A person who stands: every joint over the middle of the feet but the hands, which hang beside.
HumanMotion standing(int frames, const Eigen::Vector3d& at) {
  constexpr std::array<std::array<double, 3>, kSmplJoints> kPose = {
      {{0, 0, .9},     {0, .1, .85},    {0, -.1, .85},  {0, 0, 1.0},     {0, .1, .45},   {0, -.1, .45},
       {0, 0, 1.1},    {0, .1, .05},    {0, -.1, .05},  {0, 0, 1.2},     {.15, .1, 0},   {.15, -.1, 0},
       {.05, 0, 1.4},  {0, .1, 1.35},   {0, -.1, 1.35}, {.05, 0, 1.6},   {.05, .2, 1.3}, {.05, -.2, 1.3},
       {.05, .2, 1.0}, {.05, -.2, 1.0}, {.05, .2, .75}, {.05, -.2, .75}, {.05, .2, .65}, {.05, -.2, .65}}};
  HumanMotion motion{.rate_hz = 50.0, .joints = PointTracks(frames, kSmplJoints), .rotations = {}};
  for (int t = 0; t < frames; ++t)
    for (int j = 0; j < kSmplJoints; ++j)
      motion.joints.frame(t).col(j) = at + Eigen::Vector3d(kPose[j][0], kPose[j][1], kPose[j][2]);
  return motion;
}

InteractionClip standing_pair(int frames, double apart) {
  return {.id = "standing",
          .task = Task::kHug,
          .a = standing(frames, Eigen::Vector3d::Zero()),
          .b = standing(frames, Eigen::Vector3d(0.0, apart, 0.0)),
          .phases = {.act_begin = 1, .act_end = frames},
          .contacts = {},
          .source = {}};
}

void move(HumanMotion& motion, int frame, const Eigen::Vector3d& by) { motion.joints.frame(frame).colwise() += by; }

TEST(ClipStatistics, PeopleWhoStandApartHaveTheirDistanceAndNoContact) {
  const ClipStatistics found = clip_statistics(standing_pair(100, 1.0));
  EXPECT_DOUBLE_EQ(found.seconds, 2.0);
  EXPECT_NEAR(found.nearest_joint_distance, 0.6, 1e-12);  // from hand to hand
  EXPECT_EQ(found.contact_ratio, 0.0);
  EXPECT_EQ(found.contact_events_per_s, 0.0);
  EXPECT_EQ(found.aabb_overlap_iou, 0.0);
  EXPECT_EQ(found.joint_speed_p95, 0.0);
  EXPECT_EQ(found.com_outside_support, 0.0);
}

TEST(ClipStatistics, EachTouchIsOneEventAndItsFramesAreTheRatio) {
  InteractionClip clip = standing_pair(100, 1.0);
  for (const int t : {10, 11, 12, 50}) move(clip.b, t, {0.0, -0.45, 0.0});  // hands 0.15 m apart
  const ClipStatistics found = clip_statistics(clip);
  EXPECT_DOUBLE_EQ(found.contact_events_per_s, 1.0);
  EXPECT_DOUBLE_EQ(found.contact_ratio, 0.04);
}

TEST(ClipStatistics, ADistanceOfTheThresholdIsNoContact) {
  InteractionClip clip = standing_pair(10, 0.4 + kContactDistance + 1e-9);
  EXPECT_EQ(clip_statistics(clip).contact_ratio, 0.0);
  clip = standing_pair(10, 0.4 + kContactDistance - 1e-9);
  EXPECT_EQ(clip_statistics(clip).contact_ratio, 1.0);
  EXPECT_DOUBLE_EQ(clip_statistics(clip).contact_events_per_s, 5.0);  // that it begins with one counts
}

TEST(ClipStatistics, BoxesOverlapByTheirSharedVolume) {
  // Boxes 0.4 m wide (hand to hand), 0.2 m of it shared: 0.2 / 0.6.
  EXPECT_NEAR(clip_statistics(standing_pair(10, 0.2)).aabb_overlap_iou, 1.0 / 3.0, 1e-12);
}

TEST(ClipStatistics, SpeedAndAccelerationAreOfTheJoints) {
  InteractionClip clip = standing_pair(200, 1.0);
  for (int t = 0; t < 200; ++t) {
    move(clip.a, t, {0.5 * (t / 50.0) * (t / 50.0), 0.0, 0.0});  // 1 m/s^2
    move(clip.b, t, {0.5 * (t / 50.0) * (t / 50.0), 0.0, 0.0});
  }
  const ClipStatistics found = clip_statistics(clip);
  EXPECT_NEAR(found.joint_acceleration_p95, 1.0, 1e-9);
  EXPECT_NEAR(found.joint_speed_p95, 0.95 * 199 / 50.0, 0.03);
}

TEST(ClipStatistics, WhoLeansBeyondTheToesIsOutsideTheSupport) {
  InteractionClip clip = standing_pair(10, 1.0);
  for (int t = 0; t < 10; ++t)
    for (int j = 0; j < kSmplJoints; ++j)
      if (clip.a.joints.at(t, j).z() > 0.8) clip.a.joints.frame(t)(0, j) += 0.4;
  EXPECT_DOUBLE_EQ(clip_statistics(clip).com_outside_support, 0.5);  // A in all frames, B in none
}

TEST(ClipStatistics, CentreOfMassOfAStandingPersonIsAtThePelvis) {
  const HumanMotion person = standing(2, {1.0, 2.0, 0.0});
  const Eigen::Vector3d com = centre_of_mass(person.joints.frame(0));
  EXPECT_NEAR(com.x(), 1.0, 0.05);
  EXPECT_NEAR(com.y(), 2.0, 1e-12);
  EXPECT_GT(com.z(), 0.85);
  EXPECT_LT(com.z(), 1.15);
}

TEST(ClipStatistics, PooledMeansAreWeightedBySeconds) {
  const std::array<ClipStatistics, 2> clips = {ClipStatistics{.seconds = 3.0, .contact_ratio = 0.2},
                                               ClipStatistics{.seconds = 1.0, .contact_ratio = 0.6}};
  EXPECT_DOUBLE_EQ(pooled(clips).contact_ratio, 0.3);
  EXPECT_DOUBLE_EQ(pooled(clips).seconds, 4.0);
  EXPECT_EQ(pooled({}).seconds, 0.0);
}

TEST(ClipStatistics, TwoFramesAreTooFew) {
  try {
    (void)clip_statistics(standing_pair(2, 1.0));
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "statistics of clip 'standing': expected at least 3 frames, found 2");
  }
}

TEST(ClipStatistics, ASynthesisedHandshakeHasContactAndPlausibleMotion) {
  const ClipStatistics found = clip_statistics(synthesize(Task::kHandshake, {.seed = 4}));
  EXPECT_GT(found.contact_ratio, 0.1);
  EXPECT_GT(found.joint_speed_p95, 0.1);
  EXPECT_LT(found.joint_speed_p95, 3.0);
  EXPECT_LT(found.nearest_joint_distance, 3.0);
}

// Two who stand 1 m apart, hands down; the right hands meet in the middle in frames [begin, end).
HumanMotion standing(double x, int frames, double rate_hz) {
  HumanMotion person{.rate_hz = rate_hz, .joints = PointTracks(frames, kSmplJoints), .rotations = {}};
  for (int t = 0; t < frames; ++t)
    for (int j = 0; j < kSmplJoints; ++j) person.joints.at(t, j) = Eigen::Vector3d(x, 0.05 * j, 0.9);
  for (int t = 0; t < frames; ++t) {
    person.joints.at(t, kHead).z() = 1.6;
    person.joints.at(t, kNeck).z() = 1.5;
    person.joints.at(t, kLeftToe).z() = 0.0;
    for (const int hand : {kLeftHand, kRightHand}) person.joints.at(t, hand).z() = 0.8;
  }
  return person;
}

InteractionClip meeting(int begin, int end, int frames = 100, double rate_hz = 50.0) {
  InteractionClip clip;
  clip.id = "meeting";
  clip.task = Task::kHandshake;
  clip.a = standing(0.0, frames, rate_hz);
  clip.b = standing(1.0, frames, rate_hz);
  clip.phases = {.act_begin = begin, .act_end = end};
  for (int t = begin; t < end; ++t) {
    clip.a.joints.at(t, kRightHand) = Eigen::Vector3d(0.45, 0.0, 1.1);
    clip.b.joints.at(t, kRightHand) = Eigen::Vector3d(0.55, 0.0, 1.1);
  }
  return clip;
}

TEST(InteractionStatistics, TouchIsTimedAndPlaced) {
  const InteractionStatistics found = interaction_statistics(meeting(20, 70));
  EXPECT_DOUBLE_EQ(found.seconds, 2.0);
  EXPECT_DOUBLE_EQ(found.touches, 1.0);
  EXPECT_DOUBLE_EQ(found.touch_s, 1.0);
  EXPECT_DOUBLE_EQ(found.before_s, 0.4);
  EXPECT_DOUBLE_EQ(found.after_s, 0.6);
  EXPECT_DOUBLE_EQ(found.touch_distance, 1.0);
  EXPECT_NEAR(found.touch_height, 1.1, 1e-12);
  EXPECT_DOUBLE_EQ(found.right_hands, 1.0);
  EXPECT_DOUBLE_EQ(found.standing, 1.0);
  EXPECT_DOUBLE_EQ(found.reaction_s, 0.0);
}

// Facing +x (A) and, turned by `turn`, -x (B), who stands `right` to the right of A.
InteractionClip facing_each_other(double right, double turn) {
  InteractionClip clip = meeting(20, 70);
  for (int t = 0; t < clip.frames(); ++t) {
    clip.b.joints.frame(t).row(1).array() -= right;
    for (const auto& [person, yaw] : {std::pair(&clip.a, 0.0), std::pair(&clip.b, std::numbers::pi + turn)}) {
      const Eigen::Vector3d pelvis = person->joints.at(t, kPelvis);
      const Eigen::Vector3d to_left(-0.1 * std::sin(yaw), 0.1 * std::cos(yaw), 0.0);
      person->joints.at(t, kLeftHip) = pelvis + to_left;
      person->joints.at(t, kRightHip) = pelvis - to_left;
    }
    if (t >= 20 && t < 70) clip.b.joints.at(t, kRightHand) = clip.a.joints.at(t, kRightHand);
  }
  return clip;
}

TEST(InteractionStatistics, BearingIsToTheRightAndTurnHasNoSign) {
  const InteractionStatistics straight = interaction_statistics(facing_each_other(0.0, 0.0));
  EXPECT_NEAR(straight.touch_bearing, 0.0, 1e-9);
  EXPECT_NEAR(straight.touch_turn, 0.0, 1e-9);
  const InteractionStatistics aside = interaction_statistics(facing_each_other(1.0, 0.0));
  EXPECT_NEAR(aside.touch_bearing, 45.0, 1e-9);  // of both: each has the other to its right
  EXPECT_NEAR(aside.touch_turn, 0.0, 1e-9);
  EXPECT_NEAR(interaction_statistics(facing_each_other(-1.0, 0.0)).touch_bearing, -45.0, 1e-9);
  for (const double turn : {0.4, -0.4}) {
    const InteractionStatistics turned = interaction_statistics(facing_each_other(1.0, turn));
    EXPECT_NEAR(turned.touch_turn, 0.4 * 180.0 / std::numbers::pi, 1e-9);
    EXPECT_NEAR(turned.touch_bearing, 45.0 + 0.5 * turn * 180.0 / std::numbers::pi, 1e-9);  // B's alone
  }
}

// The turn is a mean over both, so that B's alone counts half: 0.4 rad left from the first frame to mid-touch.
TEST(InteractionStatistics, HipsTurnUntilTheMiddleOfTheTouch) {
  InteractionClip clip = facing_each_other(0.0, 0.0);
  const InteractionClip turned = facing_each_other(0.0, 0.4);
  EXPECT_NEAR(interaction_statistics(clip).turned_hips, 0.0, 1e-9);
  for (const int joint : {kLeftHip, kRightHip}) clip.b.joints.at(44, joint) = turned.b.joints.at(44, joint);
  EXPECT_NEAR(interaction_statistics(clip).turned_hips, 0.2 * 180.0 / std::numbers::pi, 1e-9);
  for (const int joint : {kLeftHip, kRightHip}) clip.b.joints.at(0, joint) = turned.b.joints.at(0, joint);
  EXPECT_NEAR(interaction_statistics(clip).turned_hips, 0.0, 1e-9);
}

// One ankle in four is moved, and one neck in two.
TEST(InteractionStatistics, FeetAndNecksAreThereWhereTheyAreMostly) {
  InteractionClip clip = meeting(20, 70);
  for (int t = 0; t < clip.frames(); ++t)
    for (HumanMotion* person : {&clip.a, &clip.b})
      for (const auto& [ankle, hip] : {std::pair(kLeftAnkle, kLeftHip), std::pair(kRightAnkle, kRightHip)})
        person->joints.at(t, ankle) = person->joints.at(t, hip) - Eigen::Vector3d(0.0, 0.0, 0.9);
  const InteractionStatistics before = interaction_statistics(clip);
  EXPECT_NEAR(before.feet_aside, 0.0, 1e-9);
  for (int t = 0; t < clip.frames(); ++t) {
    if (t > 5) clip.a.joints.at(t, kLeftAnkle) += Eigen::Vector3d(0.3, 0.4, 0.1);  // level; not in the first frames
    clip.b.joints.at(t, kNeck).z() += 0.1;
  }
  const InteractionStatistics after = interaction_statistics(clip);
  EXPECT_NEAR(after.feet_aside, 0.25 * 0.5, 1e-9);
  EXPECT_NEAR(after.neck_height - before.neck_height, 0.05, 1e-9);
}

TEST(InteractionStatistics, HandsTouchBelowTheirThresholdOnly) {
  InteractionClip clip = meeting(20, 70);
  for (int t = 20; t < 70; ++t) clip.b.joints.at(t, kRightHand).x() = 0.45 + kHandsTouch + 1e-9;
  const InteractionStatistics apart = interaction_statistics(clip);
  EXPECT_EQ(apart.touches, 0.0);
  EXPECT_TRUE(std::isnan(apart.touch_s));
  EXPECT_TRUE(std::isnan(apart.touch_distance));
  for (int t = 20; t < 70; ++t) clip.b.joints.at(t, kRightHand).x() -= 1e-6;
  EXPECT_EQ(interaction_statistics(clip).touches, 1.0);
}

TEST(InteractionStatistics, AHugTouchesWithAHandAtTheTrunk) {
  InteractionClip clip = meeting(0, 0);
  clip.phases = {.act_begin = 0, .act_end = 100};
  clip.task = Task::kHug;
  EXPECT_EQ(interaction_statistics(clip).touches, 0.0);
  for (int t = 10; t < 30; ++t) clip.a.joints.at(t, kLeftHand) = Eigen::Vector3d(0.8, 0.3, 1.2);
  const InteractionStatistics found = interaction_statistics(clip);
  EXPECT_DOUBLE_EQ(found.touch_s, 0.4);
  EXPECT_DOUBLE_EQ(found.right_hands, 0.0);
}

TEST(InteractionStatistics, AGestureLastsAsLongAsItsAct) {
  InteractionClip clip = meeting(20, 70);
  clip.task = Task::kWave;
  const InteractionStatistics found = interaction_statistics(clip);
  EXPECT_DOUBLE_EQ(found.touch_s, 1.0);
  EXPECT_TRUE(std::isnan(found.touch_height));
}

TEST(InteractionStatistics, WhoWalksUpDoesNotStandAndCloses) {
  InteractionClip clip = meeting(60, 90);
  for (int t = 0; t < 100; ++t) {
    const double late = std::max(0.0, 50.0 - t) / 50.0;  // 1 m in 1 s
    clip.b.joints.frame(t).row(0).array() += late;
  }
  const InteractionStatistics found = interaction_statistics(clip);
  EXPECT_NEAR(found.approach_speed, 1.0, 1e-9);
  EXPECT_DOUBLE_EQ(found.standing, 0.5);
  EXPECT_DOUBLE_EQ(found.largest_distance, 2.0);
  EXPECT_DOUBLE_EQ(found.touch_distance, 1.0);
}

TEST(InteractionStatistics, ReactionIsBetweenTheTwoSettingOut) {
  InteractionClip clip = meeting(50, 70);
  for (int t = 30; t < 50; ++t) clip.a.joints.at(t, kRightHand).x() += kSetOut + 1e-6;
  EXPECT_DOUBLE_EQ(interaction_statistics(clip).reaction_s, 0.4);
  for (int t = 30; t < 50; ++t) clip.a.joints.at(t, kRightHand).x() -= 2e-6;
  EXPECT_DOUBLE_EQ(interaction_statistics(clip).reaction_s, 0.0);
}

TEST(InteractionStatistics, RateIsThatOfTheRecording) {
  InteractionClip clip = meeting(20, 70);
  EXPECT_DOUBLE_EQ(interaction_statistics(clip).source_rate_hz, 50.0);
  clip.source["source_rate_hz"] = "15";
  EXPECT_DOUBLE_EQ(interaction_statistics(clip).source_rate_hz, 15.0);
  clip.source["source_rate_hz"] = "no number";
  EXPECT_DOUBLE_EQ(interaction_statistics(clip).source_rate_hz, 50.0);
}

// Upper arms of 0.3 m, forearms of 0.2 m, straight down.
void give_arms(HumanMotion& person) {
  for (int t = 0; t < person.frames(); ++t)
    for (const auto& [shoulder, elbow, wrist] :
         {std::array{kLeftShoulder, kLeftElbow, kLeftWrist}, std::array{kRightShoulder, kRightElbow, kRightWrist}}) {
      const Eigen::Vector3d at = person.joints.at(t, shoulder);
      person.joints.at(t, elbow) = at - Eigen::Vector3d(0.0, 0.0, 0.3);
      person.joints.at(t, wrist) = at - Eigen::Vector3d(0.0, 0.0, 0.5);
    }
}

TEST(InteractionStatistics, ArmsAreHeldAgainstTheirOwnMedian) {
  InteractionClip clip = meeting(20, 70);
  give_arms(clip.a);
  give_arms(clip.b);
  const InteractionStatistics still = interaction_statistics(clip);
  EXPECT_NEAR(still.arm_length, 0.5, 1e-12);
  EXPECT_NEAR(still.arm_change_p95, 0.0, 1e-12);
  EXPECT_EQ(still.arm_occluded, 0.0);
  for (int t = 0; t < 44; ++t) clip.a.joints.at(t, kLeftWrist).z() -= 0.1;  // half as long again
  const InteractionStatistics lost = interaction_statistics(clip);
  EXPECT_NEAR(lost.arm_change_p95, 0.5, 1e-9);  // 44 of 800 bones
  EXPECT_DOUBLE_EQ(lost.arm_occluded, 0.11);
}

TEST(InteractionStatistics, NoiseIsWhatIsLeftOfTheMiddleBetweenBeforeAndAfter) {
  InteractionClip clip = meeting(20, 70);
  for (HumanMotion* person : {&clip.a, &clip.b})
    for (int t = 0; t < 100; ++t) person->joints.frame(t).row(1).array() += 0.01 * t;
  EXPECT_NEAR(interaction_statistics(clip).noise, 0.0, 1e-12);  // who walks straight has none
  const int step = static_cast<int>(std::lround(kNoiseStep * 50.0));
  for (HumanMotion* person : {&clip.a, &clip.b})
    for (int t = 0; t < 100; ++t) person->joints.frame(t).row(0).array() += t / step % 2 == 0 ? 0.004 : -0.004;
  EXPECT_NEAR(interaction_statistics(clip).noise, 0.008, 1e-12);
}

TEST(InteractionStatistics, TooShortAClipIsRefused) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)interaction_statistics(meeting(0, 1, 2)); }));
}

TEST(InteractionStatistics, SpreadsAgreeWithinAFifth) {
  const InteractionStatisticInfo time = {"t", "T", "s", &InteractionStatistics::touch_s, false};
  const InteractionStatisticInfo share = {"s", "S", "1", &InteractionStatistics::touches, true};
  const InteractionStatisticInfo angle = {"a", "A", "deg", &InteractionStatistics::touch_bearing, false};
  std::vector<InteractionStatistics> clips(11);
  for (int i = 0; i < 11; ++i) clips[i].touch_s = i;
  clips[0].touches = 1.0;
  clips.push_back({});  // has none
  const StatisticSpread spread = spread_of(clips, time);
  EXPECT_EQ(spread.clips, 11);
  EXPECT_DOUBLE_EQ(spread.low, 0.5);
  EXPECT_DOUBLE_EQ(spread.middle, 5.0);
  EXPECT_DOUBLE_EQ(spread.high, 9.5);
  EXPECT_NEAR(spread_of(clips, share).middle, 1.0 / 12.0, 1e-12);
  EXPECT_EQ(spread_of({}, time).clips, 0);
  const auto middle = [](double value) { return StatisticSpread{1, value, value, value}; };
  EXPECT_TRUE(agree(middle(4.0), middle(5.0), time));
  EXPECT_FALSE(agree(middle(3.99), middle(5.0), time));
  EXPECT_FALSE(agree(middle(6.01), middle(5.0), time));
  EXPECT_TRUE(agree(middle(-5.9), middle(0.0), angle));
  EXPECT_FALSE(agree(middle(-6.1), middle(0.0), angle));
  EXPECT_TRUE(agree(middle(47.9), middle(40.0), angle));
  EXPECT_FALSE(agree(middle(48.1), middle(40.0), angle));
  EXPECT_TRUE(agree(middle(0.19), middle(0.0), share));
  EXPECT_FALSE(agree(middle(0.21), middle(0.0), share));
}

}  // namespace
}  // namespace duet
