#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <limits>

#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/hardware/guard/walker.h"
#include "duet/hardware/safety/limits.h"
#include "duet/hardware/twin/odometry_trial.h"
#include "duet/hardware/twin/twin_model.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "duet/hardware/wire/odometry_source.h"
#include "duet/robots/dynamics.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kStep = 0.002;
constexpr double kRounding = 1e-9;

// Stands on its left sole, which lies flat and still, and moves its leg above it; the right one is lifted.
RobotState standing_on_the_left(double time) {
  const RobotModel& robot = *test::g1();
  RobotState state = robot.standing_state();
  const std::vector<int>& left = robot.roles.legs[0];
  const std::vector<int>& right = robot.roles.legs[1];
  for (std::size_t k = 0; k < left.size(); ++k)
    state.q[left[k]] += 0.15 * std::sin(2.0 * time + static_cast<double>(k)) - 0.15 * std::sin(static_cast<double>(k));
  state.q[right[0]] -= 0.8;
  state.q[right[3]] += 1.0;
  Kinematics kinematics(robot);
  kinematics.update({}, state.q);
  const int foot = robot.shapes[robot.feet[0]].link;
  state.X_WB = kinematics.X_WL(foot).inverse();  // the foot is at the origin of W, level
  return state;
}

// With the speeds that belong to it, by central differences.
RobotState moving_on_the_left(double time) {
  constexpr double kHalf = 1e-5;
  RobotState state = standing_on_the_left(time);
  const RobotState before = standing_on_the_left(time - kHalf), after = standing_on_the_left(time + kHalf);
  state.v = (after.q - before.q) / (2.0 * kHalf);
  state.v_WB = (after.X_WB.p - before.X_WB.p) / (2.0 * kHalf);
  const Eigen::AngleAxisd turn(before.X_WB.R.conjugate() * after.X_WB.R);
  state.w_WB_B = turn.angle() / (2.0 * kHalf) * turn.axis();
  return state;
}

const Eigen::Vector3d kRest(0.0, 0.0, kGravity);

Eigen::Vector3d force_at(double time) {
  constexpr double kHalf = 1e-4;
  const Eigen::Vector3d a_W =
      (moving_on_the_left(time + kHalf).v_WB - moving_on_the_left(time - kHalf).v_WB) / (2.0 * kHalf);
  return standing_on_the_left(time).X_WB.R.conjugate() * (a_W + kRest);
}

// Over a sole that stands, the base is where the chain says; the speeds between two states are taken as straight.
TEST(LegOdometry, OverAStandingFootTheBaseIsWhereTheChainSays) {
  LegOdometry odometry(test::g1());
  const Eigen::Vector3d begin = standing_on_the_left(0.0).X_WB.p;
  constexpr double kStraight =
      1e-4;  // dt^2 / 12 of the change of an acceleration below 5 m/s^3, and the pull's lag [m]
  double farthest = 0.0;
  for (int k = 0; k <= 1500; ++k) {
    const RobotState state = moving_on_the_left(kStep * k);
    odometry.update(state, force_at(kStep * k));
    const Eigen::Vector2d moved = (state.X_WB.p - begin).head<2>();
    farthest = std::max(farthest, moved.norm());
    ASSERT_LE((odometry.sample().X_WB.p.head<2>() - moved).norm(), kStraight) << k;
  }
  EXPECT_GT(farthest, 0.05);
}

// Without the accelerometer's help the sole alone brings the speed back: a stumble is not kept.
TEST(LegOdometry, ASpeedThatIsWrongComesBack) {
  LegOdometry odometry(test::g1());
  const RobotState state = test::g1()->standing_state();
  odometry.update(state, kRest);
  for (int k = 0; k < 50; ++k) odometry.update(state, kRest + Eigen::Vector3d(10.0, 0.0, 0.0));
  EXPECT_GT(odometry.sample().v_WB.x(), 0.1);
  for (int k = 0; k < 1000; ++k) odometry.update(state, kRest);
  EXPECT_LT(odometry.sample().v_WB.norm(), 0.01);
}

TEST(LegOdometry, ItsFirstSpeedIsThatOfTheBase) {
  for (const double time : {0.0, 0.3, 0.9, 1.7}) {
    LegOdometry odometry(test::g1());
    const RobotState state = moving_on_the_left(time);
    odometry.update(state, kRest);
    EXPECT_LE((odometry.sample().v_WB - state.v_WB).norm(), 1e-6) << time;  // h^2 of the differences and rounding / h
    EXPECT_GT(state.v_WB.norm(), 0.01) << time;
  }
}

TEST(LegOdometry, ItsHeightIsThatOverTheLowestSole) {
  LegOdometry odometry(test::g1());
  RobotState state = test::g1()->standing_state();
  state.X_WB.p.z() = 7.0;  // which nobody measures
  odometry.update(state, kRest);
  EXPECT_NEAR(odometry.sample().X_WB.p.z(), test::g1()->standing_height, 1e-9);
}

TEST(LegOdometry, ARobotThatStandsStillStaysWhereItIs) {
  LegOdometry odometry(test::g1());
  const RobotState state = test::g1()->standing_state();
  for (int k = 0; k < 1000; ++k) odometry.update(state, kRest);
  EXPECT_LE(odometry.sample().X_WB.p.head<2>().norm(), kRounding);
  EXPECT_LE(odometry.sample().v_WB.norm(), kRounding);
}

TEST(LegOdometry, TakesWholeNewStatesAlone) {
  LegOdometry odometry(test::g1());
  TwinModel twin(test::g1(), {});
  LowStateFrame frame;
  twin.write_state(frame);
  OdometrySample sample;
  EXPECT_FALSE(odometry.take(sample));
  LowStateFrame bad = frame;
  bad.motor[3].q += 0.1f;
  odometry.see(bad);
  EXPECT_FALSE(odometry.take(sample));
  odometry.see(frame);
  EXPECT_TRUE(odometry.take(sample));
  EXPECT_TRUE(sample.valid);
  EXPECT_FALSE(odometry.take(sample));
  odometry.see(frame);  // the same tick again
  EXPECT_FALSE(odometry.take(sample));
}

LowStateFrame frame_of(const RobotState& state, const Eigen::Vector3d& force, std::uint32_t tick) {
  LowStateFrame frame{};
  frame.tick = tick;
  const Eigen::Quaterniond& R = state.X_WB.R;
  const double quat_wxyz[4] = {R.w(), R.x(), R.y(), R.z()};
  for (int k = 0; k < 4; ++k) frame.imu.quaternion[k] = static_cast<float>(quat_wxyz[k]);
  for (int k = 0; k < 3; ++k) {
    frame.imu.gyroscope[k] = static_cast<float>(state.w_WB_B[k]);
    frame.imu.accelerometer[k] = static_cast<float>(force[k]);
  }
  for (int j = 0; j < kG1Motors; ++j) {
    frame.motor[j].q = static_cast<float>(state.q[j]);
    frame.motor[j].dq = static_cast<float>(state.v[j]);
  }
  seal(frame);
  return frame;
}

// A robot that counts in milliseconds, every fifth of whose states is lost: the way is as long as without.
TEST(LegOdometry, StatesThatWereNotReadCount) {
  LegOdometry all(test::g1()), some(test::g1());
  constexpr std::uint32_t kBegin = 0xFFFFFF00;  // counts on past 2^32
  for (int k = 0; k <= 1500; ++k) {
    const LowStateFrame frame = frame_of(moving_on_the_left(kStep * k), force_at(kStep * k), kBegin + 2U * k);
    all.see(frame);
    if (k % 5 != 4) some.see(frame);
    constexpr double kLonger = 2e-3;  // what the speed changes by over two periods instead of one, added up [m]
    ASSERT_LE((some.sample().X_WB.p - all.sample().X_WB.p).head<2>().norm(), kLonger) << k;
  }
}

TEST(LegOdometry, NeedsSoles) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { LegOdometry odometry(nullptr); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { LegOdometry odometry(test::g1(), 0.0); }));
}

// Supplement A.4.3 on a root that lags, is late and is measured with noise: the figures of docs/hardware.md, "Walking
// to a place".

constexpr double kDt = 0.02;
// First order in speed, with a delay of the command and noise of the measurement.
struct LateRoot {
  double lag = 0.35, delay = 0.1, noise = 0.0, goal = 1.0;
  bool limited = true;  // acceleration and jerk of the limiter in between

  struct Result {
    double error = 0.0;      // of the goal at the end, above 0: it stopped short [m]
    double overshoot = 0.0;  // beyond the goal at any time [m]
    double slowest = 0.0;    // of the root's speed [m/s]
    double end_speed = 0.0;
    int flips = 0;  // of the command's sign
  };

  [[nodiscard]] Result walk(double seconds = 20.0) const {
    RootVelocity law(OdometrySource::kTwin, {});
    const HardwareLimits limits;
    const AxisBounds bounds{-limits.backward, limits.forward, limits.acceleration, limits.stop_acceleration,
                            limits.jerk};
    std::deque<double> on_the_way(static_cast<std::size_t>(std::lround(delay / kDt)), 0.0);
    Random random(19, 7);
    Reference reference;
    reference.X_WB.p = {goal, 0.0, limits.height};
    AxisState sent;
    AxisClamps clamps;
    Result result{.error = goal, .overshoot = -goal};
    double place = 0.0, speed = 0.0, last = 0.0;
    for (int k = 0; k < std::lround(seconds / kDt); ++k) {
      OdometrySample odometry{.X_WB = {}, .at = k * kDt, .valid = true};
      odometry.X_WB.p = {place + noise * random.normal(), 0.0, limits.height};
      odometry.v_WB.x() = speed + 2.0 * noise * random.normal();
      const double asked = law.update(odometry, reference, k * kDt).forward;
      sent = limited ? follow(asked, sent, bounds, kDt, clamps) : AxisState{asked, 0.0};
      if (std::abs(sent.value) > kRounding && sent.value * last < 0.0) ++result.flips;
      if (std::abs(sent.value) > kRounding) last = sent.value;
      on_the_way.push_back(sent.value);
      speed += (on_the_way.front() - speed) * kDt / lag;
      on_the_way.pop_front();
      place += speed * kDt;
      result.overshoot = std::max(result.overshoot, place - goal);
      result.slowest = std::min(result.slowest, speed);
    }
    result.error = goal - place;
    result.end_speed = speed;
    return result;
  }
};

TEST(RootVelocity, StopsShortAndNeverBeyondWhateverTheLag) {
  for (const bool limited : {false, true})
    for (const auto& [lag, delay] : {std::pair{0.2, 0.04}, {0.35, 0.1}, {0.6, 0.2}, {0.2, 0.2}}) {
      const LateRoot::Result result = LateRoot{.lag = lag, .delay = delay, .limited = limited}.walk();
      EXPECT_LE(result.overshoot, 0.0) << lag << " " << delay;
      EXPECT_GE(result.error, 0.0) << lag << " " << delay;
      EXPECT_LE(result.error, kBrakeDistance) << lag << " " << delay;
      EXPECT_LE(result.flips, 1) << lag << " " << delay;
      EXPECT_NEAR(result.end_speed, 0.0, 1e-3) << lag << " " << delay;
    }
}

TEST(RootVelocity, WithACentimetreOfNoiseItFlipsAtMostTwice) {
  for (const auto& [lag, delay] : {std::pair{0.2, 0.04}, {0.35, 0.1}, {0.6, 0.2}}) {
    const LateRoot::Result result = LateRoot{.lag = lag, .delay = delay, .noise = 0.01}.walk();
    EXPECT_LE(result.flips, 2) << lag << " " << delay;
    EXPECT_LE(result.overshoot, 0.0) << lag << " " << delay;
    EXPECT_GE(result.error, 0.0) << lag << " " << delay;
    EXPECT_LE(result.error, kBrakeDistance) << lag << " " << delay;
  }
}

TEST(RootVelocity, ALongerDelayStopsNearerToTheGoal) {
  double before = kBrakeDistance;
  for (const double delay : {0.0, 0.04, 0.1, 0.2}) {
    const double error = LateRoot{.delay = delay, .limited = false}.walk().error;
    EXPECT_LE(error, before + 1e-6) << delay;
    before = error;
  }
}

TEST(RootVelocity, AShortGoalNeverStarts) {
  for (const double goal : {0.05, 0.14, 0.2}) EXPECT_EQ((LateRoot{.goal = goal}.walk().error), goal) << goal;
  EXPECT_LT((LateRoot{.goal = 0.3}.walk().error), kBrakeDistance);
}

TEST(RootVelocity, IsRefusedWhereNobodyMeasuresTheRoot) {
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([] { RootVelocity(OdometrySource::kNone, HardwareLimits{}); }));
}

VelocityCommand answer_to(const OdometrySample& odometry, double now = 1.0) {
  RootVelocity law(OdometrySource::kExternal, {});
  Reference reference;
  reference.X_WB.p.x() = 1.0;
  return law.update(odometry, reference, now);
}

TEST(RootVelocity, StandsWithoutAGoodSample) {
  OdometrySample good{.X_WB = {}, .at = 0.95, .valid = true};
  EXPECT_EQ(answer_to(good).forward, kReferenceSpeed);
  EXPECT_EQ(answer_to(good, 0.95 + 0.16).forward, 0.0);
  EXPECT_EQ(answer_to(good, 0.9).forward, 0.0);  // from the future
  OdometrySample bad = good;
  bad.valid = false;
  EXPECT_EQ(answer_to(bad).forward, 0.0);
  bad = good;
  bad.v_WB.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(answer_to(bad).forward, 0.0);
  EXPECT_EQ(answer_to(bad).height, HardwareLimits{}.height);
  EXPECT_EQ(answer_to({}).forward, 0.0);
}

// Leg odometry of a robot that walks in MuJoCo under WBC-Sim. The bounds are far above what was measured
// (docs/hardware.md, "Odometry"): they say that it is odometry at all.

TEST(OdometryTrial, AWalkOfTwoMetresIsMeasuredToAFewPercent) {
  const OdometryError error = measure_leg_odometry(test::g1(), {.seconds = 8.0});
  ASSERT_FALSE(error.fell);
  EXPECT_GT(error.walked, 1.5);
  EXPECT_LT(error.end, 0.1 * error.walked);
  EXPECT_LT(error.height, 0.02);
  EXPECT_LT(error.speed_rms, 0.15);
}

// States that are not read make no way shorter: without their periods a tenth of it would be missing.
TEST(OdometryTrial, StatesThatAreNotReadMakeNoWayShorter) {
  const OdometryError whole = measure_leg_odometry(test::g1(), {.seconds = 8.0});
  for (const double lost : {0.1, 0.3}) {
    const OdometryError error = measure_leg_odometry(test::g1(), {.seconds = 8.0, .lost = lost});
    EXPECT_EQ(error.walked, whole.walked);
    EXPECT_LT(error.end, whole.end + 0.03 * whole.walked) << lost;
  }
}

TEST(OdometryTrial, OfARobotThatStandsItStands) {
  const OdometryError error = measure_leg_odometry(test::g1(), {.velocity = Eigen::Vector3d::Zero(), .seconds = 3.0});
  ASSERT_FALSE(error.fell);
  EXPECT_LT(error.largest, 0.01);
}

}  // namespace
}  // namespace duet
