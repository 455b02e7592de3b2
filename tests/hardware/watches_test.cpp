// Joints that cannot be where they say: each doubt where it belongs, and none where a robot moves, is noisy or loses
// states.
#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/numbers.h"
#include "duet/hardware/safety/contact_watch.h"
#include "duet/hardware/safety/joint_watch.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kStep = 0.002;
constexpr double kMostSpeed = 10.0;  // [rad/s]

// A robot whose joints swing, with the noise of sensors.
struct Swinging {
  explicit Swinging(double noise = 1.0) : noise(noise), watch(*test::g1(), all(kMostSpeed)) {
    for (int j = 0; j < q.size(); ++j) {
      const RobotJoint& joint = test::g1()->joints[j];
      middle[j] = 0.5 * (joint.lower + joint.upper);
      swing[j] = std::min(0.4 * (joint.upper - joint.lower), 0.5);
    }
  }
  static Eigen::VectorXd all(double value) { return Eigen::VectorXd::Constant(test::g1()->dof(), value); }
  void move(int periods = 1) {
    time += periods * kStep;
    constexpr double kPace = 6.0;  // [rad/s]
    for (int j = 0; j < q.size(); ++j) {
      q[j] = middle[j] + swing[j] * std::sin(kPace * time + j) + noise * 0.002 * random.normal();
      v[j] = swing[j] * kPace * std::cos(kPace * time + j) + noise * 0.1 * random.normal();
      tau[j] = random.normal();
    }
  }
  const JointDoubts& see(int periods = 1) {
    watch.see(q, v, tau, periods * kStep, learns);
    return watch.doubts();
  }
  void run(int states) {
    for (int k = 0; k < states; ++k) {
      move();
      see();
      ASSERT_EQ(watch.doubts().joint, -1) << k;
    }
  }

  double noise, time = 0.0;
  JointWatch watch;
  Eigen::VectorXd q = all(0.0), v = all(0.0), tau = all(0.0), middle = all(0.0), swing = all(0.0);
  Random random{5, 6};
  bool learns = false;
};

TEST(JointWatch, DoubtsNoRobotThatMoves) {
  Swinging robot;
  robot.run(5000);
  Swinging losing;
  for (int k = 0; k < 5000; ++k) {
    const int periods = 1 + (losing.random.chance(0.3) ? 1 + static_cast<int>(losing.random.below(20)) : 0);
    losing.move(periods);
    ASSERT_EQ(losing.see(periods).joint, -1) << k;
  }
}

TEST(JointWatch, AnAngleThatJumpsIsDoubtedUntilItIsBack) {
  Swinging robot;
  robot.run(100);
  const double before = robot.q[7];
  for (int k = 0; k < 10; ++k) {
    robot.move();
    robot.q[7] = 30000.0;
    EXPECT_TRUE(robot.see().jump);
    EXPECT_EQ(robot.watch.doubts().joint, 7);
    EXPECT_TRUE(robot.watch.jumped(7));
    EXPECT_FALSE(robot.watch.jumped(8));
    EXPECT_EQ(robot.watch.before_jump(7), before);
  }
  robot.q[7] = before;
  EXPECT_FALSE(robot.see().jump);
  robot.q[7] = before + kMostSpeed * kStep + 0.049;
  EXPECT_FALSE(robot.see().jump);
  robot.q[7] = robot.watch.before_jump(7) - 1.2;
  EXPECT_TRUE(robot.see().jump);
  EXPECT_TRUE(robot.see(50).jump) << "a tenth of a second later";
  EXPECT_FALSE(robot.see(51).jump) << "a robot that was silent begins anew";
}

TEST(JointWatch, ASpeedThatIsNotTheAnglesIsDoubted) {
  for (const double share : {-1.0, 0.0, 2.0}) {
    Swinging robot;
    robot.run(500);
    bool doubted = false;
    for (int k = 0; k < 500; ++k) {
      robot.move();
      robot.v[16] *= share;
      doubted = doubted || robot.see().mismatch;
      EXPECT_FALSE(robot.watch.doubts().jump);
    }
    EXPECT_TRUE(doubted) << share;
    EXPECT_EQ(robot.watch.doubts().excess, 0.0);
  }
}

// A glitch of a speed, as long as the guard takes to hold for it, and one absurd value.
TEST(JointWatch, AGlitchOfASpeedIsNoMismatch) {
  Swinging robot;
  robot.run(500);
  for (int k = 0; k < 10; ++k) {
    robot.move();
    robot.v[3] += 15.0;
    EXPECT_FALSE(robot.see().mismatch) << k;
  }
  robot.run(500);
  robot.move();
  robot.v[3] = 1e30;
  EXPECT_FALSE(robot.see().mismatch);
  robot.run(500);
}

TEST(JointWatch, JointsThatStandStillToTheBitAreDoubted) {
  Swinging robot;
  robot.learns = true;
  robot.run(500);
  robot.learns = false;
  robot.run(100);
  robot.v.setZero();
  robot.see();
  for (int k = 1; k <= 40; ++k) EXPECT_EQ(robot.see().frozen, k >= 25) << k;
  robot.tau[28] += 1e-9;
  EXPECT_FALSE(robot.see().frozen);
}

// A robot without noise may stand still: that says nothing, unless it was told to move.
TEST(JointWatch, ARobotWithoutNoiseMayStandStill) {
  Swinging robot(0.0);
  robot.learns = true;
  robot.move();
  robot.v.setZero();
  for (int k = 0; k < 100; ++k) robot.see();
  robot.learns = false;
  for (int k = 0; k < 10000; ++k) ASSERT_FALSE(robot.see().frozen);
  Eigen::VectorXd targets = robot.q;
  robot.watch.sent(targets);
  ASSERT_FALSE(robot.see().frozen);
  targets[20] += 0.09;
  robot.watch.sent(targets);
  EXPECT_FALSE(robot.see().frozen);
  targets[20] += 0.02;
  robot.watch.sent(targets);
  EXPECT_TRUE(robot.see().frozen);
  EXPECT_EQ(robot.watch.doubts().joint, 20);
  robot.watch.sent_none();
  EXPECT_FALSE(robot.see().frozen);
}

TEST(JointWatch, AnAngleBeyondItsLimitCountsAfterThreeStates) {
  Swinging robot(0.0);
  robot.move();
  robot.v.setZero();
  robot.see();
  robot.q[18] = test::g1()->joints[18].upper;
  robot.see(51);
  for (int k = 0; k < 4; ++k) {
    robot.q[18] = test::g1()->joints[18].upper + 0.03;
    EXPECT_EQ(robot.see().joint, k < 2 ? -1 : 18);
    EXPECT_NEAR(robot.watch.doubts().excess, k < 2 ? 0.0 : 0.03, 1e-9);
  }
  robot.q[18] = test::g1()->joints[18].upper - 0.01;
  EXPECT_EQ(robot.see().excess, 0.0);
}

TEST(JointWatch, NeedsASpeedForEachJoint) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [] { JointWatch watch(*test::g1(), Eigen::VectorXd::Constant(3, 1.0)); }));
}

constexpr double kDt = 0.002;
constexpr int kTicks = 20;  // contact_time

// A robot that stands still; its joints report the torques that hold it.
struct Watched {
  explicit Watched(double least_force = 140.0) : watch(test::g1(), {}, least_force, kDt) {
    state = test::g1()->standing_state();
    Eigen::VectorXd bias(6 + test::g1()->dof());
    bias_forces(*test::g1(), state, bias);
    tau = bias.tail(test::g1()->dof());
  }
  ContactReading after(int ticks) {
    ContactReading reading;
    for (int k = 0; k < ticks; ++k) reading = watch.update(state, tau);
    return reading;
  }
  ContactWatch watch;
  RobotState state;
  Eigen::VectorXd tau;
};

int shoulder(int side) { return test::g1()->roles.arms[side][0]; }
int wrist(int side) { return test::g1()->roles.arms[side][5]; }

TEST(ContactWatch, HoldingOnesOwnArmsIsNoContact) {
  const ContactReading reading = Watched().after(100);
  EXPECT_FALSE(reading.touch || reading.release);
  EXPECT_EQ(reading.force, 0.0);
}

TEST(ContactWatch, APushOfTheShoulderCountsAfterItsTime) {
  Watched robot;
  robot.tau[shoulder(0)] += 5.5;
  EXPECT_FALSE(robot.after(kTicks - 1).touch);
  EXPECT_TRUE(robot.after(1).touch);
}

TEST(ContactWatch, AShortPushDoesNotAddUp) {
  Watched robot;
  robot.tau[shoulder(0)] += 5.5;
  robot.after(kTicks - 1);
  robot.tau[shoulder(0)] -= 5.5;
  robot.after(1);
  robot.tau[shoulder(0)] += 5.5;
  EXPECT_FALSE(robot.after(kTicks - 1).touch);
}

TEST(ContactWatch, AWristFeelsLess) {
  Watched robot;
  robot.tau[wrist(1)] += 2.5;
  EXPECT_TRUE(robot.after(kTicks).touch);
  Watched shoulder_robot;
  shoulder_robot.tau[shoulder(1)] += 2.5;
  EXPECT_FALSE(shoulder_robot.after(kTicks).touch);
}

TEST(ContactWatch, TheForceOfBothArmsAddsUp) {
  Watched robot;
  robot.tau[shoulder(0)] += 12.0;
  const ContactReading one = robot.after(kTicks);
  EXPECT_NEAR(one.force, 40.0, 1e-9);
  EXPECT_FALSE(one.release);
  robot.tau[shoulder(1)] -= 12.0;
  const ContactReading both = robot.after(kTicks);
  EXPECT_NEAR(both.force, 80.0, 1e-9);
  EXPECT_TRUE(both.release);
}

TEST(ContactWatch, ATorqueNearAJointsEffortReleases) {
  Watched robot(1e6);
  robot.tau[shoulder(0)] = 0.59 * test::g1()->joints[shoulder(0)].effort;
  EXPECT_FALSE(robot.after(kTicks).release);
  robot.tau[shoulder(0)] = 0.61 * test::g1()->joints[shoulder(0)].effort;
  EXPECT_TRUE(robot.after(kTicks).release);
}

TEST(ContactWatch, WhereNothingMayTouchAnyTouchReleases) {
  Watched robot(0.0);
  robot.tau[wrist(0)] += 2.5;
  EXPECT_TRUE(robot.after(kTicks).release);
}

TEST(ContactWatch, TheLeastForceIsThatOfTheWeakestRegion) {
  const ContactLimits limits = load_contact_limits(default_contact_limits_path());
  EXPECT_EQ(least_touch_force({{"hand", "hand"}, {"hand", "abdomen"}}, limits), 110.0);
  EXPECT_EQ(least_touch_force({}, limits), 0.0);
}

TEST(ContactWatch, RefusesWhatItCannotWatch) {
  const auto refusal = [](const auto& robot, double force, double dt) {
    return test::thrown_message<std::invalid_argument>([&] { ContactWatch(robot, {}, force, dt); });
  };
  EXPECT_SENTENCE(refusal(nullptr, 0.0, kDt));
  EXPECT_SENTENCE(refusal(test::g1(), 0.0, 0.0));
  EXPECT_SENTENCE(refusal(test::g1(), -1.0, kDt));
  EXPECT_SENTENCE(refusal(load_shared_robot("g1_12dof"), 0.0, kDt));
}

}  // namespace
}  // namespace duet
