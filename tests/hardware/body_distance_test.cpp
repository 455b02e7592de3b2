
#include <algorithm>
#include <array>

#include "duet/core/numbers.h"
#include "duet/hardware/safety/contact_watch.h"
#include "duet/robots/kinematics.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kRounding = 1e-9;

TEST(BodyDistance, FallsByAsMuchAsThePersonComesNearer) {
  BodyDistance distance(test::g1(), test::adult_body(), {});
  const RobotState state = test::g1()->standing_state();
  const HumanJoints far = test::standing_adult({2.0, 0.0, 0.95}), near = test::standing_adult({1.5, 0.0, 0.95});
  const double first = distance.measure(state.X_WB, state.q, &far, 0.1, false).person;
  const double second = distance.measure(state.X_WB, state.q, &near, 0.1, false).person;
  EXPECT_LT(second, first - 0.4);
  EXPECT_GT(second, 0.5);
}

// The least gap between points along the robot's capsules and points along the person's.
double sampled_gap(const RobotState& state, const HumanJoints& person, const HumanBody& body) {
  const RobotModel& robot = *test::g1();
  Kinematics kinematics(robot);
  kinematics.update(state.X_WB, state.q);
  double least = 1e9;
  for (const RobotShape& shape : robot.shapes)
    for (const HumanCapsule& capsule : body.capsules) {
      const std::array<Eigen::Vector3d, 2> ends = capsule.ends(person);
      for (double u = -1.0; u < 1.01; u += 0.1)
        for (double v = 0.0; v < 1.01; v += 0.05) {
          const Eigen::Vector3d on_link = shape.X_LS * Eigen::Vector3d(0.0, 0.0, u * shape.half_length);
          const Eigen::Vector3d p = kinematics.p_WL(shape.link) + kinematics.R_WL(shape.link) * on_link;
          least = std::min(least, (p - (1.0 - v) * ends[0] - v * ends[1]).norm() - shape.radius - capsule.radius);
        }
    }
  return least;
}

TEST(BodyDistance, IsThatOfTheNearestPointsOfAllCapsules) {
  BodyDistance distance(test::g1(), test::adult_body(), {});
  Random random(5, 1);
  for (int trial = 0; trial < 8; ++trial) {
    RobotState state = test::g1()->standing_state();
    for (int j = 0; j < test::g1()->dof(); ++j)
      state.q[j] = std::clamp(0.6 * random.normal(), test::g1()->joints[j].lower, test::g1()->joints[j].upper);
    const double side = random.uniform(-0.4, 0.4);
    const HumanJoints person = test::standing_adult({trial % 2 == 0 ? 0.7 : -0.7, side, 0.95});
    const double found = distance.measure(state.X_WB, state.q, &person, 0.0, false).person;
    const double sampled = sampled_gap(state, person, distance.human());
    EXPECT_LE(found, sampled + kRounding) << trial;
    EXPECT_GT(found, sampled - 0.01) << trial;
  }
}

TEST(BodyDistance, UncertaintyIsTakenOff) {
  BodyDistance distance(test::g1(), test::adult_body(), {});
  const RobotState state = test::g1()->standing_state();
  const HumanJoints person = test::standing_adult({1.0, 0.0, 0.95});
  const BodyGaps certain = distance.measure(state.X_WB, state.q, &person, 0.0, false);
  const BodyGaps unsure = distance.measure(state.X_WB, state.q, &person, 0.1, false);
  EXPECT_NEAR(certain.person - unsure.person, 0.1, kRounding);
  EXPECT_NEAR(certain.head - unsure.head, 0.1, kRounding);
}

TEST(BodyDistance, TheHeadIsInFrontOfTheRobot) {
  BodyDistance distance(test::g1(), test::adult_body(), {});
  const RobotState state = test::g1()->standing_state();
  const HumanJoints person = test::standing_adult({1.0, 0.0, 0.95});
  EXPECT_GT(distance.measure(state.X_WB, state.q, &person, 0.0, false).head_from_robot.x(), 0.7);
}

TEST(BodyDistance, WhatMayTouchCountsApartAndOnlyDuringTheAct) {
  BodyDistance distance(test::g1(), test::adult_body(), {{"hand", "hand"}});
  const RobotState state = test::g1()->standing_state();
  const HumanJoints person = test::standing_adult({0.8, 0.0, 0.95});
  const BodyGaps before = distance.measure(state.X_WB, state.q, &person, 0.1, false);
  EXPECT_EQ(before.touched, -1);
  EXPECT_EQ(before.touch, BodyGaps::kFar);
  const BodyGaps during = distance.measure(state.X_WB, state.q, &person, 0.1, true);
  ASSERT_GE(during.touched, 0);
  EXPECT_EQ(distance.human().capsules[during.touched].region, "hand");
  EXPECT_LT(during.touch, 1.0);
  EXPECT_GE(during.person, before.person);
}

TEST(BodyDistance, WithoutAPersonEverythingIsFar) {
  BodyDistance distance(test::g1(), test::adult_body(), {});
  const RobotState state = test::g1()->standing_state();
  const BodyGaps gaps = distance.measure(state.X_WB, state.q, nullptr, 0.1, false);
  EXPECT_EQ(gaps.person, BodyGaps::kFar);
  EXPECT_EQ(gaps.head, BodyGaps::kFar);
  EXPECT_LT(gaps.self, 1.0);
}

std::string refusal(const TouchPair& touch) {
  return test::thrown_message<std::invalid_argument>([&] { BodyDistance(test::g1(), test::adult_body(), {touch}); });
}

TEST(BodyDistance, RefusesTouchesThatCannotOrMustNotBe) {
  EXPECT_SENTENCE(refusal({"wing", "hand"}));
  EXPECT_SENTENCE(refusal({"hand", "tail"}));
  for (const char* region : {"head", "neck"}) EXPECT_SENTENCE(refusal({"hand", region}));
}

}  // namespace
}  // namespace duet
