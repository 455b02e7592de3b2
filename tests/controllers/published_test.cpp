// The published controllers with their own networks in MuJoCo, against the measurements of reference/controllers.md
// (section 7). The networks do not ship: without them nothing here runs.
#include <gmock/gmock.h>

#include "motion/pickle.h"
#include "tests/backends/engine_names.h"
#include "tests/controllers/walk.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using test::walk;
using test::Walk;
using test::WalkSetup;
using ::testing::HasSubstr;

// Skips where the engine or the network is absent.
#define NEEDS(model)                                                      \
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent"; \
  if (test::shared_file("models/" model).empty()) GTEST_SKIP() << "not run: models/" model " absent"

WalkSetup homie(const std::string& command) {
  return {.controller = "homie", .options = {{"command", command}}, .start = test::arms_down(*test::body("g1_27dof"))};
}

TEST(Homie, WalksAtTheCommandedSpeed) {
  NEEDS("homie_deploy.onnx");
  const Walk result = walk(homie("0.3,0,0"));
  EXPECT_TRUE(result.upright);
  EXPECT_NEAR(result.forward, 0.30, 0.02);
  EXPECT_NEAR(result.height, 0.751, 0.025);
}

TEST(Homie, StandsAtTheCommandedHeight) {
  NEEDS("homie_deploy.onnx");
  for (const double height : {0.3, 0.5, 0.74}) {
    WalkSetup setup = homie("0,0,0," + std::to_string(height));
    setup.seconds = 5.0;
    const Walk result = walk(setup);
    EXPECT_TRUE(result.upright);
    EXPECT_NEAR(result.height, height, 0.025);
  }
}

TEST(Homie, WalksWithBothArmsRaisedByTheReference) {
  NEEDS("homie_deploy.onnx");
  const auto robot = test::body("g1_27dof");
  const int left = robot->joint_index("left_shoulder_pitch_joint");
  const int right = robot->joint_index("right_shoulder_pitch_joint");
  WalkSetup setup = homie("0.3,0,0");
  setup.reference = [=](int tick, const Reference& neutral) {
    Reference reference = neutral;
    reference.q[left] = reference.q[right] = -1.5 * std::clamp((tick - 150) / 50.0, 0.0, 1.0);
    return reference;
  };
  const Walk result = walk(setup);
  EXPECT_TRUE(result.upright);
  EXPECT_GT(result.forward, 0.25);
  EXPECT_NEAR(result.last.q[left], -1.5, 0.06);
  EXPECT_NEAR(result.last.q[right], -1.5, 0.06);
}

TEST(Homie, ReachesAGoalAMetreAwayAndStaysThere) {
  NEEDS("homie_deploy.onnx");
  for (const char* law : {"adopted", "direct"}) {
    WalkSetup setup = homie("");
    setup.options = {{"conversion", law}};
    setup.seconds = 12.0;
    setup.reference = [](int tick, const Reference& neutral) {
      Reference reference = neutral;
      reference.X_WB.p.x() += std::clamp(tick / 50.0 / 4.0, 0.0, 1.0);  // a metre in four seconds
      return reference;
    };
    const Walk result = walk(setup);
    EXPECT_TRUE(result.upright) << law;
    EXPECT_NEAR(result.last.X_WB.p.x(), 1.0, 0.2) << law;
    EXPECT_LT(result.last.v_WB.head<2>().norm(), 0.1) << law;
  }
}

TEST(Twist2, StandsWithoutDrifting) {
  NEEDS("twist2_1017_20k.onnx");
  WalkSetup setup{.controller = "twist2"};
  Eigen::VectorXd idle = test::body("g1_twist2")->neutral;
  for (const DescriptorJoint& joint : load_descriptor("twist2").joints)
    idle[test::body("g1_twist2")->joint_index(joint.name)] = joint.neutral;
  setup.start = idle;
  setup.reference = [](int, const Reference& neutral) {
    Reference reference = neutral;
    reference.X_WB.p.z() = 0.8;
    return reference;
  };
  const Walk result = walk(setup);
  EXPECT_TRUE(result.upright);
  EXPECT_LE(result.drift, 0.03);
  EXPECT_LE(result.joint_rms, 0.06);
}

TEST(Twist2, TracksARecordedWalk) {
  NEEDS("twist2_1017_20k.onnx");
  const std::string path = test::shared_file("data/g1_motions/twist2/walk_001.pkl");
  if (path.empty()) GTEST_SKIP() << "not run: data/g1_motions/twist2 absent";
  const RobotMotion motion = resample(read_motion_pickle(path).motion, 50.0);
  WalkSetup setup{.controller = "twist2", .seconds = (motion.frames() - 1) / 50.0};
  setup.reference = [&](int tick, const Reference&) { return motion.reference(tick); };
  const Walk result = walk(setup);
  EXPECT_TRUE(result.upright);
  EXPECT_LE(result.joint_rms, 0.09);
}

TEST(Playground, WalksAtTheCommandedSpeed) {
  NEEDS("playground_g1_policy.onnx");
  const Walk result = walk({.controller = "playground", .options = {{"command", "0.8,0,0"}}});
  EXPECT_TRUE(result.upright);
  EXPECT_NEAR(result.forward, 0.81, 0.03);
}

TEST(RlGym, WalksAtTheCommandedSpeed) {
  NEEDS("unitree_rl_gym_g1_motion.pt");
  const Walk result = walk({.controller = "rl_gym", .options = {{"command", "0.3,0,0"}}});
  EXPECT_TRUE(result.upright);
  EXPECT_NEAR(result.forward, 0.29, 0.02);
}

TEST(Published, NamesThePlacesWhereItsNetworkWasLookedFor) {
  const auto make = [](const char* name, const ControllerOptions& options) {
    return thrown_message<MissingError>(
        [&] { make_controller(name, test::body(controller_info(name).robot), options); });
  };
  const std::string message = make("gmt", {});
  EXPECT_THAT(message, HasSubstr("no network of the controller 'gmt': looked at "));
  EXPECT_THAT(message, HasSubstr("models/gmt.onnx"));
  EXPECT_THAT(message, HasSubstr("option 'network' or DUET_MODELS"));
  EXPECT_THAT(make("homie", {{"network", "/nowhere/net.onnx"}}), HasSubstr("looked at /nowhere/net.onnx"));
}

TEST(Published, RefusesAnOptionItDoesNotHave) {
  EXPECT_THAT(thrown_message<std::invalid_argument>([] {
                make_controller("twist2", test::body("g1_twist2"), {{"conversion", "direct"}});
              }),
              HasSubstr("controller 'twist2': unknown option 'conversion'"));
}

TEST(Published, SaysWhichBodyItWasMadeForAndWhetherItWalks) {
  EXPECT_EQ(controller_info("homie").robot, "g1_27dof");
  EXPECT_EQ(controller_info("rl_gym").robot, "g1_12dof");
  EXPECT_TRUE(controller_info("twist2").walks);
  EXPECT_THAT(controller_info("homie").about, HasSubstr("CC BY-NC"));
}

// Run by hand: duet_controllers_test --gtest_also_run_disabled_tests --gtest_filter='*InAllEngines*'.
TEST(DISABLED_Published, InAllEngines) {
  struct Case {
    const char* name;
    const char* command;
    double seconds;
  };
  const Case cases[] = {
      {"homie", "0.3,0,0", 10},  {"homie", "0,0,0,0.5", 10}, {"homie", "0.3,0,0", 60}, {"playground", "0.8,0,0", 10},
      {"rl_gym", "0.3,0,0", 10}, {"rl_gym", "0.3,0,0", 60},  {"twist2", "", 10}};
  for (const std::string& engine : test::engine_names()) {
    if (!test::is_here(engine)) continue;
    for (const Case& each : cases) {
      WalkSetup setup{.controller = each.name, .engine = engine, .seconds = each.seconds};
      if (*each.command != '\0') setup.options = {{"command", each.command}};
      if (setup.controller == "homie") setup.start = test::arms_down(*test::body("g1_27dof"));
      const Walk r = walk(setup);
      printf("| %s | %s %s, %g s | %s %.2f s; %.3f m/s, height %.3f m, drift %.3f m |\n", engine.c_str(), each.name,
             each.command, each.seconds, r.upright ? "upright" : "falls", r.seconds, r.forward, r.height, r.drift);
      fflush(stdout);
    }
  }
}

}  // namespace
}  // namespace duet
