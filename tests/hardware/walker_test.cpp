// A walking controller in the guard, the twin's body in an engine: the whole loop but for the wire between them.
#include "duet/hardware/guard/walker.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <deque>
#include <numbers>
#include <set>

#include "duet/core/numbers.h"
#include "duet/core/robot_state.h"
#include "duet/hardware/episodes/guarded_episode.h"
#include "duet/hardware/episodes/hold_trial.h"
#include "duet/hardware/episodes/walk_trial.h"
#include "duet/hardware/guard/goal_walk.h"
#include "duet/hardware/twin/lock_step.h"
#include "tests/backends/engine_names.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

ControllerOptions homie_options() { return {{"network", test::shared_file("models/homie_deploy.onnx")}}; }

TEST(Walker, RefusesAControllerThatDoesNotWalkAndOneThatIsNotKnown) {
  const auto refusal = [](const char* name) {
    return test::thrown_message<std::invalid_argument>([&] { Walker(name, {}, test::g1()); });
  };
  EXPECT_SENTENCE(refusal("pd"));
  EXPECT_SENTENCE(refusal("homy"));
}

TEST(Walker, ItsTargetsAreInsideTheJointsLimits) {
  Walker walker("wbc_sim", {}, test::g1());
  RobotState state = test::g1()->standing_state();
  walker.begin(state);
  Eigen::VectorXd arms = test::g1()->neutral;
  for (int tick = 0; tick < 50; ++tick) {
    state.q.array() += 0.02;
    const JointCommand& command = walker.update(state, {0.25, 0.15, 0.5, 0.74}, arms);
    for (int j = 0; j < test::g1()->dof(); ++j) {
      EXPECT_GE(command.q_target[j], test::g1()->joints[j].lower) << j;
      EXPECT_LE(command.q_target[j], test::g1()->joints[j].upper) << j;
    }
  }
}

// A robot that is held back is led from where it is, wherever on the floor that may be.
TEST(Walker, LeadsFromWhereTheRobotIs) {
  const auto last_targets = [](double x, double y) {
    Walker walker("wbc_sim", {}, test::g1());
    RobotState state = test::g1()->standing_state();
    state.X_WB.p.head<2>() += Eigen::Vector2d(x, y);
    walker.begin(state);
    JointCommand command;
    for (int tick = 0; tick < 100; ++tick)  // 0.6 m, of which it may be led by a quarter
      command = walker.update(state, {0.29, 0.05, 0.0, 0.74}, test::g1()->neutral);
    return command.q_target;
  };
  EXPECT_LT((last_targets(5.0, -3.0) - last_targets(0.0, 0.0)).norm(), 1e-4);
}

// Stands, and from 1 s on wants to be `goal` ahead; everything between controller and body passes guard and limiter.
class Ahead final : public ReferenceSource {
 public:
  explicit Ahead(double goal) : goal_(goal) {}
  void begin(const RobotState& start) override { reference_ = {start.X_WB, start.q}; }
  const Reference* at(const TickView& present) override {
    if (present.tick == 50) reference_.X_WB.p.x() += goal_;
    return &reference_;
  }

 private:
  double goal_;
  Reference reference_;
};

// `causes`: of the guard's changes of state, where somebody asks.
Rollout walk(const std::string& controller, const ControllerOptions& options, double goal,
             std::set<StopCause>* causes = nullptr) {
  auto walker = std::make_unique<Walker>(controller, options, test::g1());
  GuardedEpisode guarded;
  guarded.joints = test::arms_of(*test::g1()).joints;
  guarded.least_steps = walker->least_steps();
  guarded.watch = [causes](const GuardReport& report) {
    if (causes != nullptr) causes->insert(report.cause);
  };
  TwinInProcess twin(test::twin_guard(), {.engine = "mujoco"}, std::move(walker), nullptr);
  GuardedWorld world(guarded, test::g1(), twin);
  Episode episode;
  episode.start = test::g1()->standing_state();
  episode.ticks = ticks_of(6.0);
  episode.fall = test::g1()->fall;
  Ahead ahead(goal);
  Rollout rollout = roll_out(episode, world, ahead, "twin");
  EXPECT_EQ(twin.twin().refused_frames(), 0);
  EXPECT_EQ(twin.twin().physics()->hanging(), 0.0) << "the rope holds it";
  return rollout;
}

double gone(const Rollout& rollout) {
  return rollout.recording.robot.back().X_WB.p.x() - rollout.recording.robot.front().X_WB.p.x();
}

TEST(Walker, HomieWalksTheTwinBehindTheGuard) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  if (test::shared_file("models/homie_deploy.onnx").empty()) GTEST_SKIP() << "not run: homie_deploy.onnx absent";
  const Rollout rollout = walk("homie", homie_options(), 0.6);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk) << rollout.recording.message;
  EXPECT_GT(gone(rollout), 0.3);
  EXPECT_LT(gone(rollout), 0.75);
  EXPECT_GT(rollout.recording.robot.back().X_WB.p.z(), 0.65);
}

TEST(Walker, WbcSimStandsTheTwinBehindTheGuard) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const Rollout rollout = walk("wbc_sim", {}, 0.0);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk) << rollout.recording.message;
  EXPECT_LT(std::abs(gone(rollout)), 0.2);
  EXPECT_GT(rollout.recording.robot.back().X_WB.p.z(), 0.65);
}

// In a step its ankles are faster than 10 rad/s, which only an arm's joints may not be.
TEST(Walker, WbcSimWalksTheTwinBehindTheGuard) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  std::set<StopCause> causes;
  const Rollout rollout = walk("wbc_sim", {}, 0.6, &causes);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk) << rollout.recording.message;
  EXPECT_FALSE(causes.contains(StopCause::kJointSpeed));
  EXPECT_GT(gone(rollout), 0.3);
  EXPECT_FALSE(has_fallen(rollout.recording.robot.back(), test::g1()->fall));
}

// How far the arms of a twin that stands, both stretched out ahead, come to rest below what they are sent [rad].
double arms_sag(bool arm_gravity, double* carried = nullptr) {
  GuardSetup setup = test::twin_guard();
  setup.arm_gravity = arm_gravity;
  TwinInProcess twin(setup, {.engine = "mujoco"}, std::make_unique<Walker>("wbc_sim", ControllerOptions{}, test::g1()),
                     nullptr);
  PlannerMessage plan;
  plan.command.q = test::g1()->neutral;
  plan.command.root.height = HardwareLimits{}.height;
  for (const std::vector<int>& arm : test::g1()->roles.arms) {
    plan.command.q[arm[0]] = -0.9;
    plan.command.q[arm[3]] = 0.9;
  }
  GuardReport report;
  double on_rope = 1.0;
  while (twin.twin().time() < 16.0) {
    ++plan.sequence;
    plan.command.stamp = twin.twin().time();
    twin.send(plan);
    twin.next(report);
    const double now = twin.guard().status().input.health.carried;
    if (report.state <= SafetyState::kReady && !std::isnan(now)) on_rope = now;
  }
  EXPECT_EQ(report.state, SafetyState::kRun);
  if (carried != nullptr) {
    carried[0] = on_rope;
    carried[1] = twin.guard().status().input.health.carried;
  }
  double sag = 0.0;
  for (const std::vector<int>& arm : test::g1()->roles.arms)
    for (const int joint : arm)
      sag = std::max(sag, std::abs(twin.twin().q()[joint] - twin.guard().joints().q_target[joint]));
  return sag;
}

TEST(Walker, TheWeightOfTheArmsIsFedForwardAndItsFeetAreWeighed) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  double carried[2] = {};
  const double with = arms_sag(true, carried), without = arms_sag(false);
  fmt::print(
      "arms stretched out sag by {:.3f} rad, without their weight by {:.3f}; the feet carry {:.2f}, limp on "
      "the rope, and {:.2f} without it\n",
      with, without, carried[0], carried[1]);
  EXPECT_LT(with, 0.2 * without);
  EXPECT_LT(carried[0], 0.3);
  EXPECT_NEAR(carried[1], 1.0, 0.1);
}

// A small version of `duet hw walks`: behind, to the side, and ahead with its back to where it came from.
TEST(WalkTrial, HomieGetsToAPlaceInAnyDirection) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  if (test::shared_file("models/homie_deploy.onnx").empty()) GTEST_SKIP() << "not run: homie_deploy.onnx absent";
  const auto make_walker = Walker::load("homie", homie_options(), test::g1());
  for (const WalkGoal& goal : {WalkGoal{0.8, 3.0, 0.3}, WalkGoal{0.5, -1.6, -1.5}, WalkGoal{1.2, 0.2, 2.8}}) {
    const WalkTrial trial = run_walk_trial(goal, {}, make_walker(), 11);
    EXPECT_TRUE(trial.reached()) << goal.direction << ": " << trial.off << " m, " << trial.turned_off << " rad, "
                                 << trial.said;
    EXPECT_LE(trial.beyond, 0.03) << goal.direction;  // less than it sways
  }
}

// As under a law that stops too early.
TEST(WalkTrial, ARobotThatDoesNotWalkHasNotReachedIt) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const WalkTrial trial =
      run_walk_trial({0.18, 0.0, 0.0}, {}, std::make_unique<Walker>("wbc_sim", ControllerOptions{}, test::g1()), 11);
  EXPECT_TRUE(trial.stands);
  EXPECT_FALSE(trial.reached());
  EXPECT_NEAR(trial.off, 0.18, 0.05);
  EXPECT_LT(trial.beyond, 0.0);
}

TEST(Walker, WithoutAWalkerTheTwinFallsAndTheGuardStops) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  GuardedEpisode guarded;
  guarded.joints = test::arms_of(*test::g1()).joints;
  guarded.most_wait = 30.0;
  TwinInProcess twin(test::twin_guard(), {.engine = "mujoco"}, nullptr, nullptr);
  GuardedWorld world(guarded, test::g1(), twin);
  Episode episode;
  episode.start = test::g1()->standing_state();
  episode.ticks = ticks_of(20.0);
  Ahead ahead(0.0);
  const auto what_happens = [&] {
    try {
      return std::string(to_string(roll_out(episode, world, ahead, "twin").recording.outcome));
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
  };
  EXPECT_NE(what_happens(), "ok");
  EXPECT_GE(twin.guard().status().safety.state, SafetyState::kHold);
}

// A robot that is held stays on its feet, whatever held it.
void expect_to_stand(const std::string& walker, const ControllerOptions& options, const HoldTrialSetup& setup) {
  const auto make_walker = Walker::load(walker, options, test::g1());
  for (const StopCause cause : causes_of_holds()) {
    const HoldTrial trial = run_hold_trial(cause, setup, make_walker(), 7);
    EXPECT_TRUE(trial.held) << stop_cause_name(cause) << ": " << trial.said;
    EXPECT_FALSE(trial.fell || trial.damped) << stop_cause_name(cause) << ": " << trial.said;
    // States stay late; and a joint that was frozen is somewhere else when it is heard again: a jump.
    const bool lasts = cause == StopCause::kStateDelay || cause == StopCause::kJointFrozen;
    EXPECT_TRUE(trial.ran_again || lasts) << stop_cause_name(cause);
    EXPECT_LT(trial.tilt, 0.4) << stop_cause_name(cause);
  }
}

TEST(HoldTrial, HomieThatWalkedStandsThroughEveryHold) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  if (test::shared_file("models/homie_deploy.onnx").empty()) GTEST_SKIP() << "not run: homie_deploy.onnx absent";
  expect_to_stand("homie", homie_options(), {.seconds = 8.0});
}

TEST(HoldTrial, WbcSimStandsThroughEveryHold) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  expect_to_stand("wbc_sim", {}, {.forward = 0.0, .seconds = 8.0});
}

// The trials as they would be if a hold still damped.
TEST(HoldTrial, ARobotThatIsDampedFalls) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  TwinInProcess twin(test::twin_guard(), {.engine = "mujoco"},
                     std::make_unique<Walker>("wbc_sim", ControllerOptions{}, test::g1()), nullptr);
  PlannerMessage plan;
  plan.command.q = test::g1()->neutral;
  plan.command.root.height = HardwareLimits{}.height;
  GuardReport report;
  const auto go_on = [&](double seconds) {
    for (const double end = twin.twin().time() + seconds; twin.twin().time() < end;) {
      ++plan.sequence;
      plan.command.stamp = twin.twin().time();
      twin.send(plan);
      twin.next(report);
    }
  };
  go_on(10.0);
  ASSERT_EQ(report.state, SafetyState::kRun);
  EXPECT_FALSE(has_fallen(twin.twin().physics()->state(), test::g1()->fall));
  twin.stop();
  go_on(3.0);
  EXPECT_TRUE(has_fallen(twin.twin().physics()->state(), test::g1()->fall));
}

// The law of hardware/guard/goal_walk.h on a root without a gait: it lags, is late, and answers no command that its
// walker would not answer by a step. A body that steps is in walker_test.cpp.

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
