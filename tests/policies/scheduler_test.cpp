#include "duet/policies/scheduler.h"

#include <limits>

#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::kAlgebra;
using test::random_anchors;
using test::random_reference;
using test::thrown_message;

// Bounds that never bind.
SchedulerOptions unbounded() {
  SchedulerOptions options;
  options.max_root_speed = options.max_root_yaw_rate = 1e9;
  return options;
}

Reference at_rest(int joints) { return {{Eigen::Quaterniond::Identity(), {0, 0, 0.8}}, Eigen::VectorXd::Zero(joints)}; }

// A plan that stays at `x` with joints at `angle` and heading `yaw`.
Anchors constant_plan(double x, double angle, double yaw) {
  Anchors anchors;
  anchors.fill({{yaw_rotation(yaw), {x, 0, 0.8}}, Eigen::VectorXd::Constant(2, angle)});
  return anchors;
}

double distance(const Reference& a, const Reference& b) {
  return (a.q - b.q).norm() + (a.X_WB.p - b.X_WB.p).norm() + a.X_WB.R.angularDistance(b.X_WB.R);
}

TEST(Scheduler, HoldsTheStartUntilAPlanTakesOver) {
  Random random(1, 1);
  const Reference start = random_reference(random, 3);
  Scheduler scheduler;
  scheduler.reset(start);
  for (int tick = 0; tick < 5; ++tick) EXPECT_EQ(distance(scheduler.at(tick), start), 0.0);
  EXPECT_TRUE(scheduler.late());
  EXPECT_EQ(scheduler.late_ticks(), 5);
}

TEST(Scheduler, WeightOfTheNewPlanGrowsLinearlyFromZeroToOne) {
  for (const int fuse_ticks : {1, 5, 10, 25}) {
    SchedulerOptions options = unbounded();
    options.fuse_ticks = fuse_ticks;
    options.late_after_ticks = 50;
    Scheduler scheduler(options);
    scheduler.reset(at_rest(2));
    scheduler.push(constant_plan(0.0, 0.0, 0.0), 0);
    int tick = 0;
    for (; tick < 30; ++tick) scheduler.at(tick);
    scheduler.push(constant_plan(1.0, 2.0, 0.5), 30);
    for (; tick < 60; ++tick) {
      const double weight = std::min(1.0, (tick - 30.0) / fuse_ticks);
      const Reference& reference = scheduler.at(tick);
      EXPECT_NEAR(reference.X_WB.p.x(), weight, kAlgebra) << tick;
      EXPECT_NEAR(reference.q[1], 2.0 * weight, kAlgebra) << tick;
      EXPECT_NEAR(yaw_of(reference.X_WB.R), 0.5 * weight, kAlgebra) << tick;
    }
  }
}

TEST(Scheduler, APlanThatHasTakenOverIsTheReferenceToTheBit) {
  Random random(2, 1);
  SchedulerOptions options = unbounded();
  options.late_after_ticks = 90;
  Scheduler scheduler(options);
  scheduler.reset(random_reference(random, 29));
  const Anchors anchors = random_anchors(random, 29);
  const std::vector<Reference> dense = densify(anchors);
  scheduler.push(anchors, 0);
  for (int tick = 0; tick < 90; ++tick) {
    const Reference& reference = scheduler.at(tick);
    if (tick < options.fuse_ticks) continue;
    EXPECT_EQ(reference.q, dense[static_cast<std::size_t>(tick)].q);
    EXPECT_EQ(reference.X_WB.p, dense[static_cast<std::size_t>(tick)].X_WB.p);
    EXPECT_EQ(reference.X_WB.R.coeffs(), dense[static_cast<std::size_t>(tick)].X_WB.R.coeffs());
  }
}

// Joints are in [-1, 1]: a plan moves by at most 2 / 25 a tick, and a change of plan adds at most 2 / fuse_ticks.
TEST(Scheduler, JointsNeverJumpWhateverThePlansAndWheneverTheyCome) {
  Random random(3, 1);
  for (const int fuse_ticks : {2, 10, 37}) {
    SchedulerOptions options = unbounded();
    options.fuse_ticks = fuse_ticks;
    const double bound = 2.0 / 25 + 2.0 / fuse_ticks + kAlgebra;
    Scheduler scheduler(options);
    Reference before = random_reference(random, 29);
    scheduler.reset(before);
    int last_plan = -1;
    for (int tick = 0; tick < 600; ++tick) {
      const int made = tick - random.below(4);  // plans come irregularly, some late, and with latency
      if (random.chance(0.1) && made > last_plan) scheduler.push(random_anchors(random, 29), last_plan = made);
      const Reference& now = scheduler.at(tick);
      ASSERT_LE((now.q - before.q).cwiseAbs().maxCoeff(), bound) << tick;
      before = now;
    }
    EXPECT_GT(scheduler.late_ticks(), 0);
  }
}

TEST(Scheduler, RootNeverExceedsItsBounds) {
  Random random(4, 1);
  SchedulerOptions options;
  options.max_root_speed = 0.7;
  options.max_root_yaw_rate = 0.9;
  Scheduler scheduler(options);
  Reference before = random_reference(random, 1);
  scheduler.reset(before);
  for (int tick = 0; tick < 500; ++tick) {
    if (tick % kTicksPerPlan == 0) scheduler.push(random_anchors(random, 1), tick);
    const Reference& now = scheduler.at(tick);
    ASSERT_LE((now.X_WB.p - before.X_WB.p).norm(), 0.7 / 50 + kAlgebra);
    const double turn = std::remainder(yaw_of(now.X_WB.R) - yaw_of(before.X_WB.R), 2.0 * std::numbers::pi);
    ASSERT_LE(std::abs(turn), 0.9 / 50 + kAlgebra);
    ASSERT_NEAR(now.X_WB.R.norm(), 1.0, kAlgebra);
    before = now;
  }
}

TEST(Scheduler, BoundedRootReachesItsTargetAndKeepsTheTilt) {
  Scheduler scheduler;  // 1.5 m/s, 2 rad/s
  scheduler.reset(at_rest(2));
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()));
  Anchors anchors = constant_plan(1.5, 0.0, 2.0);
  for (Reference& anchor : anchors) anchor.X_WB.R = yaw_rotation(2.0) * tilt;
  for (int tick = 0; tick < 60; ++tick) {
    if (tick % kTicksPerPlan == 0) scheduler.push(anchors, tick);
    const Reference& reference = scheduler.at(tick);
    if (tick == 30) {
      EXPECT_NEAR(reference.X_WB.p.x(), 1.5 * 30 / 50, kAlgebra);
      const Eigen::Vector3d up = reference.X_WB.R * Eigen::Vector3d::UnitZ();
      EXPECT_NEAR(std::acos(up.z()), 0.3, 1e-7);
      EXPECT_LT(yaw_of(reference.X_WB.R), 2.0 * 30 / 50 + kAlgebra);
    }
  }
  EXPECT_NEAR(scheduler.at(60).X_WB.p.x(), 1.5, kAlgebra);
  EXPECT_NEAR(yaw_of(scheduler.at(61).X_WB.R), 2.0, kAlgebra);
}

TEST(Scheduler, TurnsTheShortWayAcrossPi) {
  Scheduler scheduler;
  Reference start = at_rest(2);
  start.X_WB.R = yaw_rotation(3.0);
  scheduler.reset(start);
  double travelled = 0.0, before = 3.0;
  for (int tick = 0; tick < 50; ++tick) {
    if (tick % kTicksPerPlan == 0) scheduler.push(constant_plan(0.0, 0.0, -3.0), tick);
    const double yaw = yaw_of(scheduler.at(tick).X_WB.R);
    travelled += std::remainder(yaw - before, 2.0 * std::numbers::pi);
    before = yaw;
  }
  EXPECT_NEAR(travelled, 2.0 * std::numbers::pi - 6.0, kAlgebra);
}

TEST(SchedulerLate, HoldsTheLastReferenceToTheBit) {
  Random random(5, 1);
  Scheduler scheduler;
  scheduler.reset(random_reference(random, 29));
  scheduler.push(random_anchors(random, 29), 0);
  Reference last;
  for (int tick = 0; tick < kTicksPerPlan; ++tick) {
    last = scheduler.at(tick);
    EXPECT_FALSE(scheduler.late());
  }
  for (int tick = kTicksPerPlan; tick < 200; ++tick) {
    EXPECT_EQ(distance(scheduler.at(tick), last), 0.0);
    EXPECT_TRUE(scheduler.late());
  }
  EXPECT_EQ(scheduler.late_ticks(), 190);
}

TEST(SchedulerLate, GraceIsAnOption) {
  Random random(6, 1);
  SchedulerOptions options;
  options.late_after_ticks = 13;
  Scheduler scheduler(options);
  scheduler.reset(random_reference(random, 2));
  scheduler.push(random_anchors(random, 2), 0);
  for (int tick = 0; tick < 20; ++tick) {
    scheduler.at(tick);
    EXPECT_EQ(scheduler.late(), tick >= 13) << tick;
  }
}

// A target far away, so that the bound is what moves the root: 0.3 of it until the new plan has taken over.
TEST(SchedulerLate, TightensTheRootsBoundsUntilTheNextPlanHasTakenOver) {
  Scheduler scheduler;
  scheduler.reset(at_rest(2));
  scheduler.push(constant_plan(0.0, 0.0, 0.0), 0);
  int tick = 0;
  for (; tick < 20; ++tick) scheduler.at(tick);
  EXPECT_TRUE(scheduler.late());
  scheduler.push(constant_plan(100.0, 0.0, 3.0), tick);
  double x = 0.0, yaw = 0.0;
  for (int age = 0; age < 30; ++age, ++tick) {
    if (age > 0 && age % kTicksPerPlan == 0) scheduler.push(constant_plan(100.0, 0.0, 3.0), tick);
    const Reference& reference = scheduler.at(tick);
    const double factor = age == 0 ? 0.0 : age < kTicksPerPlan ? 0.3 : 1.0;  // age 0: weight 0, still held
    EXPECT_NEAR(reference.X_WB.p.x() - x, factor * 1.5 / 50, kAlgebra) << age;
    EXPECT_NEAR(yaw_of(reference.X_WB.R) - yaw, factor * 2.0 / 50, kAlgebra) << age;
    x = reference.X_WB.p.x(), yaw = yaw_of(reference.X_WB.R);
  }
}

TEST(SchedulerLate, ReturnsWithoutAJump) {
  Random random(7, 1);
  Scheduler scheduler(unbounded());
  scheduler.reset(random_reference(random, 29));
  scheduler.push(random_anchors(random, 29), 0);
  Reference held;
  int tick = 0;
  for (; tick < 40; ++tick) held = scheduler.at(tick);
  scheduler.push(random_anchors(random, 29), tick);
  EXPECT_NEAR(distance(scheduler.at(tick), held), 0.0, 1e-7);
  EXPECT_FALSE(scheduler.late());
}

TEST(SchedulerLate, APlanWithLatencyTakesOverWhenItComes) {
  Scheduler scheduler(unbounded());
  scheduler.reset(at_rest(2));
  scheduler.push(constant_plan(0.0, 0.0, 0.0), 0);
  for (int tick = 0; tick < 8; ++tick) scheduler.at(tick);
  scheduler.push(constant_plan(0.0, 1.0, 0.0), 4);
  for (int tick = 8; tick < 14; ++tick) EXPECT_NEAR(scheduler.at(tick).q[0], (tick - 8) / 10.0, kAlgebra);
  scheduler.at(14);
  EXPECT_TRUE(scheduler.late());  // made at 4
}

TEST(Scheduler, ResetForgetsEverything) {
  Random random(8, 1);
  const Reference start = random_reference(random, 2);
  Scheduler scheduler;
  scheduler.reset(at_rest(2));
  scheduler.push(constant_plan(1.0, 1.0, 1.0), 50);
  for (int tick = 50; tick < 80; ++tick) scheduler.at(tick);
  scheduler.reset(start);
  EXPECT_EQ(scheduler.late_ticks(), 0);
  EXPECT_FALSE(scheduler.late());
  EXPECT_EQ(distance(scheduler.at(0), start), 0.0);
}

TEST(Scheduler, RefusesMisuse) {
  const auto message = [](const auto& action) {
    Scheduler scheduler;
    return thrown_message<std::invalid_argument>([&] { action(scheduler); });
  };
  const Anchors plan = constant_plan(0, 0, 0);
  EXPECT_SENTENCE(message([](Scheduler& s) { s.at(0); }));
  EXPECT_SENTENCE(message([&](Scheduler& s) { s.push(plan, 0); }));
  EXPECT_SENTENCE(message([](Scheduler& s) { s.reset(at_rest(2)), s.at(3), s.at(3); }));
  EXPECT_SENTENCE(message([](Scheduler& s) { s.reset(at_rest(2)), s.at(3), s.at(5); }));
  EXPECT_SENTENCE(message([&](Scheduler& s) { s.reset(at_rest(2)), s.push(plan, 7), s.at(6); }));
  EXPECT_SENTENCE(message([&](Scheduler& s) { s.reset(at_rest(2)), s.push(plan, 5), s.push(plan, 5); }));
  EXPECT_SENTENCE(message([&](Scheduler& s) { s.reset(at_rest(2)), s.at(5), s.push(plan, 7); }));
  EXPECT_SENTENCE(message([&](Scheduler& s) { s.reset(at_rest(3)), s.push(plan, 0); }));
}

TEST(Scheduler, RefusesAPlanWithoutReferences) {
  Scheduler scheduler;
  scheduler.reset(at_rest(2));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { scheduler.push(std::vector<Reference>{}, 0); }));
}

TEST(Scheduler, RefusesReferencesThatAreNotFiniteOrNotUnit) {
  Scheduler scheduler;
  scheduler.reset(at_rest(2));
  Anchors anchors = constant_plan(0, 0, 0);
  anchors[3].q[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { scheduler.push(anchors, 0); }));
  anchors = constant_plan(0, 0, 0);
  anchors[4].X_WB.R.coeffs() *= 2.0;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { scheduler.push(anchors, 0); }));
  Reference start = at_rest(2);
  start.X_WB.p.x() = std::numeric_limits<double>::infinity();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { scheduler.reset(start); }));
}

TEST(Scheduler, RefusesOptionsOutOfRange) {
  const auto message = [](const auto& change) {
    SchedulerOptions options;
    change(options);
    return thrown_message<std::invalid_argument>([&] { Scheduler scheduler(options); });
  };
  EXPECT_SENTENCE(message([](auto& o) { o.fuse_ticks = 0; }));
  EXPECT_SENTENCE(message([](auto& o) { o.fuse_ticks = 91; }));
  EXPECT_SENTENCE(message([](auto& o) { o.late_after_ticks = 0; }));
  EXPECT_SENTENCE(message([](auto& o) { o.max_root_speed = 0; }));
  EXPECT_SENTENCE(message([](auto& o) { o.max_root_speed = std::nan(""); }));
  EXPECT_SENTENCE(message([](auto& o) { o.max_root_yaw_rate = -1; }));
  EXPECT_SENTENCE(message([](auto& o) { o.late_factor = 0; }));
  EXPECT_SENTENCE(message([](auto& o) { o.late_factor = 1.5; }));
}

TEST(Densify, GivesAHundredReferencesOnTheGrid) {
  Random random(1, 1);
  EXPECT_EQ(densify(random_anchors(random, 29)).size(), 100u);
}

TEST(Densify, MeetsTheFirstFourAnchorsToTheBit) {
  Random random(1, 1);
  const Anchors anchors = random_anchors(random, 29);
  const std::vector<Reference> dense = densify(anchors);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(dense[25 * i].q, anchors[i].q);
    EXPECT_EQ(dense[25 * i].X_WB.p, anchors[i].X_WB.p);
    EXPECT_EQ(dense[25 * i].X_WB.R.coeffs(), anchors[i].X_WB.R.coeffs());
  }
}

TEST(Densify, HeadsForTheLastAnchorWhichTheGridDoesNotReach) {
  Random random(1, 1);
  const Anchors anchors = random_anchors(random, 5);
  const Reference last = densify(anchors).back();  // 1.98 s: 24/25 of the way
  EXPECT_NEAR((last.q - (anchors[3].q + 0.96 * (anchors[4].q - anchors[3].q))).norm(), 0.0, kAlgebra);
}

TEST(Densify, IsLinearInPositionsAndJointsAndTurnsEvenlyBetweenAnchors) {
  Random random(2, 1);
  const std::vector<Reference> dense = densify(random_anchors(random, 7));
  for (std::size_t i = 1; i + 1 < dense.size(); ++i) {
    if (i % 25 == 0) continue;  // a kink is allowed at an anchor
    EXPECT_NEAR((dense[i - 1].q - 2.0 * dense[i].q + dense[i + 1].q).norm(), 0.0, kAlgebra);
    EXPECT_NEAR((dense[i - 1].X_WB.p - 2.0 * dense[i].X_WB.p + dense[i + 1].X_WB.p).norm(), 0.0, kAlgebra);
    const Eigen::Quaterniond before = dense[i - 1].X_WB.R.conjugate() * dense[i].X_WB.R;
    const Eigen::Quaterniond after = dense[i].X_WB.R.conjugate() * dense[i + 1].X_WB.R;
    EXPECT_NEAR(before.angularDistance(after), 0.0, 1e-7);  // arccos near 1: sqrt(epsilon)
  }
}

TEST(Densify, TurnsOverTheShorterArc) {
  Random random(3, 1);
  Anchors anchors = random_anchors(random, 1);
  for (Reference& anchor : anchors) anchor.X_WB.R = Eigen::Quaterniond::Identity();
  anchors[1].X_WB.R = Eigen::Quaterniond(-yaw_rotation(1.0).coeffs());  // the same rotation, the other sign
  const std::vector<Reference> dense = densify(anchors);
  for (int i = 0; i <= 25; ++i) EXPECT_NEAR(yaw_of(dense[static_cast<std::size_t>(i)].X_WB.R), i / 25.0, kAlgebra);
}

}  // namespace
}  // namespace duet
