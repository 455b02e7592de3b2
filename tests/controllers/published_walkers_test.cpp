// Published networks as they are, by the descriptors that ship, in MuJoCo: speeds and errors as measured before there
// were keys for them (one run each, no noise). The networks do not ship: without them nothing here runs.
#include <gmock/gmock.h>

#include "tests/backends/engine_names.h"
#include "tests/controllers/published_cases.h"

namespace duet {
namespace {

using test::walk;
using test::Walk;
using test::WalkSetup;

struct Walker {
  const char* name;
  double speed;  // in the heading, at 0.5 m/s [m/s]
  double drift;  // most of it in 6 s, told to stand [m]
};

std::ostream& operator<<(std::ostream& out, const Walker& walker) { return out << walker.name; }

class PublishedWalker : public testing::TestWithParam<Walker> {
 protected:
  void SetUp() override {
    const std::string network = load_descriptor(GetParam().name).network;
    if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
    if (test::shared_file("models/" + network).empty()) GTEST_SKIP() << "not run: models/" << network << " absent";
  }
};

TEST_P(PublishedWalker, WalksAtTheMeasuredSpeed) {
  const Walk result = walk(test::walker(GetParam().name, "0.5,0,0"));
  EXPECT_TRUE(result.upright);
  EXPECT_NEAR(result.forward, GetParam().speed, 0.04 * GetParam().speed);
}

TEST_P(PublishedWalker, StandsWhereItIsToldTo) {
  const Walk result = walk(test::walker(GetParam().name, "0,0,0"));
  EXPECT_TRUE(result.upright);
  EXPECT_LE(result.drift, GetParam().drift);
}

INSTANTIATE_TEST_SUITE_P(Published, PublishedWalker,
                         testing::Values(Walker{"holosoma", 0.388, 0.03}, Walker{"holosoma_fastsac", 0.417, 0.03},
                                         Walker{"holosoma_t1", 0.432, 0.05}, Walker{"falcon", 0.483, 0.05},
                                         Walker{"falcon_dec_loco", 0.460, 0.05}, Walker{"unitree_rl_lab", 0.485, 0.02},
                                         Walker{"unitree_rl_mjlab", 0.463, 0.04}),
                         [](const auto& info) { return std::string(info.param.name); });

#define NEEDS(model)                                                      \
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent"; \
  if (test::shared_file("models/" model).empty()) GTEST_SKIP() << "not run: models/" model " absent"

TEST(Falcon, WalksAndStandsWithRaisedArms) {
  NEEDS("falcon/g1_29dof.onnx");
  for (const auto& [command, speed] : {std::pair{"0.5,0,0", 0.493}, std::pair{"0,0,0", 0.0}}) {
    const Walk result = walk(test::falcon_with_raised_arms(command));
    EXPECT_TRUE(result.upright);
    EXPECT_NEAR(result.forward, speed, 0.02) << command;
    for (const char* joint : {"left_shoulder_pitch_joint", "right_shoulder_pitch_joint"})
      EXPECT_NEAR(result.last.q[test::body("g1")->joint_index(joint)], -1.0, 0.06) << command << " " << joint;
  }
}

TEST(BeyondMimic, TracksTheMotionOfItsNetwork) {
  NEEDS("unitree_launcher/beyondmimic_29dof.onnx");
  const Walk result = walk(test::tracked("beyond_mimic", test::beyond_mimic_motion(307)));
  EXPECT_TRUE(result.upright);
  EXPECT_LE(result.joint_rms, 0.07);
  EXPECT_LE(result.root_rms, 0.08);
}

TEST(RlSar, DancesItsDance) {
  NEEDS("rl_sar/policy.pt");
  if (test::shared_file(test::kDance).empty()) GTEST_SKIP() << "not run: its motion absent";
  const Walk result = walk(test::tracked("rl_sar_dance", test::rl_sar_dance()));
  EXPECT_TRUE(result.upright);
  EXPECT_LE(result.joint_rms, 0.10);
  EXPECT_LE(result.root_rms, 0.12);
}

}  // namespace
}  // namespace duet
