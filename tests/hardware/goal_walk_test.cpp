// The law of hardware/guard/goal_walk.h on a root without a gait: it lags, is late, and answers no command that its
// walker would not answer by a step. A body that steps is in walker_test.cpp.
#include "duet/hardware/guard/goal_walk.h"

#include <deque>
#include <numbers>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kDt = 0.02, kMargin = 0.15;

// A root in the plane, first order in its speeds, 0.1 s late.
class PlanarRoot {
 public:
  explicit PlanarRoot(const LeastSteps& least, const HardwareLimits& limits = {})
      : least_(least), law_(limits, least) {}

  VelocityCommand tick(const Pose& goal) {
    const VelocityCommand asked = law_.update(state, goal);
    late_.push_back(steps(asked) ? asked : VelocityCommand{});
    if (late_.size() > 5) late_.pop_front();
    const double share = kDt / 0.35;
    speed_ += share * (Eigen::Vector3d(late_.front().forward, late_.front().lateral, late_.front().yaw_rate) - speed_);
    const double yaw = yaw_of(state.X_WB.R) + kDt * speed_.z();
    state.X_WB.R = yaw_rotation(yaw);
    state.v_WB.head<2>() = Eigen::Rotation2Dd(yaw) * speed_.head<2>();
    state.X_WB.p += kDt * state.v_WB;
    return asked;
  }
  RobotState state;

 private:
  [[nodiscard]] bool steps(const VelocityCommand& asked) const {
    return std::abs(asked.forward) >= least_.forward || std::abs(asked.yaw_rate) >= least_.yaw;
  }
  LeastSteps least_;
  GoalWalk law_;
  std::deque<VelocityCommand> late_;
  Eigen::Vector3d speed_ = Eigen::Vector3d::Zero();
};

Pose pose(double x, double y, double yaw) { return {yaw_rotation(yaw), {x, y, 0.74}}; }

double turned_off(const Pose& at, const Pose& goal) {
  return std::abs(std::remainder(yaw_of(at.R) - yaw_of(goal.R), 2.0 * std::numbers::pi));
}

TEST(GoalWalk, ComesToRestAtAnyPlaceWithAnyHeadingAndNeverPastIt) {
  Random random(3, stream_key({"goal walk test"}));
  for (const LeastSteps& least : {LeastSteps{}, LeastSteps{.forward = 0.25, .yaw = 0.5}})
    for (int k = 0; k < 100; ++k) {
      const double distance = random.uniform(0.21, 1.5), direction = random.uniform(-3.14, 3.14);
      const Eigen::Vector2d way(std::cos(direction), std::sin(direction));
      const Pose goal = pose(distance * way.x(), distance * way.y(), random.uniform(-3.14, 3.14));
      PlanarRoot root(least);
      double beyond = -distance;
      VelocityCommand last;
      for (int tick = 0; tick < 50 * 60; ++tick) {
        last = root.tick(goal);
        beyond = std::max(beyond, root.state.X_WB.p.head<2>().dot(way) - distance);
      }
      EXPECT_LE((root.state.X_WB.p - goal.p).head<2>().norm(), kMargin) << k << " " << distance << " " << direction;
      EXPECT_LE(turned_off(root.state.X_WB, goal), kMargin) << k;
      EXPECT_LE(beyond, 0.0) << k << " " << distance << " " << direction;
      EXPECT_EQ(last.forward, 0.0) << k;
      EXPECT_EQ(last.yaw_rate, 0.0) << k;
    }
}

// Nothing that moves the robot is below what its walker answers, and nothing is beyond the limits.
TEST(GoalWalk, AsksForWhatIsAnsweredByAStepAndWithinTheLimits) {
  const HardwareLimits limits;
  const LeastSteps least{.forward = 0.25, .yaw = 0.5};
  PlanarRoot root(least, limits);
  const Pose goal = pose(-0.6, 0.7, 2.5);
  for (int tick = 0; tick < 50 * 40; ++tick) {
    const VelocityCommand asked = root.tick(goal);
    EXPECT_LE(asked.forward, limits.forward);
    EXPECT_GE(asked.forward, -limits.backward);
    EXPECT_LE(std::abs(asked.lateral), limits.lateral);
    EXPECT_LE(std::abs(asked.yaw_rate), limits.yaw_rate);
    const bool moves = asked.forward != 0.0 || asked.yaw_rate != 0.0;
    const bool brakes = asked.forward == -kReferenceSpeed;
    EXPECT_TRUE(!moves || brakes || asked.forward >= least.forward || std::abs(asked.yaw_rate) >= least.yaw) << tick;
  }
}

TEST(GoalWalk, TurnsBeforeItWalks) {
  PlanarRoot root({.forward = 0.25, .yaw = 0.5});
  const Pose behind = pose(-1.0, 0.1, 0.0);
  EXPECT_EQ(root.tick(behind).forward, 0.0);
  EXPECT_EQ(root.tick(behind).yaw_rate, 0.5);
}

TEST(GoalWalk, StandsForAGoalThatIsNearAndFollowsOneThatGoesOn) {
  PlanarRoot root({});
  for (const double near : {0.05, 0.14, 0.2}) EXPECT_EQ(root.tick(pose(near, 0.0, 0.05)).forward, 0.0) << near;
  Pose goal = pose(0.6, 0.0, 0.0);
  for (int tick = 0; tick < 500; ++tick) root.tick(goal);
  EXPECT_NEAR(root.state.X_WB.p.x(), 0.6, kMargin);
  goal.p.x() = 1.2;
  for (int tick = 0; tick < 500; ++tick) root.tick(goal);
  EXPECT_NEAR(root.state.X_WB.p.x(), 1.2, kMargin);
  EXPECT_LE(root.state.X_WB.p.x(), 1.2);
}

}  // namespace
}  // namespace duet
