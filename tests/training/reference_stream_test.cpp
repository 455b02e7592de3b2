#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "duet/rollout/reference_source.h"
#include "duet/training/wbc_task.h"
#include "tests/support.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

using test::g1;

TEST(ReferenceStream, IsSmoothAndWithinTheLimits) {
  ReferenceStream stream(g1(), wbc_stage("walk").stream);
  Random random(3, 3);
  for (int episode = 0; episode < 10; ++episode) {
    stream.reset(random);
    Reference before = stream.reference();
    for (int t = 0; t < 500; ++t) {
      stream.advance(random);
      const Reference& now = stream.reference();
      EXPECT_LT((now.X_WB.p - before.X_WB.p).norm(), 0.02 * 0.6);
      EXPECT_LT((now.q - before.q).cwiseAbs().maxCoeff(), 0.02 * 10.0);
      EXPECT_TRUE((now.q.array() <= g1()->upper().array() + 1e-12).all());
      EXPECT_TRUE((now.q.array() >= g1()->lower().array() - 1e-12).all());
      before = now;
    }
  }
}

// Backwards it goes at most at 0.55 of the highest speed.
TEST(ReferenceStream, GoesForwardsFasterThanBackwards) {
  const StreamOptions options = wbc_stage("walk").stream;
  ReferenceStream stream(g1(), options);
  Random random(5, 3);
  double fastest = 0.0, slowest = 0.0;
  for (int episode = 0; episode < 60; ++episode) {
    stream.reset(random);
    Pose before = stream.reference().X_WB;
    for (int t = 0; t < 500; ++t) {
      stream.advance(random);
      const Pose& now = stream.reference().X_WB;
      const double forward = (yaw_rotation(yaw_of(before.R)).inverse() * (now.p - before.p)).x() / 0.02;
      fastest = std::max(fastest, forward);
      slowest = std::min(slowest, forward);
      before = now;
    }
  }
  EXPECT_NEAR(fastest, options.max_speed, 0.05 * options.max_speed);
  EXPECT_LT(slowest, -0.3 * options.max_speed);
  EXPECT_GT(slowest, -0.61 * options.max_speed);  // 0.6: sideways at an angle
}

TEST(ReferenceStream, TheSameGeneratorGivesTheSameReferences) {
  ReferenceStream a(g1(), wbc_stage("walk").stream), b(g1(), wbc_stage("walk").stream);
  Random ra(3, 3), rb(3, 3);
  a.reset(ra);
  b.reset(rb);
  for (int t = 0; t < 300; ++t) {
    a.advance(ra);
    b.advance(rb);
    ASSERT_EQ(a.reference().q, b.reference().q);
    ASSERT_EQ(a.reference().X_WB.p, b.reference().X_WB.p);
  }
}

TEST(ReferenceStream, AScriptMovesTheRootByVelocityTimesTime) {
  StreamOptions options;
  options.script = ScriptedCommand{.velocity = {0.3, 0.1, 0.0}, .begin = 1.0, .end = 7.0};
  ReferenceStream stream(g1(), options);
  Random random(3, 3);
  stream.reset(random);
  for (int t = 0; t < 500; ++t) stream.advance(random);
  EXPECT_NEAR(stream.reference().X_WB.p.x(), 1.8, 1e-9);
  EXPECT_NEAR(stream.reference().X_WB.p.y(), 0.6, 1e-9);
}

TEST(ReferenceStream, AnUpperBodyThatIsHeldGoesToOnePoseAndStays) {
  StreamOptions options;
  options.moves_upper_body = false;
  options.holds_upper_body = options.from_neutral = true;
  ReferenceStream stream(g1(), options);
  Random random(3, 3);
  Eigen::VectorXd last = g1()->neutral;
  for (int episode = 0; episode < 20; ++episode) {
    stream.reset(random);
    for (int t = 0; t < 100; ++t) stream.advance(random);  // a pose is reached within 2 s
    const Eigen::VectorXd held = stream.reference().q;
    EXPECT_GT((held - g1()->neutral).norm(), 0.1) << episode;  // never the neutral one
    EXPECT_GT((held - last).norm(), 0.1) << episode;
    for (int t = 0; t < 400; ++t) stream.advance(random);
    EXPECT_EQ(stream.reference().q, held) << episode;
    last = held;
  }
}

TEST(ReferenceStream, EveryDirectionIsCommandedInTraining) {
  ReferenceStream stream(g1(), wbc_stage("walk").stream);
  Random random(3, 3);
  int left = 0, right = 0, back = 0, forward = 0, turn = 0, still = 0;
  stream.reset(random);
  for (int t = 0; t < 200000; ++t) {
    stream.advance(random);
    const Eigen::Vector3d& v = stream.command();
    left += v.y() > 0.05 ? 1 : 0;
    right += v.y() < -0.05 ? 1 : 0;
    forward += v.x() > 0.05 ? 1 : 0;
    back += v.x() < -0.05 ? 1 : 0;
    turn += std::abs(v.z()) > 0.05 ? 1 : 0;
    still += v.norm() == 0.0 ? 1 : 0;
  }
  for (const int ticks : {left, right, back, forward, turn, still}) EXPECT_GT(ticks, 10000);
}

TEST(ReferenceStream, AMotionBeginsAtTheOriginWhateverItsPlace) {
  RobotMotion motion;
  motion.rate_hz = 50.0;
  motion.joint_names = g1()->joint_names();
  motion.q = g1()->neutral.replicate(1, 400);
  for (int t = 0; t < 400; ++t) motion.root.push_back({yaw_rotation(1.0), {5.0 + 0.004 * t, -3.0, 0.75}});
  StreamOptions options;
  options.motions = 1.0;
  options.data = std::make_shared<const std::vector<RobotMotion>>(1, motion);
  ReferenceStream stream(g1(), options);
  Random random(3, 3);
  stream.reset(random);
  EXPECT_LT(stream.reference().X_WB.p.head<2>().norm(), 1e-9);
  EXPECT_NEAR(yaw_of(stream.reference().X_WB.R), 0.0, 1e-9);
}

TEST(ReferenceStream, OptionsOutOfRangeAreRefusedByName) {
  StreamOptions options;
  options.moving = 1.5;
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { ReferenceStream(g1(), options); }));
  options.moving = 0.5;
  options.motions = 0.5;
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { ReferenceStream(g1(), options); }));
}

// A robot other than the one that was trained: what is asked for and its card lacks is said, the rest works.
TEST(ReferenceStream, AsksTheCardForRangesAndBounds) {
  auto bare = *load_shared_robot("t1");
  bare.roles.pose_ranges.clear();
  const auto t1 = std::make_shared<const RobotModel>(std::move(bare));
  const auto refusal = [&](const StreamOptions& asked) {
    return test::thrown_message<std::invalid_argument>([&] { const ReferenceStream refused(t1, asked); });
  };
  StreamOptions options;
  EXPECT_SENTENCE(refusal(options));
  options.moves_upper_body = false;
  Random random(1, 1);
  ReferenceStream stream(t1, options);
  stream.reset(random);
  EXPECT_EQ(stream.reference().q, t1->neutral);
  options.crouch = 0.5;
  EXPECT_SENTENCE(refusal(options));
}

}  // namespace
}  // namespace duet
