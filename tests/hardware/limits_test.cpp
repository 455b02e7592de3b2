#include "duet/hardware/safety/limits.h"

#include <gtest/gtest.h>

#include <set>

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

}  // namespace
}  // namespace duet
