#include <gtest/gtest.h>

#include "duet/metrics/detector.h"
#include "tests/metrics/acting.h"

namespace duet {
namespace {

constexpr int kFrames = 30;

// Right hands `gap` apart for the first `close` frames; the performer's is `reach` from his root at the origin.
test::Scene shake(double gap, int close, double reach = 0.5) {
  test::Scene s{test::standing({0.0, 0.0, 0.0}, 1.0, kFrames), test::standing({4.0, 0.0, 0.0}, -1.0, kFrames)};
  s.performer.rhand.leftCols(close) = test::still({reach, 0.0, 0.0}, close);
  s.partner.rhand.leftCols(close) = test::still({reach + gap, 0.0, 0.0}, close);
  return s;
}

DetectorResult judge(const test::Scene& s, const Thresholds& tau = {}, const DetectorReadings& readings = {}) {
  return detect_performer(Task::kHandshake, s.performer, s.partner, tau, readings);
}

TEST(HandshakeDetector, NeedsTenFramesOfContactAtAValidDistance) {
  EXPECT_TRUE(judge(shake(0.1, 10)).success);
  EXPECT_FALSE(judge(shake(0.1, 9)).success);
  EXPECT_FALSE(judge(shake(0.31, 20)).success);
  EXPECT_FALSE(judge(shake(0.1, 20, 0.3)).success);  // too near the own root
  EXPECT_FALSE(judge(shake(0.1, 20, 1.6)).success);  // too far
}

TEST(HandshakeDetector, BoundariesAreAsPrinted) {
  EXPECT_FALSE(judge(shake(0.25, 20), {{"contact", 0.25}}).success);  // d < contact
  EXPECT_TRUE(judge(shake(0.25, 20), {{"contact", 0.2501}}).success);
  EXPECT_TRUE(judge(shake(0.1, 20, 0.5), {{"min_dist", 0.5}}).success);  // d_root >= min_dist
  EXPECT_FALSE(judge(shake(0.1, 20, 0.5), {{"min_dist", 0.5001}}).success);
  EXPECT_TRUE(judge(shake(0.1, 20, 0.5), {{"max_dist", 0.5}}).success);  // d_root <= max_dist
  EXPECT_FALSE(judge(shake(0.1, 20, 0.5), {{"max_dist", 0.4999}}).success);
  EXPECT_FALSE(judge(shake(0.25, 20), {{"mean_contact", 0.25}}).success);  // mean < bound
  EXPECT_FALSE(judge(shake(0.25, 20), {{"std_contact", 0.0}}).success);    // 0 < 0 is false
}

TEST(HandshakeDetector, ContactMustNotBeInterrupted) {
  test::Scene s = shake(0.1, 18);
  s.partner.rhand.col(9) = Eigen::Vector3d(4.0, 0.0, 0.0);
  const DetectorResult result = judge(s);
  EXPECT_FALSE(result.success);
  EXPECT_EQ(result.values.at("valid_contact_count"), 17.0);
  EXPECT_EQ(result.values.at("max_consecutive"), 9.0);
}

TEST(HandshakeDetector, TiesTakeTheFirstOfLLLRRLRR) {
  Agent a = test::standing({0.0, 0.0, 0.0}, 1.0, 1);
  Agent b = a;
  for (Eigen::Matrix3Xd* hand : {&a.lhand, &a.rhand, &b.lhand, &b.rhand}) hand->setZero();
  EXPECT_EQ(closest_hands(a, b).performer_right[0], false);
  EXPECT_EQ(closest_hands(a, b).partner_right[0], false);
  a.lhand = test::still({5.0, 0.0, 0.0}, 1);  // RL before RR
  EXPECT_EQ(closest_hands(a, b).performer_right[0], true);
  EXPECT_EQ(closest_hands(a, b).partner_right[0], false);
  b.lhand = test::still({5.0, 3.0, 0.0}, 1);  // RR is nearest
  EXPECT_EQ(closest_hands(a, b).partner_right[0], true);
}

TEST(HandshakeDetector, DistanceReadings) {
  DetectorReadings roots;
  roots.handshake_distance = HandshakeDistance::kAgentRoots;
  test::Scene s = shake(0.1, 20);
  EXPECT_FALSE(judge(s, {}, roots).success);  // roots 4 m apart
  s.partner.root = test::still({1.0, 0.0, 0.0}, kFrames);
  EXPECT_TRUE(judge(s, {}, roots).success);
  EXPECT_EQ(judge(s, {}, roots).values.at("root_distance_max"), 1.0);
}

TEST(HandshakeDetector, ActiveHandReadings) {
  DetectorReadings partner;
  partner.handshake_active = HandshakeActive::kPartnerHand;
  const test::Scene s = shake(0.2, 20, 0.35);  // the performer's hand is too near, the partner's is not
  EXPECT_FALSE(judge(s).success);
  EXPECT_TRUE(judge(s, {}, partner).success);
}

// Popoviciu: n values in [0, 0.3) have a population deviation below 0.15 and a mean below 0.45.
TEST(HandshakeDetector, StabilityPhaseIsTrueOnceThereIsContact) {
  int contacts = 0;
  for (int seed = 0; seed < 300; ++seed) {
    Random random(seed, 7);
    test::Scene s{test::standing({0.0, 0.0, 0.0}, 1.0, kFrames), test::standing({0.0, 0.0, 0.0}, 1.0, kFrames)};
    for (Eigen::Matrix3Xd* hand : {&s.performer.lhand, &s.performer.rhand, &s.partner.lhand, &s.partner.rhand})
      for (double& x : hand->reshaped()) x = random.uniform(-1.0, 1.0);
    const DetectorResult result = judge(s);
    const bool contact = result.values.at("distance_min") < 0.3;
    contacts += contact;
    EXPECT_EQ(result.parts.at("stability_phase"), contact) << seed;
  }
  EXPECT_GT(contacts, 100);
}

TEST(HandshakeDetector, NoContactIsNotStable) {
  const DetectorResult result = judge(shake(0.5, 20));
  EXPECT_FALSE(result.parts.at("stability_phase"));
  EXPECT_EQ(result.margins.at("std_contact"), -std::numeric_limits<double>::infinity());
}

// Distances 0 and 0.2 by turns in blocks of ten: whole deviation 0.1, within a block 0.
TEST(HandshakeDetector, StabilityReadings) {
  test::Scene s = shake(0.0, kFrames);
  for (int t = 10; t < 20; ++t) s.partner.rhand.col(t) += Eigen::Vector3d(0.2, 0.0, 0.0);
  const auto std_with = [&](HandshakeStability stability) {
    DetectorReadings readings;
    readings.handshake_stability = stability;
    return judge(s, {}, readings).values.at("stability_std");
  };
  EXPECT_NEAR(std_with(HandshakeStability::kWhole), std::sqrt(2.0) / 15.0, 1e-12);  // 10 of 30 at 0.2
  EXPECT_NEAR(std_with(HandshakeStability::kRollingAll), 0.1, 1e-12);
  EXPECT_NEAR(std_with(HandshakeStability::kRollingAny), 0.0, 1e-12);
  DetectorReadings readings;
  readings.handshake_stability = HandshakeStability::kRollingAll;
  EXPECT_FALSE(judge(s, {{"std_contact", 0.0999}}, readings).success);
  EXPECT_TRUE(judge(s, {{"std_contact", 0.0999}}).success);
  readings.handshake_stability = HandshakeStability::kRollingAny;
  EXPECT_TRUE(judge(s, {{"std_contact", 0.0001}}, readings).success);
}

// One window must meet both bounds: the steady one has too large a mean, the other too large a deviation.
TEST(HandshakeDetector, RollingAnyWantsOneWindowUnderBothBounds) {
  test::Scene s = shake(0.2, kFrames);
  for (int t = 12; t < kFrames; ++t)
    s.partner.rhand.col(t) = s.performer.rhand.col(t) + Eigen::Vector3d(t % 2 == 0 ? 0.0 : 0.1, 0.0, 0.0);
  DetectorReadings any;
  any.handshake_stability = HandshakeStability::kRollingAny;
  EXPECT_FALSE(judge(s, {{"std_contact", 0.01}, {"mean_contact", 0.1}}, any).parts.at("stability_phase"));
  EXPECT_TRUE(judge(s, {{"std_contact", 0.01}, {"mean_contact", 0.21}}, any).parts.at("stability_phase"));
}

TEST(HandshakeDetector, StabilityFramesAndDdof) {
  test::Scene s = shake(0.1, 20);
  for (int t = 15; t < 20; ++t) {  // contact near the root: not valid, but d < contact
    s.performer.rhand.col(t) = Eigen::Vector3d(0.1, 0.0, 0.0);
    s.partner.rhand.col(t) = Eigen::Vector3d(0.3, 0.0, 0.0);
  }
  DetectorReadings validated;
  validated.handshake_stability_frames = StabilityFrames::kValidated;
  EXPECT_NEAR(judge(s).values.at("stability_mean"), (15 * 0.1 + 5 * 0.2) / 20, 1e-12);
  EXPECT_NEAR(judge(s, {}, validated).values.at("stability_mean"), 0.1, 1e-12);
  DetectorReadings sample;
  sample.handshake_ddof = 1;
  EXPECT_NEAR(judge(s, {}, sample).values.at("stability_std"),
              judge(s).values.at("stability_std") * std::sqrt(20.0 / 19.0), 1e-12);
  EXPECT_FALSE(judge(shake(0.1, 1), {{"min_contact", 1}}, sample).success);  // one value has no sample deviation
  EXPECT_TRUE(judge(shake(0.1, 1), {{"min_contact", 1}}).success);
}

TEST(HandshakeDetector, MarginsNameTheCulprit) {
  const DetectorResult apart = judge(shake(0.35, 20));
  EXPECT_NEAR(apart.margins.at("contact"), -0.05, 1e-12);
  const DetectorResult near = judge(shake(0.1, 20, 0.3));
  EXPECT_NEAR(near.margins.at("min_dist"), -0.1, 1e-12);
  EXPECT_GT(near.margins.at("max_dist"), 0.0);
  EXPECT_EQ(judge(shake(0.1, 7)).margins.at("min_contact"), -3.0);
}

}  // namespace
}  // namespace duet
