#include "duet/hardware/safety/limits.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

TEST(HardwareLimits, EachHasOneNameAUnitAndAMeaning) {
  std::set<std::string> names;
  for (const Field<HardwareLimits>& limit : hardware_limit_fields()) {
    EXPECT_TRUE(names.insert(limit.name).second) << limit.name;
    EXPECT_FALSE(limit.meaning.empty()) << limit.name;
    EXPECT_FALSE(limit.unit.empty()) << limit.name;
  }
}

TEST(HardwareLimits, DefaultsAreInsideTheirRanges) {
  HardwareLimits limits;
  for (const Field<HardwareLimits>& limit : hardware_limit_fields())
    EXPECT_EQ(set_field(limit, limits, limit.text(limits)), "") << limit.name;
}

TEST(HardwareLimits, NoCeilingCanBeRaised) {
  for (const char* name : {"forward", "backward", "lateral", "yaw_rate", "height_range", "acceleration",
                           "stop_acceleration", "yaw_acceleration", "jerk", "torque_share", "shoulder_torque",
                           "wrist_torque", "contact_time", "release_effort", "release_force"}) {
    HardwareLimits limits;
    const Field<HardwareLimits>* limit = find_field(hardware_limit_fields(), name);
    ASSERT_NE(limit, nullptr) << name;
    const double value = std::stod(limit->text(limits));
    EXPECT_NE(set_field(*limit, limits, std::to_string(1.01 * value)), "") << name;
    EXPECT_EQ(set_field(*limit, limits, std::to_string(0.5 * value)), "") << name;
  }
}

TEST(HardwareLimits, WhatProtectsByBeingLargeCannotBeLowered) {
  for (const char* name : {"joint_margin", "self_distance", "human_speed", "pose_uncertainty", "head_distance",
                           "reaction_time", "stopping_time", "reserve", "arm_reach", "arm_mass"}) {
    HardwareLimits limits;
    const Field<HardwareLimits>* limit = find_field(hardware_limit_fields(), name);
    ASSERT_NE(limit, nullptr) << name;
    const double value = std::stod(limit->text(limits));
    EXPECT_NE(set_field(*limit, limits, std::to_string(0.99 * value)), "") << name;
    EXPECT_EQ(set_field(*limit, limits, std::to_string(1.01 * value)), "") << name;
  }
}

TEST(HardwareLimits, AnArmMayBeAtMostThreeTimesAsFastAsTheDefault) {
  HardwareLimits limits;
  const Field<HardwareLimits>& speed = *find_field(hardware_limit_fields(), "arm_speed");
  EXPECT_EQ(set_field(speed, limits, "1.5"), "");
  EXPECT_NE(set_field(speed, limits, "1.51"), "");
}

constexpr double kArm = 3.0, kWalkingRobot = 17.5;  // [kg]
constexpr double kPrinted = 0.006;                  // the table's figures have two decimals [m/s]

// The largest quasi-static speeds, worked out by hand from force, stiffness and mass.
TEST(TouchSpeed, IsThatOfTheTable) {
  const ContactLimits limits = load_contact_limits(default_contact_limits_path());
  struct Row {
    const char* region;
    double arm, walking;
  };
  for (const Row& row :
       {Row{"head", 0.18, 0.13}, Row{"neck", 0.72, 0.63}, Row{"back", 0.67, 0.32}, Row{"chest", 0.53, 0.25},
        Row{"abdomen", 0.66, 0.32}, Row{"pelvis", 0.68, 0.33}, Row{"upper_arm", 0.71, 0.54}, Row{"forearm", 0.73, 0.60},
        Row{"hand", 0.72, 0.67}, Row{"thigh", 0.58, 0.26}, Row{"shin", 0.31, 0.14}}) {
    EXPECT_NEAR(touch_speed(limits.region(row.region), kArm), row.arm, kPrinted) << row.region;
    EXPECT_NEAR(touch_speed(limits.region(row.region), kWalkingRobot), row.walking, kPrinted) << row.region;
  }
}

TEST(TouchSpeed, NeedsForceStiffnessAndMass) {
  const RegionLimits bare{.region = "chest", .quasi_static_n = 140.0};
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)touch_speed(bare, kArm); }));
}

TEST(TouchSpeed, NeedsAMass) {
  const RegionLimits chest{.region = "chest", .quasi_static_n = 140.0, .stiffness_n_mm = 25.0, .mass_kg = 40.0};
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)touch_speed(chest, 0.0); }));
}

constexpr double kDt = 0.02;
constexpr AxisBounds kSpeed{-0.2, 0.25, 0.5, 1.0, 5.0};  // of a root: m/s, m/s^2, m/s^3
constexpr double kRounding = 1e-9;

AxisState followed(double target, AxisState state, int ticks, const AxisBounds& bounds = kSpeed) {
  AxisClamps clamps;
  for (int k = 0; k < ticks; ++k) state = follow(target, state, bounds, kDt, clamps);
  return state;
}

TEST(AxisLimit, TheLargestRateUsesUpTheDistanceAndNoMore) {
  for (const double floor : {0.0, 0.5})
    for (double distance = 1e-6; distance < 2.0; distance *= 1.3) {
      double rate = largest_rate(distance, 0.1, kDt, floor);
      double covered = 0.0;
      for (; rate > floor + kRounding; rate -= 0.1) covered += rate * kDt;
      EXPECT_LE(covered, distance + kRounding) << distance << " " << floor;
      EXPECT_GE(covered, floor == 0.0 ? distance - kRounding : 0.0) << distance;
    }
  EXPECT_EQ(largest_rate(0.0, 0.1, kDt), 0.0);
}

TEST(AxisLimit, ArrivesWithoutGoingBeyond) {
  AxisState state;
  double most = 0.0;
  for (int k = 0; k < 200; ++k) {
    state = followed(0.2, state, 1);
    most = std::max(most, state.value);
  }
  EXPECT_NEAR(state.value, 0.2, kRounding);
  EXPECT_LE(most, 0.2 + kRounding);
  EXPECT_NEAR(state.rate, 0.0, kRounding);
}

TEST(AxisLimit, AStopMayUseTheLargerRate) {
  AxisState state{0.25, 0.0};
  double steepest = 0.0;
  while (state.value > 1e-6) {
    state = followed(0.0, state, 1);
    steepest = std::min(steepest, state.rate);
  }
  EXPECT_LT(steepest, -0.6);
  EXPECT_GE(steepest, -1.0 - kRounding);
}

TEST(AxisLimit, AReversalPassesZeroAtTheSmallerRate) {
  AxisState state{0.25, 0.0};
  for (int k = 0; k < 100; ++k) {
    const double before = state.value;
    state = followed(-0.2, state, 1);
    if (before <= 0.0) {
      EXPECT_GE(state.rate, -0.5 - kRounding);
    }
  }
  EXPECT_NEAR(state.value, -0.2, kRounding);
}

TEST(AxisLimit, AtRestACommandOfTheValueChangesNothingAndClampsNothing) {
  const AxisState rest = followed(0.13, {}, 200);
  AxisClamps clamps;
  const AxisState next = follow(rest.value, {rest.value, 0.0}, kSpeed, kDt, clamps);
  EXPECT_EQ(next.value, rest.value);
  EXPECT_FALSE(clamps.value || clamps.rate || clamps.rate_change);
}

TEST(AxisLimit, FromOutsideItOnlyGoesInwards) {
  const AxisBounds joint{-1.0, 1.0, 0.5, 0.5, 5.0};
  AxisState state{1.3, 0.0};
  double before = state.value;
  for (int k = 0; k < 100; ++k) {
    state = followed(2.0, state, 1, joint);
    EXPECT_LE(state.value, before + kRounding);
    before = state.value;
  }
  EXPECT_NEAR(state.value, 1.0, kRounding);
}

// Whatever brought it there: the bound of the value counts for more than that of the change of its rate.
TEST(AxisLimit, AStateThatIsTooFastForItsBoundStopsThere) {
  const AxisBounds joint{-1.0, 1.0, 0.5, 0.5, 5.0};
  for (const double side : {-1.0, 1.0}) {
    const AxisState state = followed(side * 2.0, {side * 0.99, side * 2.0}, 1, joint);
    EXPECT_LE(side * state.value, 1.0 + kRounding) << side;
  }
}

TEST(AxisLimit, BrakesToTheValueThatItSaid) {
  const AxisBounds joint{-1.0, 1.0, 0.5, 0.5, 5.0};
  AxisState state = followed(0.8, {}, 13, joint);
  const double rest = rest_value(state, joint, kDt);
  for (int k = 0; k < 20; ++k) state = brake(state, joint, kDt);
  EXPECT_EQ(state.rate, 0.0);
  EXPECT_NEAR(state.value, rest, kRounding);
}

TEST(AxisLimit, NamesWhatClamped) {
  AxisClamps clamps;
  (void)follow(9.0, {}, kSpeed, kDt, clamps);
  EXPECT_TRUE(clamps.value && clamps.rate && clamps.rate_change);
  (void)follow(0.0005, {}, kSpeed, kDt, clamps);
  EXPECT_FALSE(clamps.value || clamps.rate || clamps.rate_change);
}

TEST(AxisLimit, AMillionRandomTargetsKeepEveryBound) {
  Random random(19, 1);
  AxisState state;
  for (int k = 0; k < 1'000'000; ++k) {
    const double target = random.chance(0.1) ? random.uniform(-1e6, 1e6) : random.uniform(-0.5, 0.5);
    const AxisState before = state;
    state = followed(target, state, 1);
    ASSERT_LE(state.value, kSpeed.upper + kRounding) << k;
    ASSERT_GE(state.value, kSpeed.lower - kRounding) << k;
    ASSERT_LE(std::abs(state.rate - before.rate), kSpeed.rate_change * kDt + kRounding) << k;
    const bool to_zero = before.value * state.rate < 0.0;
    ASSERT_LE(std::abs(state.rate), (to_zero ? kSpeed.stop_rate : kSpeed.rate) + kRounding) << k;
  }
}

}  // namespace
}  // namespace duet
