#include "duet/experiment/suite/profile.h"

#include <gmock/gmock.h>

#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/actuation_limits.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/suite/suite.h"
#include "duet/robots/yaml_section.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

std::string refusal(const std::string& yaml) {
  return thrown_message<InputError>([&] { read_profile(parse_yaml(yaml, "p.yaml"), "p.yaml"); });
}

constexpr const char* kSuite = R"(
schema: duet.suite/1
name: s
version: 1.0.0
clips: {synth: {per_task: 1}}
engines: [mujoco, ode]
controllers: [vmc]
policies: [replay]
)";

TEST(Profile, TheShippedOnesNameEveryEngineAndLoad) {
  const std::vector<std::string> names = profile_names();
  for (const char* name : {"parity", "fast", "accurate"}) {
    ASSERT_THAT(names, Contains(name));
    const Profile profile = load_profile(name);
    EXPECT_EQ(profile.name, name);
    EXPECT_FALSE(profile.about.empty());
    for (const char* engine : {"mujoco", "bullet", "ode", "simbody", "dart"})
      EXPECT_TRUE(profile.engines.count(engine));
  }
  EXPECT_EQ(load_profile("parity").settings("dart").dt, 0.002);
}

TEST(Profile, ErrorsNameFileLineExpectedAndFound) {
  for (const char* text :
       {"name: p\nengines:\n  mujocco: {dt: 0.002}\n", "name: p\nengines:\n  ode: {dt: 0.003}\n",
        "name: p\nengines:\n  ode: {dt: fast}\n", "name: p\nengines:\n  ode: 3\n", "name: p\nengines: []\n",
        "schema: duet.profile/9\nname: p\nengines: {}\n", "name: p\nenginess: {}\n"})
    EXPECT_SENTENCE(refusal(text));
}

TEST(Profile, OptionsOfAPresentEngineAreChecked) {
  for (const EngineInfo& engine : engines()) {
    if (!engine.available) continue;
    EXPECT_THAT(refusal("name: p\nengines:\n  " + engine.name + ": {no_such_option: 1}\n"),
                AllOf(HasSubstr("p.yaml:3"), HasSubstr("no_such_option"), HasSubstr(engine.name)));
  }
}

TEST(Profile, AnUnknownNameIsRefusedWithTheNearest) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { load_profile("paritty"); }));
}

TEST(Profile, AFileWithoutSchemaIsNoProfile) {
  const test::ScratchFolder folder;
  const std::string path = folder / "suite.yaml";
  write_file(path, "name: x\n");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_profile(path); }));
}

TEST(Profile, TheDigestIsOfWhatHoldsNotOfWhatIsWritten) {
  for (const EngineInfo& engine : engines()) {
    if (!engine.available || engine_module(engine.name).options.empty()) continue;
    const EngineOption& option = engine_module(engine.name).options.front();
    const EngineSettings silent, written{0.002, {{option.name, option.text({})}}}, slower{0.004, {}};
    EXPECT_EQ(settings_digest(engine.name, silent), settings_digest(engine.name, written));
    EXPECT_NE(settings_digest(engine.name, silent), settings_digest(engine.name, slower));
  }
}

TEST(Profile, LawAndArmatureAreReadHashedAndWrittenWhereTheyAreNotTheCards) {
  const Profile profile = read_profile(
      parse_yaml("name: p\nengines:\n  ode: {dt: 0.001, law: explicit, armature: 0.5}\n", "p.yaml"), "p.yaml");
  const EngineSettings settings = profile.settings("ode");
  EXPECT_EQ(settings.law, TorqueLaw::kExplicit);
  EXPECT_EQ(settings.armature, 0.5);
  EXPECT_EQ(settings_yaml(settings), "{dt: 0.001, law: explicit, armature: 0.5}");
  EXPECT_EQ(settings_yaml({}), "{dt: 0.002}");
  EngineSettings plain;
  plain.dt = 0.001;
  EXPECT_NE(settings_digest("ode", settings), settings_digest("ode", plain));
}

TEST(Profile, ALawOrAnArmatureThatCannotBeIsRefused) {
  EXPECT_THAT(refusal("name: p\nengines:\n  ode: {law: implict}\n"),
              AllOf(HasSubstr("p.yaml:3"), HasSubstr("ode: "), HasSubstr("'implict'"), HasSubstr("'implicit'")));
  EXPECT_THAT(refusal("name: p\nengines:\n  ode: {armature: 2}\n"),
              AllOf(HasSubstr("key 'armature': expected"), HasSubstr("found 2")));
}

TEST(Profile, LawAndArmatureOfASuiteAreThoseOfAllItsEngines) {
  const Suite suite = parse_suite(std::string(kSuite) + "law: explicit\narmature: 0\n", "s.yaml");
  for (const char* engine : {"mujoco", "bullet", "ode", "simbody", "dart"}) {
    EXPECT_EQ(suite.profile.settings(engine).law, TorqueLaw::kExplicit);
    EXPECT_EQ(suite.profile.settings(engine).armature, 0.0);
    EXPECT_EQ(suite.profile.settings(engine).options, load_profile("parity").settings(engine).options);
  }
  EXPECT_EQ(suite_hash(parse_suite(resolved_yaml(suite), "again.yaml")), suite_hash(suite));
  EXPECT_NE(suite_hash(suite), suite_hash(parse_suite(kSuite, "s.yaml")));
}

TEST(Profile, OfASuiteReadsBackFromItsResolvedText) {
  const Suite suite = parse_suite(std::string(kSuite) + "profile: fast\n", "s.yaml");
  EXPECT_EQ(suite.profile.settings("ode").dt, 0.004);
  const Suite again = parse_suite(resolved_yaml(suite), "again.yaml");
  EXPECT_EQ(again.profile.name, "fast");
  EXPECT_EQ(again.profile.settings("ode").dt, 0.004);
  EXPECT_EQ(suite_hash(again), suite_hash(suite));
}

TEST(Profile, DtOfASuiteIsThatOfAllItsEngines) {
  const Suite suite = parse_suite(std::string(kSuite) + "dt: 0.001\n", "s.yaml");
  EXPECT_EQ(suite.profile.settings("mujoco").dt, 0.001);
  EXPECT_EQ(suite.profile.settings("ode").dt, 0.001);
  EXPECT_NE(suite_hash(suite), suite_hash(parse_suite(kSuite, "s.yaml")));
}

TEST(Profile, EnginesAllAreThoseThatAreThere) {
  std::string text = kSuite;
  text.replace(text.find("[mujoco, ode]"), 13, "all");
  const Suite suite = parse_suite(text, "s.yaml");
  std::vector<std::string> expected = {"playback"};
  for (const EngineInfo& engine : engines())
    if (engine.available) expected.push_back(engine.name);
  EXPECT_EQ(suite.engines, expected);
}

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

// Found by an outside user: the G1 with its card's gains falls at 1 ms without armature and at no usual
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
