// Supplement A.4.3 on a root that lags, is late and is measured with noise: the figures of docs/hardware.md, "Walking
// to a place".
#include <cmath>
#include <deque>
#include <limits>

#include "duet/core/numbers.h"
#include "duet/hardware/guard/walker.h"
#include "duet/hardware/safety/limits.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kDt = 0.02;
constexpr double kRounding = 1e-9;

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

}  // namespace
}  // namespace duet
