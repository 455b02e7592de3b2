#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/tasks/synthesis/curves.h"
#include "duet/tasks/synthesis/gait.h"
#include "tests/support.h"

namespace duet::synthesis {
namespace {

constexpr double kStep = 1.0 / 200.0;  // of the scans below [s]

Body someone() { return make_body(1.72, {}); }

struct Way {
  const char* name;
  Placement to;
  double speed;
};
const std::vector<Way>& ways() {
  static const std::vector<Way> kWays = {
      {"straight", {{2.0, 0.0}, 0.0}, 1.0},    {"arc left", {{1.6, 0.7}, 0.8}, 1.1},
      {"arc right", {{1.2, -0.4}, -0.6}, 0.8}, {"short", {{0.3, 0.0}, 0.0}, 1.2},
      {"on the spot", {{0.0, 0.0}, 0.0}, 1.0}, {"backwards", {{-0.8, 0.0}, 0.0}, 0.6},
      {"turning", {{0.1, 0.0}, 2.8}, 1.0}};
  return kWays;
}

TEST(SynthesisGait, PlantedFeetDoNotMoveAtAll) {
  const Body body = someone();
  for (const Way& way : ways()) {
    Gait gait(body, {});
    gait.walk(plan_walk(body, {}, way.to, way.speed, 0.5));
    for (const Swing& swing : gait.swings()) {
      double until = gait.walks().back().end + 1.0;  // or its next lift
      for (const Swing& next : gait.swings())
        if (next.foot == swing.foot && next.lift > swing.land) until = std::min(until, next.lift);
      for (double t = swing.land; t <= until; t += kStep) {
        EXPECT_EQ(gait.foot(swing.foot, t).toe, swing.to.toe) << way.name;
        EXPECT_EQ(gait.foot(swing.foot, t).yaw, swing.to.yaw) << way.name;
      }
    }
  }
}

TEST(SynthesisGait, FeetTakeTurnsAndOneIsAlwaysDown) {
  const Body body = someone();
  for (const Way& way : ways()) {
    Gait gait(body, {});
    gait.walk(plan_walk(body, {}, way.to, way.speed, 0.0));
    const std::vector<Swing>& swings = gait.swings();
    ASSERT_GE(swings.size(), 2u);
    for (size_t i = 1; i < swings.size(); ++i) {
      EXPECT_NE(swings[i].foot, swings[i - 1].foot) << way.name;
      EXPECT_GE(swings[i].lift, swings[i - 1].land) << way.name;
    }
  }
}

TEST(SynthesisGait, EndsWithFeetSideBySideUnderTheRoot) {
  const Body body = someone();
  for (const Way& way : ways()) {
    Gait gait(body, {});
    gait.walk(plan_walk(body, {}, way.to, way.speed, 0.0));
    const double end = gait.walks().back().end + 0.01;
    const Placement root = gait.root(end);
    EXPECT_LT((root.position - way.to.position).norm(), 1e-12) << way.name;
    const Eigen::Vector3d apart = rot_z(-root.yaw) * (gait.foot(0, end).toe - gait.foot(1, end).toe);
    EXPECT_NEAR(apart.x(), 0.0, 1e-12) << way.name;
    EXPECT_GT(apart.y(), 0.12) << way.name;
    EXPECT_LT(apart.y(), 0.3) << way.name;
  }
}

TEST(SynthesisGait, FirstAndLastStepsAreShorterThanThoseBetween) {
  const Body body = someone();
  Gait gait(body, {});
  gait.walk(plan_walk(body, {}, {{4.0, 0.0}, 0.0}, 1.1, 0.0));
  std::vector<double> lengths;
  double last = gait.foot(0, 0.0).toe.x();
  for (const Swing& swing : gait.swings()) {
    lengths.push_back(swing.to.toe.x() - last);
    last = swing.to.toe.x();
  }
  const double longest = *std::max_element(lengths.begin(), lengths.end());
  EXPECT_LT(lengths.front(), 0.9 * longest);
  EXPECT_NEAR(lengths.back(), 0.0, 1e-12);
  EXPECT_LT(lengths[lengths.size() - 2], 0.9 * longest);
  EXPECT_LE(longest, 0.74 * body.leg() + 1e-12);
  EXPECT_GT(longest, 0.4 * body.leg());
}

TEST(SynthesisGait, HighestSpeedIsTheOneAskedFor) {
  const Body body = someone();
  for (const double speed : {0.6, 0.9, 1.2}) {
    const Walk walk = plan_walk(body, {}, {{3.0, 0.0}, 0.0}, speed, 1.0);
    double highest = 0.0;
    for (double t = 1.0; t < walk.end; t += kStep)
      highest = std::max(highest, (walk.at(t + kStep).position - walk.at(t).position).norm() / kStep);
    EXPECT_NEAR(highest, speed, 2e-3 * speed);
  }
}

TEST(SynthesisGait, ArcsLeaveAndArriveAlongTheirHeadings) {
  const Placement from{{0.5, -0.2}, 0.3}, to{{2.0, 1.0}, 1.1};
  const Walk walk = plan_walk(someone(), from, to, 1.0, 0.0);
  const double third = walk.end / 3.0;
  const Eigen::Vector2d early = walk.at(third).position - walk.at(third - 0.01).position;
  const Eigen::Vector2d late = walk.at(2.0 * third + 0.01).position - walk.at(2.0 * third).position;
  // A parabola stands in for the arc: headings agree to second order in the turn of 0.8 rad.
  EXPECT_NEAR(std::atan2(early.y(), early.x()), walk.at(third - 0.005).yaw, 0.06);
  EXPECT_NEAR(std::atan2(late.y(), late.x()), walk.at(2.0 * third + 0.005).yaw, 0.06);
}

TEST(SynthesisGait, SwingingFeetClearTheGround) {
  const Body body = someone();
  for (const Way& way : ways()) {
    Gait gait(body, {});
    gait.walk(plan_walk(body, {}, way.to, way.speed, 0.0));
    for (double t = 0.0; t < gait.walks().back().end; t += kStep)
      for (const int side : {0, 1}) {
        const FootPose foot = gait.foot(side, t);
        EXPECT_GE(foot.toe.z(), body.toe_height() - 1e-12) << way.name;
        EXPECT_GE(ankle_of(body, foot, side).z(), body.ankle_height() - 1e-3) << way.name;
      }
  }
}

TEST(SynthesisGait, RefusesWalksThatOverlap) {
  const Body body = someone();
  Gait gait(body, {});
  gait.walk(plan_walk(body, {}, {{1.0, 0.0}, 0.0}, 1.0, 0.0));
  const auto again = [&] { gait.walk(plan_walk(body, {{1.0, 0.0}, 0.0}, {{2.0, 0.0}, 0.0}, 1.0, 0.1)); };
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(again));
}

TEST(SynthesisGait, TurnBetweenTakesTheShortWay) {
  EXPECT_NEAR(turn_between(3.0, -3.0), 2.0 * std::numbers::pi - 6.0, 1e-12);
  EXPECT_NEAR(turn_between(0.2, 0.1), -0.1, 1e-12);
  EXPECT_NEAR(turn_between(0.0, 9.0), 9.0 - 2.0 * std::numbers::pi, 1e-12);
}

}  // namespace
}  // namespace duet::synthesis
