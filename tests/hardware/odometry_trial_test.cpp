// Leg odometry of a robot that walks in MuJoCo under WBC-Sim. The bounds are far above what was measured
// (docs/hardware.md, "Odometry"): they say that it is odometry at all.
#include "duet/hardware/twin/odometry_trial.h"

#include <gtest/gtest.h>

#include "tests/hardware/limited_robot.h"

namespace duet {
namespace {

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
