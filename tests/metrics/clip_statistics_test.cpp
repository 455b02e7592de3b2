#include "duet/metrics/clip_statistics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "duet/motion/synthesis/synthesis.h"

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

}  // namespace
}  // namespace duet
