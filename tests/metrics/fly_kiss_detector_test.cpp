#include <gtest/gtest.h>

#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr int kFrames = 20;

// The right hand is `gap` from the head until frame 5, then moves along +x by `step` for `steps` frames.
test::Scene kiss(double gap, double step, int steps) {
  test::Scene s{test::standing({0.0, 0.0, 1.0}, 1.0, kFrames), test::standing({3.0, 0.0, 1.0}, -1.0, kFrames)};
  s.performer.head = test::still({0.0, 0.0, 1.5}, kFrames);
  s.performer.rhand = test::still({0.0, -gap, 1.5}, kFrames);
  for (int t = 6; t < kFrames; ++t) s.performer.rhand(0, t) = step * std::min(t - 5, steps);
  return s;
}

DetectorResult judge(const test::Scene& s, const Thresholds& tau = {}, const DetectorReadings& readings = {}) {
  return detect_performer(Task::kFlyKiss, s.performer, s.partner, tau, readings);
}

TEST(FlyKissDetector, NeedsTheHandAtTheHeadAndAForwardMotion) {
  EXPECT_TRUE(judge(kiss(0.2, 0.03, 6)).success);
  EXPECT_FALSE(judge(kiss(0.31, 0.03, 6)).success);  // not at the head
  EXPECT_FALSE(judge(kiss(0.2, 0.05, 4)).success);   // four frames
  EXPECT_FALSE(judge(kiss(0.2, 0.01, 6)).success);   // 6 cm
  EXPECT_FALSE(judge(kiss(0.2, -0.03, 6)).success);  // backwards
}

TEST(FlyKissDetector, MarginsAreWhatIsLeftOfEachThreshold) {
  const DetectorResult result = judge(kiss(0.25, 0.03125, 8), {{"hand2head", 0.5}, {"forward_thresh", 0.125}});
  EXPECT_NEAR(result.margins.at("hand2head"), 0.25, 1e-12);
  EXPECT_NEAR(result.margins.at("forward_thresh"), 0.125, 1e-12);
  EXPECT_EQ(result.margins.at("min_forward"), result.values.at("consecutive_forward") - 5.0);
}

TEST(FlyKissDetector, BoundariesAreIncluded) {
  EXPECT_TRUE(judge(kiss(0.25, 0.03125, 8), {{"hand2head", 0.25}}).success);
  EXPECT_FALSE(judge(kiss(0.25, 0.03125, 8), {{"hand2head", 0.2499}}).success);
  EXPECT_TRUE(judge(kiss(0.2, 0.03125, 8), {{"forward_thresh", 0.25}}).success);
  EXPECT_FALSE(judge(kiss(0.2, 0.03125, 8), {{"forward_thresh", 0.2501}}).success);
  EXPECT_TRUE(judge(kiss(0.2, 0.03125, 8), {{"min_forward", 8}}).success);
  EXPECT_FALSE(judge(kiss(0.2, 0.03125, 8), {{"min_forward", 9}}).success);
}

TEST(FlyKissDetector, TheNearerHandIsActiveAndTiesGoLeft) {
  test::Scene s = kiss(0.2, 0.03, 6);
  s.performer.lhand = test::still({0.0, 0.1, 1.5}, kFrames);  // nearer and still
  EXPECT_FALSE(judge(s).success);
  s.performer.lhand = test::still({0.0, 0.2, 1.5}, kFrames);
  EXPECT_FALSE(judge(s).success);
  s.performer.lhand = test::still({0.0, 0.21, 1.5}, kFrames);
  EXPECT_TRUE(judge(s).success);
}

TEST(FlyKissDetector, CoincidentRootsHaveNoForward) {
  test::Scene s = kiss(0.2, 0.03, 6);
  s.partner.root = s.performer.root;
  const DetectorResult result = judge(s);
  EXPECT_TRUE(result.parts.at("condition_A"));
  EXPECT_FALSE(result.parts.at("condition_B"));
  EXPECT_EQ(result.values.at("total_forward_motion"), 0.0);
}

TEST(FlyKissDetector, OrderReadings) {
  DetectorReadings closest, first;
  closest.fly_kiss_order = FlyKissOrder::kAfterClosest;
  first.fly_kiss_order = FlyKissOrder::kAfterFirstClose;
  test::Scene s = kiss(0.2, 0.03, 6);
  EXPECT_TRUE(judge(s, {}, closest).success);
  EXPECT_TRUE(judge(s, {}, first).success);

  // Time reversed and moving forward before it is at the head: only the printed reading accepts it.
  test::Scene before = kiss(0.2, -0.06, 6);
  before.performer = test::reversed(before.performer);
  EXPECT_TRUE(judge(before).success);
  EXPECT_FALSE(judge(before, {}, closest).success);
  // It comes within 0.3 m of the head during the last four steps only.
  EXPECT_FALSE(judge(before, {}, first).success);
  EXPECT_TRUE(judge(before, {{"min_forward", 3}}, first).success);

  // Never near the head: nothing counts.
  EXPECT_EQ(judge(kiss(0.4, 0.03, 6), {}, first).values.at("total_forward_motion"), 0.0);
}

TEST(FlyKissDetector, DirectionReadings) {
  test::Scene s = kiss(0.2, 0.03, 6);
  s.partner.root = test::still({3.0, 0.0, 5.0}, kFrames);  // direction (0.6, 0, 0.8)
  DetectorReadings horizontal;
  horizontal.fly_kiss_dir = FlyKissDirection::kHorizontal;
  EXPECT_NEAR(judge(s).values.at("total_forward_motion"), 0.6 * 0.18, 1e-12);
  EXPECT_NEAR(judge(s, {}, horizontal).values.at("total_forward_motion"), 0.18, 1e-12);
}

TEST(FlyKissDetector, FrameReadings) {
  DetectorReadings root;
  root.fly_kiss_frame = MotionFrame::kRoot;
  test::Scene s = kiss(0.2, 0.0, 0);
  for (int t = 0; t < kFrames; ++t) {  // walks forward with the hand at the head
    for (Eigen::Matrix3Xd* track : {&s.performer.root, &s.performer.head, &s.performer.rhand, &s.performer.lhand})
      (*track)(0, t) += 0.03 * t;
  }
  EXPECT_TRUE(judge(s).success);
  EXPECT_FALSE(judge(s, {}, root).success);
  EXPECT_NEAR(judge(s, {}, root).values.at("total_forward_motion"), 0.0, 1e-12);
}

TEST(FlyKissDetector, EvidenceIsTheHandAtTheHeadAndForwardSteps) {
  const DetectorResult result = judge(kiss(0.2, 0.2, 3));
  for (int t = 0; t < kFrames; ++t) EXPECT_EQ(result.frames[t], t <= 8) << t;
}

}  // namespace
}  // namespace duet
