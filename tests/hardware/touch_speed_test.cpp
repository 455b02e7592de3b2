
#include "duet/hardware/safety/limits.h"
#include "tests/support.h"

namespace duet {
namespace {

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

}  // namespace
}  // namespace duet
