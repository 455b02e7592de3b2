// Controllers that a program adds. Each test ends its own process: what is added stays.
#include "duet/controllers/catalogue/registry.h"

#include <gmock/gmock.h>

#include <cmath>
#include <cstdlib>
#include <set>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/backends/g1_scene.h"
#include "tests/controllers/fake_network.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::HasSubstr;

class Still final : public Controller {
 public:
  explicit Still(std::shared_ptr<const RobotModel> robot, double stiffness)
      : robot_(std::move(robot)), stiffness_(stiffness) {}
  [[nodiscard]] std::string_view name() const override { return "still"; }
  void reset(const RobotState&) override {}
  void act(const RobotState&, const Reference& reference, JointCommand& command) override {
    command = robot_->default_command(reference.q);
    command.kp.setConstant(stiffness_);
  }

 private:
  std::shared_ptr<const RobotModel> robot_;
  double stiffness_;
};

void add_still() {
  register_controller({.name = "still",
                       .about = "Stiff",
                       .robot = "g1",
                       .walks = false,
                       .options = {{"stiffness", "7", "of each joint [N m/rad]"}}},
                      [](std::shared_ptr<const RobotModel> robot, const ControllerOptions& options) {
                        const auto found = options.find("stiffness");
                        return std::make_unique<Still>(robot, found == options.end() ? 7.0 : std::stod(found->second));
                      });
}

double stiffness_of(Controller& controller) {
  const RobotState state = test::g1()->standing_state();
  JointCommand command;
  controller.reset(state);
  controller.act(state, {state.X_WB, state.q}, command);
  return command.kp[0];
}

void is_one_like_those_that_ship() {
  add_still();
  EXPECT_EQ(controller_names().back(), "still");
  EXPECT_EQ(controllers().size(), controller_names().size());
  EXPECT_EQ(controller_info("still").about, "Stiff");
  EXPECT_TRUE(controller_files("still").empty());
  EXPECT_EQ(stiffness_of(*make_controller("still", test::g1())), 7.0);
  EXPECT_EQ(stiffness_of(*make_controller("still", test::g1(), {{"stiffness", "3"}})), 3.0);
  EXPECT_THAT(thrown_message<std::invalid_argument>([] {
                make_controller("still", test::g1(), {{"gain", "2"}});
              }),
              HasSubstr("controller 'still'"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { make_controller("stil", test::g1()); }),
              HasSubstr("did you mean 'still'?"));
}

void numbers_that_are_not_finite_never_reach_the_motors() {
  add_still();
  const auto controller = make_controller("still", test::g1(), {{"stiffness", "nan"}});
  EXPECT_TRUE(std::isfinite(stiffness_of(*controller)));
  EXPECT_GT(controller->faults().actions, 0);
}

ControllerInfo named(const std::string& name) { return {name, "", "g1", false, {}}; }

void takes_no_name_twice() {
  add_still();
  EXPECT_EQ(thrown_message<std::invalid_argument>(add_still),
            "controller 'still' is there already: choose another name");
  const auto none = [](std::shared_ptr<const RobotModel>, const ControllerOptions&) {
    return std::unique_ptr<Controller>();
  };
  EXPECT_EQ(thrown_message<std::invalid_argument>([&] { register_controller(named("pd"), none); }),
            "controller 'pd' is there already: choose another name");
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { register_controller(named("empty"), nullptr); }),
              HasSubstr("controller 'empty': expected a function that makes it, found none"));
  register_controller(named("none"), none);
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { make_controller("none", test::g1()); }),
              HasSubstr("controller 'none': its maker made none"));
}

template <typename Check>
[[noreturn]] void end_with(const Check& check) {
  check();
  std::exit(::testing::Test::HasFailure() ? 1 : 0);
}

TEST(AddedController, IsOneLikeThoseThatShip) {
  EXPECT_EXIT(end_with(is_one_like_those_that_ship), ::testing::ExitedWithCode(0), "");
}
TEST(AddedController, IsGuardedAsThoseThatShip) {
  EXPECT_EXIT(end_with(numbers_that_are_not_finite_never_reach_the_motors), ::testing::ExitedWithCode(0), "");
}
TEST(AddedController, TakesNoNameThatIsThere) {
  EXPECT_EXIT(end_with(takes_no_name_twice), ::testing::ExitedWithCode(0), "");
}

TEST(ExplicitStepOption, LowersTheDampingThatWouldShake) {
  const auto robot = test::body("g1");
  const JointGains asked = standing_gains("pd", robot),
                   light = standing_gains("pd", robot, {{"explicit_step", "0.001"}});
  EXPECT_EQ(light.kp, asked.kp);
  const int ankle = robot->joint_index("left_ankle_roll_joint"), knee = robot->joint_index("left_knee_joint");
  EXPECT_LT(light.kd[ankle], 0.3 * asked.kd[ankle]);
  EXPECT_EQ(light.kd[knee], asked.kd[knee]);
  const LoadedController loaded = load_controller("pd", robot, {{"explicit_step", "0.001"}});
  ASSERT_FALSE(loaded.notes.empty());
  EXPECT_THAT(loaded.notes.front(), HasSubstr("kd of left_ankle_roll_joint: "));
  EXPECT_TRUE(load_controller("pd", robot, {{"explicit_step", "0"}}).notes.empty());
  EXPECT_EQ(controller_files("wbc_sim", {{"explicit_step", "0.001"}}).size(), controller_files("wbc_sim").size());
  EXPECT_THAT(thrown_message<std::invalid_argument>([&] {
                static_cast<void>(load_controller("pd", robot, {{"explicit_step", "soon"}}));
              }),
              HasSubstr("controller 'pd': "));
}

// The root of gravity's third number, which is -1 where the robot stands.
TEST(RequireUsable, RefusesANetworkWhoseActionsAreNotFinite) {
  const test::ScratchFolder folder;
  test::OnnxWriter file;
  file.input("obs", {1, 47}).constant("w", {47, 12}, std::vector<float>(47 * 12, 0.1F));
  file.node("Sqrt", {"obs"}, {"root"}).node("MatMul", {"root", "w"}, {"actions"}).output("actions");
  write_file(folder / "root.onnx", file.bytes());
  const auto robot = test::body("g1_12dof");
  const auto controller = make_controller("rl_gym", robot, {{"network", folder / "root.onnx"}});
  EXPECT_SENTENCE(thrown_message<InputError>([&] { require_usable(*controller, *robot, "rl_gym"); }));
}

TEST(ArmsOption, TakesTheArmsFromTheControllerAndNothingElse) {
  const auto robot = test::body("g1");
  const RobotState state = robot->standing_state();
  Reference reference{state.X_WB, state.q};
  for (const std::vector<int>& arm : robot->roles.arms)
    for (const int joint : arm) reference.q[joint] += 0.1;
  const auto answer = [&](const ControllerOptions& options) {
    const std::unique_ptr<Controller> controller = make_controller("wbc_sim", robot, options);
    JointCommand command = robot->default_command(state.q);
    controller->reset(state);
    controller->act(state, reference, command);
    return command;
  };
  const JointCommand own = answer({}), taken = answer({{"arms", "reference"}});
  EXPECT_EQ(answer({{"arms", "own"}}).q_target, own.q_target);
  EXPECT_EQ(taken.kp, own.kp);
  std::set<int> arms;
  for (const std::vector<int>& arm : robot->roles.arms) arms.insert(arm.begin(), arm.end());
  EXPECT_EQ(arms.size(), 14U);
  for (int j = 0; j < robot->dof(); ++j) {
    EXPECT_EQ(taken.q_target[j], arms.contains(j) ? reference.q[j] : own.q_target[j]) << robot->joints[j].name;
    if (arms.contains(j)) {
      EXPECT_NE(own.q_target[j], reference.q[j]) << robot->joints[j].name;
    }
  }
}

TEST(ArmsOption, RefusesARobotWithoutArmsThatMove) {
  EXPECT_THAT(thrown_message<std::invalid_argument>([] {
                static_cast<void>(make_controller("pd", test::body("g1_12dof"), {{"arms", "reference"}}));
              }),
              HasSubstr("controller 'pd': option 'arms': expected a robot with arms that move, found 'g1_12dof'"));
}

// Every published descriptor with a network of its layout, written here: the way from the name to the joints without
// the networks themselves, which do not ship. Tests of those are in published_test.cpp.

// A network whose answer does not depend on what it is shown: zero times the inputs side by side, plus the answer.
std::string constant_network(const Descriptor& descriptor, const std::vector<float>& answer, int more = 0) {
  test::OnnxWriter writer;
  std::vector<std::string> names;
  std::int64_t size = 0;
  for (const ObservationInput& input : descriptor.observation.inputs) {
    names.push_back(input.name.empty() ? "x" : input.name);
    const std::int64_t numbers = descriptor.input_size(input) + more;
    writer.input(names.back(), {1, numbers});
    size += numbers;
  }
  const auto actions = static_cast<std::int64_t>(answer.size());
  const std::string output = descriptor.output.empty() ? "y" : descriptor.output;
  writer.constant("w", {size, actions}, std::vector<float>(static_cast<std::size_t>(size * actions)));
  writer.constant("b", {actions}, answer);
  if (names.size() > 1) writer.node("Concat", names, {"all"}, {{"axis", std::int64_t{1}}});
  writer.node("Gemm", {names.size() > 1 ? "all" : names[0], "w", "b"}, {output});
  writer.output(output, {1, actions});
  return writer.bytes();
}

class StandIn : public testing::TestWithParam<const char*> {
 protected:
  Descriptor descriptor_ = load_descriptor(GetParam());
  std::shared_ptr<const RobotModel> robot_ = test::body(descriptor_.robot);
  test::ScratchFolder folder_;
};

TEST_P(StandIn, TheNetworksAnswerReachesTheJointsOfTheDescriptorWithItsScalesAndGains) {
  std::vector<float> answer;
  for (int i = 0; i < descriptor_.actions(); ++i) answer.push_back(0.01F * static_cast<float>(i + 1));
  write_file(folder_ / "network", constant_network(descriptor_, answer));
  const auto controller = make_controller(GetParam(), robot_, {{"network", folder_ / "network"}});
  const RobotState state = robot_->standing_state(Pose{});
  Reference reference{state.X_WB, robot_->neutral};
  reference.q.array() += 0.05;
  JointCommand command = robot_->default_command(robot_->neutral);
  controller->reset(state);
  controller->act(state, reference, command);
  int action = 0;
  for (const DescriptorJoint& joint : descriptor_.joints) {
    const int j = robot_->joint_index(joint.name);
    EXPECT_EQ(command.kp[j], joint.kp) << joint.name;
    EXPECT_EQ(command.kd[j], joint.kd) << joint.name;
    const double from = joint.action && !joint.around_reference ? joint.neutral : reference.q[j];
    const double wanted = joint.action ? from + *joint.action * answer[action++] : from;
    const bool locked =
        descriptor_.waist_locked && (joint.name == "waist_roll_joint" || joint.name == "waist_pitch_joint");
    if (locked || joint.effort) continue;
    EXPECT_NEAR(command.q_target[j], wanted, 1e-6) << joint.name;
  }
}

TEST_P(StandIn, ANetworkOfAnotherLayoutIsRefusedWithBothNumbers) {
  write_file(folder_ / "network", constant_network(descriptor_, std::vector<float>(descriptor_.actions()), 1));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] {
    make_controller(GetParam(), robot_, {{"network", folder_ / "network"}});
  }));
}

INSTANTIATE_TEST_SUITE_P(Published, StandIn,
                         testing::Values("beyond_mimic", "falcon", "falcon_dec_loco", "gmt", "holosoma",
                                         "holosoma_fastsac", "holosoma_t1", "homie", "playground", "rl_gym",
                                         "rl_sar_dance", "twist2", "unitree_rl_lab", "unitree_rl_mjlab"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace duet
