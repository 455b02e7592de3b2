#include "duet/hardware/safety/contact_watch.h"

#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

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
