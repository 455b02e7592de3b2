#include <gtest/gtest.h>

#include "duet/robots/roles.h"

namespace duet {
namespace {

TEST(PhasePrimitives, TheWayToTheActIsStraightAndEven) {
  RobotMotion motion;
  motion.rate_hz = 50.0;
  const Pose start{.R = yaw_rotation(0.2), .p = {1.0, -1.0, 0.7}}, goal{.R = yaw_rotation(0.8), .p = {3.0, 1.0, 0.8}};
  motion.root.assign(30, goal);
  walk_straight(motion, {.act_begin = 20, .act_end = 25}, start);
  for (int t = 0; t <= 20; ++t) {
    const Pose expected = interpolate(start, goal, t / 20.0);
    EXPECT_LT((motion.root[t].p - expected.p).norm(), 1e-12) << t;
    EXPECT_LT(motion.root[t].R.angularDistance(expected.R), 1e-7) << t;
  }
  EXPECT_EQ(motion.root[29].p, goal.p);
}

}  // namespace
}  // namespace duet
