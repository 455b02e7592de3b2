// Published networks as they are, by the descriptors that ship, in MuJoCo: speeds and errors as measured before there
// were keys for them (one run each, no noise). The networks do not ship: without them nothing here runs.
#include <gmock/gmock.h>

#include <cstdio>
#include <filesystem>

#include "tests/backends/engine_names.h"
#include "tests/controllers/published_cases.h"

namespace duet {
namespace {

using test::walk;
using test::Walk;
using test::WalkSetup;

struct Walker {
  const char* name;
  double speed;           // in the heading, at 0.5 m/s [m/s]
  double drift;           // most of it in 6 s, told to stand [m]
  const char* urdf = "";  // that does not ship
};

constexpr const char* kBerkeley = "berkeley_humanoid_lite/berkeley_humanoid_lite.urdf";
constexpr const char *kGr1T1 = "gr1t1/GR1T1_simple.urdf", *kGr1T2 = "gr1t2/GR1T2_simple.urdf";

// The body, with a description from a path where it does not ship.
WalkSetup walking(const Walker& walker, const std::string& command) {
  WalkSetup setup = test::walker(walker.name, command);
  if (*walker.urdf != '\0')
    setup.robot =
        std::make_shared<RobotModel>(load_robot(controller_info(walker.name).robot, test::published_file(walker.urdf)));
  return setup;
}

std::ostream& operator<<(std::ostream& out, const Walker& walker) { return out << walker.name; }

class PublishedWalker : public testing::TestWithParam<Walker> {
 protected:
  void SetUp() override {
    const std::string network = load_descriptor(GetParam().name).network;
    if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
    if (test::published_file(network).empty()) GTEST_SKIP() << "not run: " << network << " absent";
    if (test::published_file(GetParam().urdf).empty()) GTEST_SKIP() << "not run: " << GetParam().urdf << " absent";
  }
};

TEST_P(PublishedWalker, WalksAtTheMeasuredSpeed) {
  const Walk result = walk(walking(GetParam(), "0.5,0,0"));
  std::printf("%s told 0.5 m/s: %.3f m/s\n", GetParam().name, result.forward);
  EXPECT_TRUE(result.upright);
  EXPECT_NEAR(result.forward, GetParam().speed, 0.04 * GetParam().speed);
}

TEST_P(PublishedWalker, StandsWhereItIsToldTo) {
  const Walk result = walk(walking(GetParam(), "0,0,0"));
  std::printf("%s told to stand: %.3f m in 6 s\n", GetParam().name, result.drift);
  EXPECT_TRUE(result.upright);
  EXPECT_LE(result.drift, GetParam().drift);
}

INSTANTIATE_TEST_SUITE_P(
    Published, PublishedWalker,
    testing::Values(Walker{"holosoma", 0.388, 0.03}, Walker{"holosoma_fastsac", 0.417, 0.03},
                    Walker{"holosoma_t1", 0.432, 0.05}, Walker{"falcon", 0.483, 0.05},
                    Walker{"falcon_dec_loco", 0.460, 0.05}, Walker{"unitree_rl_lab", 0.485, 0.02},
                    Walker{"unitree_rl_mjlab", 0.463, 0.04}, Walker{"g1_deploy_velocity", 0.506, 0.03},
                    Walker{"g1_deploy_amp", 0.428, 0.05}, Walker{"booster_gym", 0.446, 0.05},
                    Walker{"playground_t1", 0.492, 0.05}, Walker{"rl_gym_h1", 0.458, 0.5},
                    Walker{"rl_gym_h1_2", 0.479, 0.5}, Walker{"humanoid_gym", 0.454, 0.6},
                    Walker{"agibot_x1", 0.424, 0.05},
                    Walker{DUET_SOURCE_DIR "/controllers/arena/rl_sar_gr1t1.yaml", 0.411, 1.0, kGr1T1},
                    Walker{DUET_SOURCE_DIR "/controllers/arena/rl_sar_gr1t2.yaml", 0.441, 1.0, kGr1T2},
                    Walker{DUET_SOURCE_DIR "/controllers/arena/berkeley_lite.yaml", 0.542, 0.1, kBerkeley},
                    Walker{DUET_SOURCE_DIR "/controllers/arena/berkeley_lite_legs.yaml", 0.454, 0.1, kBerkeley}),
    [](const auto& info) { return std::filesystem::path(info.param.name).stem().string(); });

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

TEST(SpinKick, KicksItsKick) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  if (test::published_file(load_descriptor("spinkick").network).empty()) GTEST_SKIP() << "not run: spinkick absent";
  const Walk result = walk(test::tracked("spinkick", test::beyond_mimic_motion(232, "spinkick")));
  std::printf("spinkick: %.2f s, joints %.3f rad, root %.3f m\n", result.seconds, result.joint_rms, result.root_rms);
  EXPECT_TRUE(result.upright);
  EXPECT_LE(result.joint_rms, 0.2);
  EXPECT_LE(result.root_rms, 0.25);  // it is not shown where it is
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
