#include "duet/experiment/suite/suite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kMinimal = R"(schema: duet.suite/1
name: small
version: 1.0.0
clips: {synth: {per_task: 2}}
engines: [playback]
controllers: [pd]
policies: [replay]
)";

std::string refusal(const std::string& extra, const std::string& base = kMinimal) {
  return test::thrown_message<InputError>([&] { parse_suite(base + extra, "s.yaml"); });
}

TEST(Suite, DefaultsAreTheDocumentedOnes) {
  const Suite suite = parse_suite(kMinimal, "s.yaml");
  EXPECT_EQ(suite.tasks, std::vector<Task>(kPaperTasks.begin(), kPaperTasks.end()));  // whatever tasks are added
  EXPECT_EQ(suite.partner, SuitePartner::kGhost);
  EXPECT_EQ(suite.detector, DetectorVersion::kRobot);
  EXPECT_EQ(suite.start, SuiteStart::kAuto);
  EXPECT_TRUE(suite.null_arm);
  EXPECT_EQ(suite.profile.name, "parity");
  EXPECT_EQ(suite.profile.settings("mujoco").dt, 0.002);
}

TEST(Suite, AYieldingPartnerIsSolidForEnginesAndNeedsAShortStep) {
  const std::string yielding = "partner: yielding\n";
  const Suite suite = parse_suite(kMinimal + yielding, "s.yaml");
  EXPECT_EQ(suite.partner, SuitePartner::kYielding);
  EXPECT_EQ(scene_mode(suite.partner), PartnerMode::kSolid);
  EXPECT_EQ(parse_suite(resolved_yaml(suite), "again.yaml").partner, suite.partner);
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  std::string in_engine = kMinimal;
  in_engine.replace(in_engine.find("playback"), std::string("playback").size(), "mujoco");
  EXPECT_NE(
      refusal(yielding + "dt: 0.004\n", in_engine).find("a yielding partner needs a physics step of at most 0.002 s"),
      std::string::npos);
}

TEST(Suite, ResolvedTextReadsBackToTheSameHash) {
  const Suite suite =
      parse_suite(std::string(kMinimal) +
                      "tasks: [hug, high-five]\nstart: act\npartner: solid\ndt: 0.001\nnull_arm: false\n"
                      "readings: {metrics.large_angle: entry}\nretarget: {kernel: scalar}\n"
                      "detector: {version: paper, thresholds: strict}\nrecord: {trajectories: all}\n",
                  "s.yaml");
  const Suite again = parse_suite(resolved_yaml(suite), "again.yaml");
  EXPECT_EQ(resolved_yaml(again), resolved_yaml(suite));
  EXPECT_EQ(suite_hash(again), suite_hash(suite));
  EXPECT_EQ(again.thresholds, ThresholdSet::kStrict);
  EXPECT_EQ(again.readings.at("metrics.large_angle"), "entry");
}

TEST(Suite, HashFollowsWhatIsRun) {
  const Suite suite = parse_suite(kMinimal, "s.yaml");
  EXPECT_NE(suite_hash(suite), suite_hash(parse_suite(kMinimal, "s.yaml", {{"clips.synth.seed", "7"}})));
  EXPECT_EQ(suite_hash(suite), suite_hash(parse_suite(kMinimal, "other.yaml")));
}

TEST(Suite, HashFollowsTheContentOfClipsAndNotTheirPlace) {
  const test::ScratchFolder folder;
  write_file(folder / "one.npz", "content");
  write_file(folder / "two.npz", "content");
  write_file(folder / "three.npz", "other");
  const auto hash = [&](const std::string& name) {
    std::string yaml = kMinimal;
    yaml.replace(yaml.find("{synth: {per_task: 2}}"), 22, "{files: [" + (folder / name) + "]}");
    return suite_hash(parse_suite(yaml, "s.yaml"));
  };
  EXPECT_EQ(hash("one.npz"), hash("two.npz"));
  EXPECT_NE(hash("one.npz"), hash("three.npz"));
}

TEST(Suite, OverridesReachNestedKeysAndReadings) {
  const Suite suite =
      parse_suite(kMinimal, "s.yaml",
                  {{"clips.synth.per_task", "3"}, {"tasks", "[wave]"}, {"readings.metrics.jpe_frame", "pelvis"}});
  EXPECT_EQ(suite.clips.synth_per_task, 3);
  EXPECT_EQ(suite.tasks, std::vector<Task>{Task::kWave});
  EXPECT_EQ(suite.readings.at("metrics.jpe_frame"), "pelvis");
}

TEST(Suite, UnknownKeysAndNamesAreRefusedWithTheNearest) {
  for (const char* text :
       {"tassks: [hug]\n", "tasks: [hugg]\n", "partner: ghots\n", "readings: {metrics.larg_angle: entry}\n",
        "retarget: {kernell: v3}\n", "limits: {wall: 3}\n"})
    EXPECT_SENTENCE(refusal(text));
}

TEST(Suite, UnknownEngineControllerAndPolicyAreRefused) {
  std::string yaml = kMinimal;
  yaml.replace(yaml.find("playback"), 8, "mujocco");
  EXPECT_SENTENCE(refusal("", yaml));
  yaml = kMinimal;
  yaml.replace(yaml.find("[pd]"), 4, "[vcm]");
  EXPECT_SENTENCE(refusal("", yaml));
  yaml = kMinimal;
  yaml.replace(yaml.find("[replay]"), 8, "[]");
  EXPECT_SENTENCE(refusal("", yaml));
}

TEST(Suite, ValuesOutOfRangeAreRefused) {
  for (const char* text :
       {"dt: 0.003\n", "dt: -1\n", "episodes_per_clip: 0\n", "episodes_per_clip: 1.5\n", "start_radius: 9\n",
        "fuse_ticks: 91\n", "limits: {wall_s_per_episode: 0}\n", "seed: -4\n", "draws_of: core\n"})
    EXPECT_SENTENCE(refusal(text));
}

TEST(Suite, BrokenDocumentsAreRefused) {
  for (const char* text : {"[1, 2", "", "name: x\n", "schema: duet.suite/9\nname: x\nversion: 1\n"})
    EXPECT_SENTENCE(refusal("", text));
  std::string both = kMinimal;
  both.replace(both.find("{synth: {per_task: 2}}"), 22, "{synth: {per_task: 2}, files: [a.npz]}");
  EXPECT_SENTENCE(refusal("", both));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { load_suite("nowhere.yaml"); }));
}

std::string with_controllers(const std::string& list) {
  std::string yaml = kMinimal;
  return yaml.replace(yaml.find("[pd]"), 4, list);
}

TEST(Suite, ControllersHaveNamesOfTheirOwn) {
  const Suite suite = parse_suite(with_controllers("[vmc, {name: plain, use: pd}]"), "s.yaml");
  ASSERT_EQ(suite.controllers.size(), 2U);
  EXPECT_EQ(suite.controllers[0].name, "vmc");
  EXPECT_EQ(suite.controllers[0].use, "vmc");
  EXPECT_EQ(suite.controllers[1].name, "plain");
  EXPECT_EQ(suite.controllers[1].use, "pd");
  EXPECT_EQ(resolved_yaml(parse_suite(resolved_yaml(suite), "again.yaml")), resolved_yaml(suite));
  EXPECT_THAT(resolved_yaml(parse_suite(kMinimal, "s.yaml")), HasSubstr("controllers: [pd]\n"));
  EXPECT_EQ(suite.controller("plain").use, "pd");
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)suite.controller("plian"); }));
}

TEST(Suite, ControllersThatAreNotOnesAreRefused) {
  for (const char* text :
       {"[{name: x, use: vcm}]", "[{nmae: pd}]", "[{use: pd}]", "[pd, {name: pd, use: vmc}]",
        "[{name: 'a/b', use: pd}]", "[{name: pd, options: {waist: locked}}]", "[{name: pd, options: [1]}]", "[]"})
    EXPECT_SENTENCE(refusal("", with_controllers(text)));
  Suite suite = parse_suite(kMinimal, "s.yaml");
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { set_controller_option(suite, "pd", "network", "x"); }));
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { set_controller_option(suite, "vmc", "network", "x"); }));
}

// Rows and tables tell policies apart by their names.
TEST(Suite, APolicyWithACommonOptionSaysSoInItsName) {
  const auto named = [](const std::string& name, const std::string& option) {
    std::string yaml = kMinimal;
    return yaml.replace(yaml.find("[replay]"), 8, "[{name: " + name + ", use: replay, options: {" + option + "}}]");
  };
  EXPECT_NO_THROW(parse_suite(named("replay+servo", "hand_servo: true"), "s.yaml"));
  EXPECT_NO_THROW(parse_suite(named("replay+servo+average", "hand_servo: true, average: true"), "s.yaml"));
  EXPECT_NO_THROW(parse_suite(named("replay", "hand_servo: false, average: false"), "s.yaml"));
  const auto refusal = [&](const std::string& option) {
    return test::thrown_message<InputError>([&] { parse_suite(named("replay", option), "s.yaml"); });
  };
  EXPECT_THAT(refusal("hand_servo: true"),
              HasSubstr("policy 'replay': hand_servo is on: expected a name that says `servo` ('replay+servo')"));
  EXPECT_THAT(refusal("average: true"),
              HasSubstr("policy 'replay': average is on: expected a name that says `average` ('replay+average')"));
}

std::string with_synth(const std::string& synth, const std::string& tasks = "[handshake, wave]") {
  std::string yaml = kMinimal;
  yaml.replace(yaml.find("{per_task: 2}"), 13, synth);
  return yaml + "tasks: " + tasks + "\n";
}

TEST(Suite, VariantsOfClipsAreReadAndCount) {
  const std::string text =
      with_synth("{per_task: 2, variants: [{name: low, side: left, target_height: 0.9}, {name: right, side: right}]}",
                 "[handshake]");
  const Suite suite = parse_suite(text, "s.yaml");
  ASSERT_EQ(suite.clips.variants.size(), 2U);
  EXPECT_EQ(suite.clips.variants[0].side, Side::kLeft);
  EXPECT_EQ(suite.clips.variants[0].target_height, 0.9);
  EXPECT_FALSE(suite.clips.variants[1].target_height.has_value());
  EXPECT_EQ(suite_hash(parse_suite(resolved_yaml(suite), "again.yaml")), suite_hash(suite));
  EXPECT_NE(suite_hash(suite), suite_hash(parse_suite(with_synth("{per_task: 2}", "[handshake]"), "s.yaml")));
  EXPECT_EQ(resolved_yaml(parse_suite(kMinimal, "s.yaml")).find("variants"), std::string::npos);
}

TEST(Suite, ClipsMayBeLikePeople) {
  const Suite suite = parse_suite(with_synth("{per_task: 2, like: people}"), "s.yaml");
  EXPECT_EQ(suite.clips.synth_like, Likeness::kPeople);
  EXPECT_EQ(suite_hash(parse_suite(resolved_yaml(suite), "again.yaml")), suite_hash(suite));
  EXPECT_NE(suite_hash(suite), suite_hash(parse_suite(with_synth("{per_task: 2}"), "s.yaml")));
  EXPECT_EQ(resolved_yaml(parse_suite(kMinimal, "s.yaml")).find("like:"), std::string::npos);
  EXPECT_EQ(suite_hash(parse_suite(with_synth("{per_task: 2, like: rehearsed}"), "s.yaml")),
            suite_hash(parse_suite(with_synth("{per_task: 2}"), "s.yaml")));
  EXPECT_SENTENCE(refusal("", with_synth("{per_task: 2, like: robots}")));
}

TEST(Suite, VariantsThatCannotBeAreRefused) {
  const auto with = [](const std::string& list) {
    return refusal("", with_synth("{per_task: 1, variants: " + list + "}"));
  };
  for (const char* text :
       {"[{name: low, target_height: 0.9}]", "[{name: a, outcome: aborted}]", "[{name: a, outcome: lost}]",
        "[{name: a, distance: 1}]", "[{name: a, side: up}]", "[{name: a}]", "[{side: left}]",
        "[{name: 'a b', side: left}]", "[{name: a, side: left}, {name: a, side: right}]", "3"})
    EXPECT_SENTENCE(with(text));
  EXPECT_SENTENCE(refusal("", with_synth("{per_task: 1, variants: [{name: a, target_height: 1}]}", "[bend]")));
  EXPECT_SENTENCE(refusal("", with_synth("{per_task: 1, variants: [{name: a, still: perhaps}]}", "[wave]")));
  EXPECT_SENTENCE(refusal("", with_synth("{per_task: 1, like: varied, variants: [{name: a, still: true}]}", "[hug]")));
  EXPECT_SENTENCE(refusal("", with_synth("{per_task: 1, like: people, variants: [{name: a, still: true}]}", "[wave]")));
}

TEST(Suite, ARobotThatIsNotThereIsRefusedByItsName) {
  EXPECT_SENTENCE(
      test::thrown_message<InputError>([] { parse_suite(std::string(kMinimal) + "robot: g0\n", "s.yaml"); }));
}

TEST(Suite, ARobotMayGoByName) {
  const Suite suite = parse_suite(std::string(kMinimal) + "robot: g1_27dof\n", "s.yaml");
  EXPECT_EQ(suite.robot, card_path("g1_27dof"));
  EXPECT_EQ(suite_hash(suite),
            suite_hash(parse_suite(std::string(kMinimal) + "robot: " + suite.robot + "\n", "s.yaml")));
}

TEST(Suite, APathThatOnlyTheWorkingFolderHasIsTakenFromThere) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "suites");
  const std::string descriptor = std::string(DUET_SOURCE_DIR) + "/examples/policies/wave_policy.yaml";
  std::filesystem::copy(descriptor, folder / "mine.yaml");
  write_file(folder / "suites/s.yaml", kMinimal);
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder / "");
  const Suite suite = load_suite("suites/s.yaml", {{"policies", "[mine.yaml]"}});
  std::filesystem::current_path(before);
  EXPECT_TRUE(std::filesystem::equivalent(suite.policies.at(0).use, folder / "mine.yaml"));
}

TEST(Suite, AMistakeInAnOverrideIsSaidOfTheOverride) {
  const auto message = [](const Overrides& overrides) {
    return test::thrown_message<InputError>([&] { parse_suite(kMinimal, "s.yaml", overrides); });
  };
  EXPECT_SENTENCE(message({{"dt", "fast"}}));
  EXPECT_SENTENCE(message({{"seed", "7"}, {"fuse_ticks", "0"}, {"start", "act"}}));
  EXPECT_SENTENCE(message({{"perturbations", "[pussh]"}}));
  EXPECT_SENTENCE(message({{"policies", "[replay"}}));
  EXPECT_SENTENCE(message({{"seed.x", "1"}}));
  for (const char* key : {"dt", "fuse_ticks", "perturbations"})
    EXPECT_THAT(message({{key, "[]]"}}), Not(HasSubstr("s.yaml:")));
  // The file's own mistake stays the file's.
  EXPECT_SENTENCE(test::thrown_message<InputError>([] {
    parse_suite(std::string(kMinimal) + "dt: fast\n", "s.yaml", {{"seed", "7"}});
  }));
}

TEST(Suite, AFolderOfClipsIsTheFilesInIt) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "clips/more");
  write_file(folder / "clips/b.npz", "b");
  write_file(folder / "clips/more/a.npz", "a");
  write_file(folder / "clips/readme.txt", "no clip");
  std::filesystem::create_directory(folder / "empty");
  std::string text = kMinimal;
  const std::size_t at = text.find("clips:");
  text.replace(at, text.find('\n', at) - at, "clips: {files: [clips]}");
  write_file(folder / "s.yaml", text);
  EXPECT_EQ(load_suite(folder / "s.yaml").clips.files,
            (std::vector<std::string>{folder / "clips/b.npz", folder / "clips/more/a.npz"}));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] {
    load_suite(folder / "s.yaml", {{"clips.files", "[empty]"}});
  }));
}

TEST(Suite, ShippedSuitesLoad) {
  int suites = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::string(DUET_SOURCE_DIR) + "/suites")) {
    const Suite suite = load_suite(entry.path().string());
    EXPECT_EQ(read_file(entry.path().string()).front(), '#') << entry.path();  // what question it answers
    EXPECT_EQ(suite_hash(parse_suite(resolved_yaml(suite), "again.yaml")), suite_hash(suite)) << entry.path();
    ++suites;
  }
  EXPECT_GE(suites, 10);
}

// A second of motion.
PairedMotion second_long() {
  PairedMotion motion;
  motion.robot.rate_hz = 50.0;
  motion.robot.root.resize(50);
  motion.robot.q.resize(29, 50);
  return motion;
}

TEST(EpisodeCosts, TheWorkLeftIsThatOfEachEngineAtItsOwnCost) {
  const PairedMotion clip = second_long();
  const SuiteController vmc{"vmc"};
  EpisodeSpec quick, slow;
  for (EpisodeSpec* spec : {&quick, &slow}) {
    spec->clip = &clip;
    spec->controller = &vmc;
    spec->engine = spec == &quick ? "playback" : "mujoco";
  }
  EpisodeCosts costs;
  EXPECT_TRUE(std::isnan(costs.share_done()));
  for (int i = 0; i < 4; ++i) costs.expect(quick);
  for (int i = 0; i < 2; ++i) costs.expect(slow);
  for (int i = 0; i < 3; ++i) costs.ended(quick, 0.1);
  EXPECT_TRUE(std::isnan(costs.share_done())) << "nobody knows yet what an episode of mujoco costs";
  costs.ended(slow, 2.0);
  EXPECT_DOUBLE_EQ(costs.share_done(), 2.3 / (2.3 + 0.1 + 2.0));
  costs.ended(quick, 0.1);
  costs.ended(slow, 4.0);
  EXPECT_EQ(costs.share_done(), 1.0);
}

TEST(EpisodeCosts, AreToldApartByEngineAndController) {
  const SuiteController pd{"pd"};
  EpisodeSpec spec;
  spec.engine = "ode";
  spec.controller = &pd;
  EXPECT_EQ(cost_name(spec), "ode/pd");
}

}  // namespace
}  // namespace duet
