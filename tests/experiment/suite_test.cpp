#include "duet/experiment/suite/suite.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::AllOf;
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
  EXPECT_EQ(suite.partner, PartnerMode::kGhost);
  EXPECT_EQ(suite.detector, DetectorVersion::kRobot);
  EXPECT_EQ(suite.start, SuiteStart::kAuto);
  EXPECT_TRUE(suite.null_arm);
  EXPECT_EQ(suite.profile.name, "parity");
  EXPECT_EQ(suite.profile.settings("mujoco").dt, 0.002);
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
  EXPECT_THAT(refusal("tassks: [hug]\n"), AllOf(HasSubstr("s.yaml:8"), HasSubstr("tassks"), HasSubstr("tasks")));
  EXPECT_THAT(refusal("tasks: [hugg]\n"), AllOf(HasSubstr("s.yaml:8"), HasSubstr("did you mean 'hug'")));
  EXPECT_THAT(refusal("partner: ghots\n"), HasSubstr("did you mean 'ghost'"));
  EXPECT_THAT(refusal("readings: {metrics.larg_angle: entry}\n"), HasSubstr("large_angle"));
  EXPECT_THAT(refusal("retarget: {kernell: v3}\n"), HasSubstr("kernel"));
  EXPECT_THAT(refusal("limits: {wall: 3}\n"), HasSubstr("wall_s_per_episode"));
}

TEST(Suite, UnknownEngineControllerAndPolicyAreRefused) {
  std::string yaml = kMinimal;
  yaml.replace(yaml.find("playback"), 8, "mujocco");
  EXPECT_THAT(refusal("", yaml), HasSubstr("engine 'mujocco'"));
  yaml = kMinimal;
  yaml.replace(yaml.find("[pd]"), 4, "[vcm]");
  EXPECT_THAT(refusal("", yaml), AllOf(HasSubstr("controller 'vcm'"), HasSubstr("vmc")));
  yaml = kMinimal;
  yaml.replace(yaml.find("[replay]"), 8, "[]");
  EXPECT_THAT(refusal("", yaml), HasSubstr("at least one policy"));
}

TEST(Suite, ValuesOutOfRangeAreRefused) {
  EXPECT_THAT(refusal("dt: 0.003\n"), HasSubstr("divides 0.02"));
  EXPECT_THAT(refusal("dt: -1\n"), HasSubstr("divides 0.02"));
  EXPECT_THAT(refusal("episodes_per_clip: 0\n"), HasSubstr("expected a whole number, 1 to 2147483647, found 0"));
  EXPECT_THAT(refusal("episodes_per_clip: 1.5\n"), HasSubstr("whole number"));
  EXPECT_THAT(refusal("start_radius: 9\n"), HasSubstr("start_radius: expected a number from 0, at most 5 m, found 9"));
  EXPECT_THAT(refusal("fuse_ticks: 91\n"), HasSubstr("fuse_ticks: expected a whole number, 1 to 90, found 91"));
  EXPECT_THAT(refusal("limits: {wall_s_per_episode: 0}\n"),
              HasSubstr("wall_s_per_episode: expected a number above 0, at most 1e+06 s, found 0"));
  EXPECT_THAT(refusal("seed: -4\n"), HasSubstr("expected a whole number, 0 to 9000000000000000, found -4"));
}

TEST(Suite, BrokenDocumentsAreRefused) {
  EXPECT_THAT(refusal("", "[1, 2"), HasSubstr("s.yaml:"));
  EXPECT_THAT(refusal("", ""), HasSubstr("expected a suite"));
  EXPECT_THAT(refusal("", "name: x\n"), HasSubstr("schema"));
  EXPECT_THAT(refusal("", "schema: duet.suite/9\nname: x\nversion: 1\n"), HasSubstr("duet.suite/9"));
  std::string both = kMinimal;
  both.replace(both.find("{synth: {per_task: 2}}"), 22, "{synth: {per_task: 2}, files: [a.npz]}");
  EXPECT_THAT(refusal("", both), HasSubstr("found both"));
  EXPECT_THAT(test::thrown_message<InputError>([] { load_suite("nowhere.yaml"); }), HasSubstr("nowhere.yaml"));
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
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { (void)suite.controller("plian"); }),
              HasSubstr("did you mean 'plain'"));
}

TEST(Suite, ControllersThatAreNotOnesAreRefused) {
  EXPECT_THAT(refusal("", with_controllers("[{name: x, use: vcm}]")), AllOf(HasSubstr("s.yaml:6"), HasSubstr("vmc")));
  EXPECT_THAT(refusal("", with_controllers("[{nmae: pd}]")), HasSubstr("name"));
  EXPECT_THAT(refusal("", with_controllers("[{use: pd}]")), HasSubstr("name"));
  EXPECT_THAT(refusal("", with_controllers("[pd, {name: pd, use: vmc}]")), HasSubstr("'pd' is there twice"));
  EXPECT_THAT(refusal("", with_controllers("[{name: 'a/b', use: pd}]")), HasSubstr("letters, digits"));
  EXPECT_THAT(refusal("", with_controllers("[{name: pd, options: {waist: locked}}]")), HasSubstr("waist"));
  EXPECT_THAT(refusal("", with_controllers("[{name: pd, options: [1]}]")), HasSubstr("expected a mapping"));
  EXPECT_THAT(refusal("", with_controllers("[]")), HasSubstr("at least one controller"));
  Suite suite = parse_suite(kMinimal, "s.yaml");
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { set_controller_option(suite, "pd", "network", "x"); }),
              HasSubstr("controller 'pd': expected no option, found 'network'"));
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { set_controller_option(suite, "vmc", "network", "x"); }),
              HasSubstr("unknown controller 'vmc'"));
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
  EXPECT_THAT(refusal("", with_synth("{per_task: 2, like: robots}")), HasSubstr("'robots'"));
}

TEST(Suite, VariantsThatCannotBeAreRefused) {
  const auto with = [](const std::string& list) {
    return refusal("", with_synth("{per_task: 1, variants: " + list + "}"));
  };
  EXPECT_THAT(with("[{name: low, target_height: 0.9}]"),
              AllOf(HasSubstr("s.yaml:4"), HasSubstr("target_height 0.9 m")));
  EXPECT_THAT(with("[{name: a, outcome: aborted}]"), HasSubstr("outcome are of clips like people"));
  EXPECT_THAT(with("[{name: a, outcome: lost}]"), HasSubstr("unknown outcome 'lost'"));
  EXPECT_THAT(with("[{name: a, distance: 1}]"), HasSubstr("distance 1 m is out of range; expected [2, 5] m"));
  EXPECT_THAT(with("[{name: a, side: up}]"), HasSubstr("unknown side 'up'"));
  EXPECT_THAT(with("[{name: a}]"), HasSubstr("expected side, target_height, distance or outcome, found none"));
  EXPECT_THAT(with("[{side: left}]"), HasSubstr("name"));
  EXPECT_THAT(with("[{name: 'a b', side: left}]"), HasSubstr("letters, digits"));
  EXPECT_THAT(with("[{name: a, side: left}, {name: a, side: right}]"), HasSubstr("'a' is there twice"));
  EXPECT_THAT(with("3"), HasSubstr("expected a list"));
  EXPECT_THAT(refusal("", with_synth("{per_task: 1, variants: [{name: a, target_height: 1}]}", "[bend]")),
              HasSubstr("bend has no target_height"));
}

TEST(Suite, ARobotThatIsNotThereIsRefusedByItsName) {
  EXPECT_THAT(test::thrown_message<InputError>([] { parse_suite(std::string(kMinimal) + "robot: g0\n", "s.yaml"); }),
              AllOf(HasSubstr("s.yaml:"), HasSubstr("robot"), HasSubstr("'g0'"), HasSubstr("g1")));
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
  EXPECT_THAT(message({{"dt", "fast"}}), testing::StartsWith("override 'dt=fast': suite: 'dt': expected"));
  EXPECT_THAT(message({{"seed", "7"}, {"fuse_ticks", "0"}, {"start", "act"}}),
              testing::StartsWith("override 'fuse_ticks=0': "));
  EXPECT_THAT(message({{"perturbations", "[pussh]"}}), testing::StartsWith("override 'perturbations=[pussh]': "));
  EXPECT_THAT(message({{"policies", "[replay"}}), testing::StartsWith("override 'policies=[replay': "));
  EXPECT_THAT(message({{"seed.x", "1"}}), testing::StartsWith("override 'seed.x=1': "));
  for (const char* key : {"dt", "fuse_ticks", "perturbations"})
    EXPECT_THAT(message({{key, "[]]"}}), Not(HasSubstr("s.yaml:")));
  // The file's own mistake stays the file's.
  EXPECT_THAT(test::thrown_message<InputError>([] {
                parse_suite(std::string(kMinimal) + "dt: fast\n", "s.yaml", {{"seed", "7"}});
              }),
              testing::StartsWith("s.yaml:"));
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
  EXPECT_THAT(test::thrown_message<InputError>([&] {
                load_suite(folder / "s.yaml", {{"clips.files", "[empty]"}});
              }),
              HasSubstr("empty' holds no .npz file"));
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

}  // namespace
}  // namespace duet
