// Time by the clock of whoever sends, against ours.
#include "duet/hardware/wire/sender_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/core/numbers.h"

namespace duet {
namespace {

constexpr double kRounding = 1e-9;

TEST(StateCount, StatesThatWereNotReadAreCounted) {
  StateCount count;
  EXPECT_EQ(count.periods_to(0xFFFFFFFEu), 1.0);
  EXPECT_EQ(count.periods_to(0u), 1.0);  // two milliseconds, past 2^32
  EXPECT_EQ(count.periods_to(6u), 3.0);
  EXPECT_EQ(count.periods_to(1000u), 50.0);
}

TEST(SenderDelay, IsTheExcessOverTheFastest) {
  SenderDelay delay;
  double sent = 5e8, now = 10.0;
  EXPECT_EQ(delay.see(sent, now), 0.0);
  EXPECT_NEAR(delay.see(sent += 0.03, now += 0.02), 0.0, kRounding);  // faster than the first
  EXPECT_NEAR(delay.see(sent += 0.03, now += 0.08), 0.05, 1e-3);
  EXPECT_NEAR(delay.see(sent += 0.03, now += 0.03), 0.05, 1e-3);
}

TEST(SenderDelay, ClocksMayDrift) {
  SenderDelay ahead, behind;
  for (int k = 0; k <= 30 * 3600; ++k) {  // an hour
    const double now = k / 30.0;
    ASSERT_LE(ahead.see(1.0002 * now, now), kRounding);
    ASSERT_LE(behind.see(0.9998 * now, now), kRounding);
  }
}

TEST(SenderDelay, BeginsAnewWhereItsSenderDoes) {
  SenderDelay delay;
  (void)delay.see(100.0, 10.0);
  EXPECT_EQ(delay.see(3.0, 10.1), 0.0);  // a clock that falls
  EXPECT_EQ(delay.see(3.0, 10.2), 0.0);  // or stands: a sender without one
  EXPECT_NEAR(delay.see(3.1, 10.5), 0.2, 1e-3);
  EXPECT_EQ(delay.see(3.2, 11.1), 0.0);  // silent for longer than half a second
  EXPECT_EQ(delay.see(std::numeric_limits<double>::quiet_NaN(), 11.2), 0.0);
  EXPECT_EQ(delay.see(3.3, 11.3), 0.0);
}

TEST(SenderDelay, ASenderWithOurClockHidesNoDelay) {
  SenderDelay camera(true), robot(false), other(true);
  for (double sent = 100.0; sent < 100.2; sent += 0.03) {
    const bool first = sent == 100.0;
    EXPECT_NEAR(camera.see(sent, sent + 1.0), first ? 0.0 : 1.0, 1e-3);
    EXPECT_NEAR(robot.see(sent, sent + 1.0), 0.0, kRounding);
    EXPECT_NEAR(other.see(sent, sent + 50.0), 0.0, kRounding);
  }
}

// States of a robot that counts `unit`, `delay` later from second 2 on; the steady delay at the end.
double steady_delay(double unit, double delay, double seconds = 4.0) {
  StateDelay states;
  Random random(3, 4);
  double received = 0.0;
  for (double sent = 0.0; sent < seconds; sent += 0.002) {
    received = std::max(received, 70.0 + sent + random.uniform(0.0, 0.004) + (sent > 2.0 ? delay : 0.0));
    states.see(static_cast<std::uint32_t>(std::lround(sent / unit)), received);
  }
  return states.steady();
}

TEST(StateDelay, IsFoundWhateverTheRobotCounts) {
  for (const double unit : {0.002, 0.001}) {
    EXPECT_LT(steady_delay(unit, 0.0), 0.004) << unit;
    EXPECT_NEAR(steady_delay(unit, 0.06), 0.06, 0.004) << unit;
  }
  EXPECT_EQ(steady_delay(0.00137, 0.06), 0.0) << "no unit that is known";
}

TEST(StateDelay, IsNoneWhereAStateInATenthOfASecondIsFast) {
  StateDelay states;
  for (std::uint32_t k = 0; k < 2000; ++k) states.see(k, 70.0 + 0.002 * k + (k > 1500 && k % 40 != 0 ? 0.08 : 0.0));
  EXPECT_LT(states.steady(), 0.001);
}

}  // namespace
}  // namespace duet
