// The Booster T1 through the benchmark: clips retargeted to it, controllers of any body in every engine, and what was
// made for another robot.
#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/motion/paired_motion.h"
#include "duet/policies/catalogue/registry.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

Suite t1_suite(const std::string& engines, const std::string& controllers) {
  return parse_suite(
      "schema: duet.suite/1\nname: t1\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
      "robot: t1\nengines: [" +
          engines + "]\ncontrollers: [" + controllers + "]\npolicies: [replay]\nstart: act\nnull_arm: false\n",
      "t1.yaml");
}

std::vector<EpisodeRow> rows_of(const Suite& suite) {
  const test::ScratchFolder folder;
  Progress quiet(Progress::Style::kQuiet);
  run_suite(suite, folder / "run", {}, quiet);
  return load_run(folder / "run").rows;
}

TEST(SecondRobot, StandsUnderVmcAndFallsUnderGainsAloneInEveryEngine) {
  std::string engines;
  for (const EngineInfo& engine : duet::engines())
    if (engine.available) engines += (engines.empty() ? "" : ", ") + engine.name;
  if (engines.empty()) GTEST_SKIP() << "not run: no physics engine";
  for (const EpisodeRow& row : rows_of(t1_suite(engines, "pd, vmc"))) {
    EXPECT_EQ(row.outcome, row.controller == "vmc" ? Outcome::kOk : Outcome::kFell) << row.engine << row.message;
    EXPECT_EQ(row.robot_digest, load_shared_robot("t1")->digest);
  }
}

TEST(SecondRobot, WavesAsTheClipDoes) {
  for (const EpisodeRow& row : rows_of(t1_suite("playback", "pd"))) EXPECT_EQ(row.success, true);
}

TEST(SecondRobot, NetworksOfTheG1AreRefusedByName) {
  const auto t1 = load_shared_robot("t1");
  for (const char* policy : {"dstar", "dp", "retrieval"})
    EXPECT_SENTENCE(thrown_message<InputError>([&] { static_cast<void>(policy_maker(policy, t1, {})); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { static_cast<void>(make_controller("wbc_sim", t1)); }));
}

// A descriptor of a controller that needs no network to be refused.
std::string descriptor(const std::string& robot) {
  return "name: mine\nabout: a test\nlicence: none\nrobot: " + robot +
         "\nnetwork: none.onnx\nrate_hz: 50\njoints:\n"
         "  - {name: Waist, default: 0, kp: 1, kd: 1, action: 0.25}\n"
         "observation:\n  frame:\n    - {channel: projected_gravity}\ninputs:\n  - parts:\n      - {groups: [frame]}\n";
}

TEST(SecondRobot, AControllerWhoseRobotHasNoJointOfTheClipsIsRefused) {
  const test::ScratchFolder folder;
  write_file(folder / "mine.yaml", descriptor("t1"));
  Suite suite = test::playback_suite();
  suite.controllers = {SuiteController{.name = "mine", .use = folder / "mine.yaml"}};
  EXPECT_SENTENCE(thrown_message<InputError>([&] { const Embodiments bodies(suite); }));
}

TEST(SecondRobot, ADescriptorsRobotMayBeAPathFromItsFolder) {
  const test::ScratchFolder folder;
  write_file(folder / "descriptors/mine.yaml", descriptor("../robots/mine.yaml"));
  EXPECT_EQ(controller_info(folder / "descriptors/mine.yaml").robot, folder / "robots/mine.yaml");
}

}  // namespace
}  // namespace duet
