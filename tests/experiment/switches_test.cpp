#include "duet/experiment/plan/switches.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Suite suite_in(const std::string& engines, const std::string& more = "") {
  return parse_suite(
      "schema: duet.suite/1\nname: test\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\nengines: [" +
          engines + "]\ncontrollers: [pd]\npolicies: [replay]\ncontrols: [omni]\n" + more,
      "test.yaml");
}

SwitchedSuite switched(const std::string& engines, const SwitchOptions& options) {
  return SwitchedSuite(suite_in(engines), options);
}

std::string refusal(const std::string& engines, const SwitchOptions& options) {
  return thrown_message<std::invalid_argument>([&] { switched(engines, options); });
}

TEST(Switches, AreWhatDiffersInGroupsThatMeanOneThing) {
  const SwitchedSuite suite =
      switched("mujoco", {.from = "parity", .to = "dt=0.001,cone=pyramidal,iterations=5,solver=cg"});
  EXPECT_THAT(suite.names(), ElementsAre("dt", "friction", "solver"));
  EXPECT_EQ(suite.switches()[0].text(), "dt 0.002 -> 0.001");
  EXPECT_EQ(suite.switches()[2].text(), "iterations 20 -> 5, solver newton -> cg");
  EXPECT_EQ(suite.cells(), 8U);
  EXPECT_EQ(suite.cell_name(0), "from");
  EXPECT_EQ(suite.cell_name(5), "dt+solver");
  EXPECT_EQ(suite.cell_name(7), "to");
}

TEST(Switches, LawAndArmatureAreSwitchesLikeOthers) {
  const SwitchedSuite suite = switched("bullet", {.from = "parity", .to = "dt=0.001,law=explicit,armature=0"});
  EXPECT_THAT(suite.names(), ElementsAre("law", "armature", "dt"));
  EXPECT_EQ(suite.switches()[0].text(), "law implicit -> explicit");
  EXPECT_EQ(suite.cell(1).profile.settings("bullet").law, TorqueLaw::kExplicit);
  EXPECT_EQ(suite.cell(1).profile.settings("bullet").armature, 1.0);
  EXPECT_EQ(suite.cell(6).profile.settings("bullet").armature, 0.0);
}

TEST(Switches, ACellHasItsSwitchesTurnedAndNoOthers) {
  const SwitchedSuite suite = switched("playback, mujoco", {.from = "", .to = "dt=0.001,cone=pyramidal"});
  const Suite from = suite.cell(0), step = suite.cell(1), to = suite.cell(3);
  EXPECT_THAT(from.engines, ElementsAre("mujoco"));
  EXPECT_FALSE(from.null_arm);
  EXPECT_THAT(from.controls, IsEmpty());
  EXPECT_EQ(settings_digest("mujoco", from.profile.settings("mujoco")),
            settings_digest("mujoco", load_profile("parity").settings("mujoco")));
  EXPECT_EQ(step.profile.settings("mujoco").dt, 0.001);
  EXPECT_EQ(step.profile.settings("mujoco").options.at("cone"), "elliptic");
  EXPECT_EQ(to.profile.settings("mujoco").options.at("cone"), "pyramidal");
  EXPECT_EQ(to.profile.name, "to");
}

TEST(Switches, OneSwitchTurnsWhatEachEngineCallsIt) {
  const SwitchedSuite suite = switched("mujoco, bullet", {.from = "parity", .to = "fast"});
  EXPECT_THAT(suite.names(), ElementsAre("dt", "solver"));
  EXPECT_EQ(suite.switches()[0].text(), "dt 0.002 -> 0.004");
  EXPECT_THAT(suite.switches()[1].text(), AllOf(HasSubstr("iterations 20 -> 10")));
  EXPECT_EQ(suite.cell(2).profile.settings("bullet").options.at("iterations"), "10");
  EXPECT_EQ(suite.cell(2).profile.settings("bullet").dt, 0.002);
}

TEST(Switches, ASettingOfOneEngineLeavesTheOthersAlone) {
  const SwitchedSuite suite = switched("mujoco, bullet", {.from = "parity", .to = "mujoco.dt=0.001"});
  EXPECT_EQ(suite.switches()[0].text(), "mujoco: dt 0.002 -> 0.001");
  EXPECT_EQ(suite.cell(1).profile.settings("bullet").dt, 0.002);
}

TEST(Switches, AGroupIsWhatTheCallerSays) {
  const SwitchedSuite suite =
      switched("bullet", {.from = "parity", .to = "dt=0.001,erp=0.5", .names = {{"dt", "both"}, {"erp", "both"}}});
  EXPECT_THAT(suite.names(), ElementsAre("both"));
}

TEST(Switches, AnotherEngineIsASwitch) {
  const SwitchedSuite suite = switched("bullet", {.from = "parity", .to = "dt=0.001,engine=mujoco"});
  EXPECT_THAT(suite.names(), ElementsAre("dt", "engine"));
  EXPECT_THAT(suite.cell(1).engines, ElementsAre("bullet"));
  EXPECT_THAT(suite.cell(2).engines, ElementsAre("mujoco"));
  EXPECT_THAT(switched("bullet", {.from = "parity", .to = "erp=0.5,engine=mujoco"}).names(),
              ElementsAre("softness", "engine"));
  EXPECT_EQ(suite.cell(2).profile.settings("mujoco").dt, 0.002);
  EXPECT_EQ(suite.cell(3).profile.settings("mujoco").dt, 0.001);
  EXPECT_EQ(suite.engine_of("mujoco"), "bullet");
  EXPECT_THAT(refusal("bullet, mujoco", {.from = "parity", .to = "engine=ode"}), HasSubstr("expected one engine"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "engine=bullet"}), HasSubstr("expected another engine"));
  EXPECT_THAT(refusal("bullet", {.from = "engine=ode", .to = "dt=0.001"}), HasSubstr("--to names another"));
}

TEST(Switches, RefusesWhatCannotBeAttributed) {
  EXPECT_THAT(refusal("mujoco", {.from = "parity", .to = "parity"}), HasSubstr("are the same for mujoco"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "dt=0.001,erp=0.5,iterations=5,stop_erp=0.1,engine=mujoco"}),
              AllOf(HasSubstr("differ in 5 switches (dt, softness, solver, stops, engine)"), HasSubstr("--group")));
  EXPECT_THAT(thrown_message<InputError>([] { switched("bullet", {.from = "parity", .to = "cone=pyramidal"}); }),
              AllOf(HasSubstr("--to: bullet: "), HasSubstr("bullet"), HasSubstr("cone")));
  EXPECT_THAT(thrown_message<InputError>([] { switched("bullet", {.from = "parity", .to = "dt=0.003"}); }),
              HasSubstr("divides 0.02"));
  EXPECT_THAT(thrown_message<InputError>([] { switched("playback", {.from = "parity", .to = "fast"}); }),
              HasSubstr("playback alone"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "quick"}), HasSubstr("'quick'"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "dt=0.001,erp"}), HasSubstr("expected KEY=VALUE"));
  EXPECT_THAT(refusal("bullet", {.from = "parity", .to = "mujoco.dt=0.001"}),
              HasSubstr("expected an engine that runs"));
}

}  // namespace
}  // namespace duet
