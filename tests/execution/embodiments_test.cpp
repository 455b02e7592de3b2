#include "duet/experiment/plan/embodiments.h"

#include <limits>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/episode.h"
#include "duet/motion/paired_motion.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/policy.h"
#include "duet/robots/roles.h"
#include "duet/scoring/scoring.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

// The G1 without its waist roll and with its first two joints exchanged.
RobotModel other_body(const RobotModel& g1) {
  RobotModel body = g1;
  std::swap(body.joints[0], body.joints[1]);
  body.joints.back().name = "tail_joint";
  body.neutral = Eigen::VectorXd::LinSpaced(body.dof(), 1.0, 2.0);
  return body;
}

TEST(OnBody, SameJointsAreTheMotionToTheBit) {
  const auto robot = test::g1();
  const PairedMotion clip = test::paired(Task::kWave, *robot);
  const RobotMotion same = on_body(clip.robot, *robot);
  EXPECT_EQ(same.q, clip.robot.q);
  EXPECT_EQ(same.joint_names, clip.robot.joint_names);
}

TEST(OnBody, JointsGoByNameOthersStayAtNeutral) {
  const auto robot = test::g1();
  const RobotMotion motion = test::paired(Task::kWave, *robot).robot;
  const RobotModel body = other_body(*robot);
  const RobotMotion moved = on_body(motion, body);
  EXPECT_EQ(moved.joint_names, body.joint_names());
  EXPECT_EQ(moved.q.row(0), motion.q.row(1));
  EXPECT_EQ(moved.q.row(1), motion.q.row(0));
  EXPECT_EQ(moved.q.row(7), motion.q.row(7));
  EXPECT_EQ(moved.q.bottomRows(1), Eigen::RowVectorXd::Constant(motion.frames(), body.neutral.tail(1)[0]));
  EXPECT_EQ(moved.root.size(), motion.root.size());
}

TEST(Embodiments, APolicyThatTheCallerBringsIsMadeByItsNameAndNotByWhatItUses) {
  Suite suite = test::playback_suite();
  suite.policies = {{.name = "a", .use = "null"}, {.name = "b", .use = "null"}};
  std::vector<std::string> made;
  const auto loader = [&](const std::string& name) -> PolicyLoader {
    return [&made, name](const std::shared_ptr<const RobotModel>& robot, const PolicyOptions&) -> PolicyMaker {
      return [&made, name, robot] {
        made.push_back(name);
        return make_policy("null", robot);
      };
    };
  };
  const Embodiments bodies(suite, {}, {}, {{"a", loader("first")}, {"b", loader("second")}});
  for (const char* name : {"b", "a", "null"}) static_cast<void>(bodies.policy("pd", name)->make());
  EXPECT_EQ(made, (std::vector<std::string>{"second", "first"}));
}

TEST(Embodiments, ControllersOfOneBodyShareItAndItsClips) {
  Suite suite = test::playback_suite();
  suite.controllers = {SuiteController{"pd"}, SuiteController{"vmc"}};
  Embodiments bodies(suite);
  EXPECT_EQ(bodies.robot("pd"), bodies.robot("vmc"));
  EXPECT_EQ(bodies.robot("pd"), bodies.nominal());
  bodies.take_clips({test::paired(Task::kWave, *bodies.nominal())});
  EXPECT_EQ(&bodies.clips("pd"), &bodies.clips("vmc"));
  EXPECT_EQ(bodies.clips("pd").size(), 1U);
  EXPECT_TRUE(bodies.absent().empty());
}

// Wants what it is told to, and remembers what it saw.
class Mirror final : public Policy {
 public:
  [[nodiscard]] std::string_view name() const override { return "mirror"; }
  void reset(const EpisodeContext& context) override { start = context.start; }
  Anchors act(const Observation& observation) override {
    seen = observation.now().robot;
    Anchors anchors;
    anchors.fill({seen.X_WB, wanted});
    return anchors;
  }
  RobotState start, seen;
  Eigen::VectorXd wanted;
};

TEST(OnOtherBody, JointsGoByNameBothWays) {
  const auto robot = test::g1();
  const RobotModel body = other_body(*robot);
  auto mirror = std::make_unique<Mirror>();
  Mirror& policy = *mirror;
  policy.wanted = Eigen::VectorXd::LinSpaced(robot->dof(), 0.0, 28.0);
  const auto moved = on_other_body(std::move(mirror), robot, body);
  EpisodeContext context;
  context.start = body.standing_state();
  context.start.q = Eigen::VectorXd::LinSpaced(body.dof(), 100.0, 128.0);
  context.start.v = -context.start.q;
  moved->reset(context);
  EXPECT_EQ(policy.start.q[0], 101.0);
  EXPECT_EQ(policy.start.q[1], 100.0);
  EXPECT_EQ(policy.start.q[28], robot->neutral[28]);  // a joint that the body lacks
  EXPECT_EQ(policy.start.v[0], -101.0);
  EXPECT_EQ(policy.start.v[28], 0.0);
  ObservationHistory history;
  history.add({Eigen::Matrix<double, 3, 24>::Zero(), context.start});
  for (const Reference& reference : moved->plan(history.at(0))) {
    EXPECT_EQ(reference.q[0], 1.0);
    EXPECT_EQ(reference.q[1], 0.0);
    EXPECT_EQ(reference.q[28], body.neutral[28]);  // a joint that only the body has
  }
  EXPECT_EQ(policy.seen.q, policy.start.q);
  EXPECT_EQ(moved->name(), "mirror");
}

TEST(OnOtherBody, OfStrangersIsRefused) {
  const auto robot = test::g1();
  RobotModel body = *robot;
  for (RobotJoint& joint : body.joints) joint.name += "_of_another";
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { on_other_body(std::make_unique<Mirror>(), robot, body); }));
}

TEST(Embodiments, AControllerOfNumbersThatAreNotFiniteIsRefusedBeforeTheFirstEpisode) {
  register_controller({.name = "nowhere", .about = "a controller without an answer", .robot = "", .options = {}},
                      [](const std::shared_ptr<const RobotModel>&, const ControllerOptions&) {
                        struct Nowhere final : Controller {
                          [[nodiscard]] std::string_view name() const override { return "nowhere"; }
                          void reset(const RobotState&) override {}
                          void act(const RobotState&, const Reference&, JointCommand& command) override {
                            command.q_target.setConstant(std::numeric_limits<double>::quiet_NaN());
                          }
                        };
                        return std::make_unique<Nowhere>();
                      });
  Suite suite = test::playback_suite();
  suite.controllers = {SuiteController{"nowhere"}};
  EXPECT_NO_THROW(Embodiments{suite});  // nothing acts where clips are played back
  suite.engines = {"mujoco"};
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { const Embodiments bodies(suite); }));
}

TEST(Embodiments, PerturbationsAreCheckedOnEveryBody) {
  Suite suite = test::playback_suite();
  suite.perturbations = {test::perturbation("{push: {link: nowhere}}")};
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { const Embodiments bodies(suite); }));
}

TEST(Plan, PerturbationsAreAnAxisOfEnginesAndNotOfPlayback) {
  Suite suite = test::playback_suite();
  suite.engines = {"playback", "mujoco"};
  suite.perturbations = {Perturbation{}, default_perturbation("push"), default_perturbation("delay")};
  const auto experiment = test::experiment_of(suite, {test::paired(Task::kWave, *test::g1())});
  std::map<std::string, int> count;
  std::set<std::string> keys;
  for (std::int64_t i = 0; i < experiment->size(); ++i) {
    const EpisodeSpec spec = experiment->at(i);
    ++count[spec.engine + " " + spec.perturbation->name + " " + spec.arm];
    keys.insert(experiment->row(spec).key);
    EXPECT_NE(spec.seed, spec.perturbation_seed);
  }
  EXPECT_EQ(count, (std::map<std::string, int>{{"playback clean main", 1},
                                               {"playback clean null", 1},
                                               {"mujoco clean main", 1},
                                               {"mujoco clean null", 1},
                                               {"mujoco push main", 1},
                                               {"mujoco push null", 1},
                                               {"mujoco delay main", 1},
                                               {"mujoco delay null", 1}}));
  EXPECT_EQ(keys.size(), 8U);
}

TEST(FootTrace, HeightsAreOfTheSolesLowestPoints) {
  const auto robot = test::g1();
  Recording recording;
  for (int t = 0; t < 5; ++t) {
    recording.robot.push_back(robot->standing_state());
    recording.robot.back().X_WB.p.z() += 0.1 * t;
  }
  const FootTrace trace = foot_trace(recording, *robot);
  EXPECT_EQ(trace.left_mm, (std::vector<int>{0, 200, 400}));  // every second frame, standing on the ground at first
  EXPECT_EQ(trace.right_mm, trace.left_mm);
  // The right hip bent forward lifts the right foot alone.
  recording.robot[2].q[robot->joint_index("right_hip_pitch_joint")] -= 0.8;
  const FootTrace lifted = foot_trace(recording, *robot);
  EXPECT_EQ(lifted.left_mm, trace.left_mm);
  EXPECT_GT(lifted.right_mm[1], trace.right_mm[1] + 50);
}

// The Booster T1 through the benchmark: clips retargeted to it, controllers of any body in every engine, and what was
// made for another robot.

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
