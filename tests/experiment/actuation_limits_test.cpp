#include "duet/experiment/plan/actuation_limits.h"

#include <gmock/gmock.h>

#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::AllOf;
using ::testing::HasSubstr;

Suite suite_with(const std::string& more) {
  return parse_suite(
      "schema: duet.suite/1\nname: s\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback, mujoco, ode]\n"
      "controllers: [pd]\npolicies: [replay]\n" +
          more,
      "s.yaml");
}

JointGains card_gains(const RobotModel& robot) {
  const JointCommand card = robot.default_command(robot.neutral);
  return {card.kp, card.kd};
}

TEST(ActuationLimits, APerturbationsActuationStandsBeforeTheProfiles) {
  const Suite suite = suite_with("law: explicit\nperturbations: [clean, {name: bare, actuation: {armature: 0}}]\n");
  const EngineSettings profile = suite.profile.settings("ode");
  EXPECT_EQ(settings_under(suite.perturbations[0], profile).armature, 1.0);
  const EngineSettings bare = settings_under(suite.perturbations[1], profile);
  EXPECT_EQ(bare.armature, 0.0);
  EXPECT_EQ(bare.law, TorqueLaw::kExplicit);
  EXPECT_EQ(bare.dt, 0.002);
  EXPECT_EQ(bare.options, profile.options);
}

// What an outside user found by trying: the G1 with its card's gains falls at 1 ms without armature and at no usual
// step with it.
TEST(ActuationLimits, OfTheG1AreBetweenTheStepsThatHoldAndThoseThatFall) {
  const std::shared_ptr<const RobotModel> robot = load_shared_robot();
  const ActuationLimits limits = actuation_limits(robot, card_gains(*robot));
  EXPECT_GT(limits.with_armature.largest, 0.002);
  EXPECT_LT(limits.bare.largest, 0.0005);
  EXPECT_THAT(limits.joint_bare, HasSubstr("ankle_roll"));
  EXPECT_THAT(to_text(limits), AllOf(HasSubstr("with the card's armature"), HasSubstr(limits.joint_bare)));
}

TEST(ActuationLimits, NotesNameArmStepAndJointAndOnlyWhereTheExplicitLawIsBeyondThem) {
  const std::shared_ptr<const RobotModel> robot = load_shared_robot();
  const auto notes = [&](const std::string& perturbations) {
    return actuation_notes(suite_with(perturbations), "pd", robot, card_gains(*robot));
  };
  EXPECT_TRUE(notes("").empty());
  EXPECT_TRUE(notes("perturbations: [clean, {name: e, actuation: {law: explicit}}]\n").empty());
  EXPECT_TRUE(notes("perturbations: [{name: b, actuation: {armature: 0}}]\n").empty());
  const std::vector<std::string> found = notes("perturbations: [clean, actuation]\n");
  ASSERT_EQ(found.size(), 1U);  // not one for each engine
  EXPECT_THAT(found[0], AllOf(HasSubstr("controller 'pd', arm 'actuation'"), HasSubstr("at 1 ms without armature"),
                              HasSubstr("ankle_roll_joint of g1")));
  EXPECT_THAT(notes("law: explicit\narmature: 0\n").at(0), HasSubstr("arm 'clean': the explicit law at 2 ms"));
}

// The suite's own law, at a step that no gain of it bears, is refused with the step that it would bear.
TEST(ActuationLimits, ASuiteWhoseOwnLawShakesIsRefusedAndAPerturbationIsNot) {
  EXPECT_SENTENCE(
      thrown_message<InputError>([] { require_bearable_law(suite_with("law: explicit\narmature: 0\ndt: 0.001\n")); }));
  EXPECT_NO_THROW(require_bearable_law(suite_with("law: explicit\n")));
  EXPECT_NO_THROW(require_bearable_law(suite_with("armature: 0\ndt: 0.001\n")));
  EXPECT_NO_THROW(require_bearable_law(suite_with("law: explicit\narmature: 0\ndt: 0.0005\n")));  // up to twice
  EXPECT_NO_THROW(require_bearable_law(suite_with("perturbations: [clean, actuation]\n")));
  EXPECT_NO_THROW(require_bearable_law(
      parse_suite("schema: duet.suite/1\nname: s\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [ode]\n"
                  "controllers: [{name: light, use: pd, options: {explicit_step: 0.001}}]\npolicies: [replay]\n"
                  "law: explicit\narmature: 0\ndt: 0.001\n",
                  "s.yaml")));
}

}  // namespace
}  // namespace duet
