#include "duet/experiment/plan/shipped_suites.h"

#include <filesystem>
#include <sstream>

#include "duet/core/file.h"
#include "duet/core/share.h"
#include "duet/experiment/plan/run_identity.h"
#include "duet/experiment/work/run_work.h"
#include "duet/training/setup/demonstrations.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(ShippedSuites, AreFoundByName) {
  EXPECT_THAT(suite_file("demo"), ::testing::EndsWith("/suites/demo.yaml"));
  EXPECT_EQ(suite_file("nowhere.yaml"), "nowhere.yaml");  // a path: the reader says what is wrong with it
  EXPECT_EQ(suite_file("folder/demo"), "folder/demo");
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([] { suite_file("dmeo"); }),
              AllOf(HasSubstr("unknown suite 'dmeo': did you mean 'demo'?"), HasSubstr("or the path of a file")));
}

// The tree itself has folders called core, policies and controllers.
TEST(ShippedSuites, AFolderOfTheSameNameIsNoSuite) {
  const test::ScratchFolder folder;
  std::filesystem::create_directory(folder / "core");
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(folder / ".");
  const std::string found = suite_file("core");
  std::filesystem::current_path(before);
  EXPECT_THAT(found, ::testing::EndsWith("/suites/core.yaml"));
}

TEST(ShippedSuites, SayWhatTheyAsk) {
  const ShippedSuite reactivity = shipped_suite("reactivity");
  EXPECT_EQ(reactivity.question, "Does the robot act when its partner does?");
  EXPECT_THAT(reactivity.version, ::testing::StartsWith("hhoi-reactivity "));
  EXPECT_EQ(reactivity.episodes, 21 * 3 * 6 * 3);  // clips, tasks, shifts, two policies and the null arm
  for (const std::string& name : shipped_suite_names()) EXPECT_NE(shipped_suite(name).question, "") << name;
}

TEST(ShippedSuites, OneWithoutClipsOfItsOwnSaysSo) {
  EXPECT_TRUE(shipped_suite("real").clips_given);
  EXPECT_FALSE(shipped_suite("people").clips_given);
  EXPECT_EQ(shipped_suite("wbc_gates").episodes, 13 * 6 * 32);  // commands, perturbations, episodes
}

RunInfo info_of(const Suite& suite) {
  RunInfo info;
  info.suite = suite.name;
  info.suite_version = suite.version;
  info.suite_hash = suite_hash(suite);
  info.suite_yaml = resolved_yaml(suite);
  return info;
}

TEST(ShippedSuiteNote, TellsTheSuiteThatShipsFromOneUnderItsName) {
  const std::string file = suite_file("sealed");
  const RunInfo shipped = info_of(load_suite(file));
  EXPECT_EQ(shipped_suite_note(shipped), "as it ships (" + shipped.suite_hash.substr(0, 12) + ")");
  // Policies and engines are told by the rows.
  EXPECT_THAT(shipped_suite_note(info_of(load_suite(file, {{"policies", "[replay]"}, {"engines", "[playback]"}}))),
              ::testing::StartsWith("as it ships ("));
  const RunInfo easy =
      info_of(load_suite(file, {{"start", "act"}, {"max_root_speed", "1.5"}, {"clips.synth.per_task", "1"}}));
  EXPECT_THAT(shipped_suite_note(easy),
              AllOf(::testing::StartsWith("NOT the suite of that name that ships with this program: it differs in "
                                          "clips, max_root_speed, start ("),
                    HasSubstr(easy.suite_hash.substr(0, 12))));
}

TEST(ShippedSuiteNote, AHashThatNoKeyExplainsIsNotTheSuiteEither) {
  RunInfo info = info_of(load_suite(suite_file("sealed")));
  info.suite_hash = std::string(64, 'a');
  EXPECT_THAT(shipped_suite_note(info), HasSubstr("it differs in its robots, limits or detectors (aaaaaaaaaaaa)"));
  info.suite_yaml = "nothing";
  EXPECT_THAT(shipped_suite_note(info), ::testing::StartsWith("NOT the suite of that name"));
}

TEST(ShippedSuiteNote, ClipsThatWereGivenAreSaid) {
  const test::ScratchFolder folder;
  write_file(folder / "a.npz", "clip");
  const Suite suite = load_suite(suite_file("real"), {{"clips.files", "['" + (folder / "a.npz") + "']"}});
  EXPECT_THAT(shipped_suite_note(info_of(suite)),
              ::testing::StartsWith("as it ships but for its clips, which were given ("));
}

TEST(ShippedSuiteNote, OfASuiteOfOnesOwnIsEmpty) {
  RunInfo info = info_of(load_suite(suite_file("sealed")));
  info.suite = "mine";
  EXPECT_EQ(shipped_suite_note(info), "");
}

// Their digests were committed before the suite was run.
class SealedSuites : public ::testing::TestWithParam<std::pair<const char*, int>> {};  // and the clips of one of a task

TEST_P(SealedSuites, HaveTheClipsOfTheTestSplit) {
  Suite sealed = load_suite(suite_file(GetParam().first));
  sealed.tasks = {Task::kHandshake, Task::kFlyKiss};
  sealed.clips.synth_per_task = 1;
  Progress quiet(Progress::Style::kQuiet);
  std::istringstream lines(split_text(sealed, 1, quiet));
  const std::string split = read_text(share_file("test split", "policies/dstar/test_split.txt"));
  std::string line;
  EXPECT_TRUE(std::getline(lines, line) &&
              line.starts_with("# The clips of " + sealed.name + " " + sealed.version + ":"));
  int clips = 0;
  for (; std::getline(lines, line); ++clips) EXPECT_THAT(split, HasSubstr(line + "\n"));
  EXPECT_EQ(clips, GetParam().second);
}

INSTANTIATE_TEST_SUITE_P(Ship, SealedSuites,
                         ::testing::Values(std::pair{"sealed", 4}, std::pair{"sealed_varied", 2}),  // in either role
                         [](const auto& info) { return std::string(info.param.first); });

// Rows of before compare with those of now only where these stay.
TEST(ShippedSuites, OfBeforeKeepTheirHash) {
  const std::vector<std::pair<const char*, const char*>> hashes = {
      {"hard", "a2f7e6602240a9dac38ac2ddbcafc1530b9598375249bb6ab8bbdce8269b9f5d"},
      {"interaction", "97c52a3f0d100cbd91baee130fb98ed14d8061147072a6cc51b9c400250db23e"},
      {"policies", "a0d7db1cd6cea09d3fa91b04c73547d5274f0ca955b0d25a07edfb7a34820ac8"},
      {"partner", "0a9ca6f67e033ce5d731bf1c48113976a20f34b55ff6b9e57084f06f9841c2be"},
      {"reactivity", "0217e8d42b591219c44b7c1e12a7516a13c438c7eedac038acebfa5d9a526003"},
      {"sealed", "45a100d81a17789e5499fe37023812b2153ea321a9ddd7446054e95bd561ec8b"},
      {"spatial", "d92ceb7411507d78e567c54b1ca0377d2d8cafb77ae733889b472c079d47fbe9"},
      {"wbc_gates", "f137a5d4a1b110114915274b4fe478b1553dc045f5a8b630621a70c75c285257"}};
  for (const auto& [name, hash] : hashes) EXPECT_EQ(suite_hash(load_suite(suite_file(name))), hash) << name;
}

// Each level of the ladder has all that the ones before it have.
TEST(ShippedSuites, TheLevelsOfHardGoUp) {
  const Suite suite = load_suite(suite_file("hard"));
  int level = 0;
  for (const Perturbation& perturbation : suite.perturbations) {
    if (perturbation.name == kCleanName) continue;
    EXPECT_EQ(perturbation.tags.at("level"), std::to_string(++level)) << perturbation.name;
  }
  EXPECT_EQ(level, 8);
  for (std::size_t i = 2; i < suite.perturbations.size(); ++i) {
    const Perturbation &easier = suite.perturbations[i - 1], &harder = suite.perturbations[i];
    const PartnerVariation &one = *easier.partner, &two = *harder.partner;
    EXPECT_GE(two.hesitate_s, one.hesitate_s) << harder.name;
    EXPECT_GE(two.comes_m.value_or(0.0), one.comes_m.value_or(0.0)) << harder.name;
    EXPECT_GE(two.moves_on_m.value_or(0.0), one.moves_on_m.value_or(0.0)) << harder.name;
    EXPECT_GE(two.other_hand.value_or(false), one.other_hand.value_or(false)) << harder.name;
    EXPECT_GE(harder.perception.jitter, easier.perception.jitter) << harder.name;
    EXPECT_GE(harder.perception.latency_ms, easier.perception.latency_ms) << harder.name;
    EXPECT_NE(to_yaml(harder).substr(harder.name.size()), to_yaml(easier).substr(easier.name.size())) << harder.name;
  }
}

// Every rung is there under both actuators, and no two of its episodes are the same: what is sensed is noisy.
TEST(ShippedSuites, TheRungsOfTheArenaAreTheSameUnderBothActuators) {
  const Suite suite = load_suite(suite_file("arena"));
  std::map<std::string, std::vector<std::string>> rungs;
  for (const Perturbation& perturbation : suite.perturbations) {
    EXPECT_THAT(to_yaml(perturbation), HasSubstr("noise: {q: 0.01, v: 0.2, w: 0.1, gravity: 0.02}"))
        << perturbation.name;
    const bool is_explicit = perturbation.actuation.has_value();
    EXPECT_EQ(perturbation.tags.at("actuation"), is_explicit ? "explicit" : "implicit") << perturbation.name;
    for (const SuiteReference& reference : suite.references) {
      const std::vector<std::string>& under = reference.perturbations;
      if (!under.empty() && std::ranges::find(under, perturbation.name) == under.end()) continue;
      const Tags& tags = perturbation.tags.contains("rung") ? perturbation.tags : reference.tags;
      rungs[perturbation.tags.at("actuation")].push_back(tags.at("rung") + " " + tags.at("rung_name"));
    }
  }
  EXPECT_EQ(rungs["implicit"].size(), 7U);
  EXPECT_EQ(rungs["explicit"], rungs["implicit"]);
}

TEST(ShippedSuites, FirstSentenceEndsAtAFullStopOrAQuestionMark) {
  EXPECT_EQ(first_sentence("# Who,\n# when? Then more.\nschema: x\n# Later.\n"), "Who, when?");
  EXPECT_EQ(first_sentence("# Version 1.2 of it. More.\n"), "Version 1.2 of it.");
  EXPECT_EQ(first_sentence("# no end\n"), "no end");
  EXPECT_EQ(first_sentence("schema: x\n"), "");
}

TEST(ShippedSuites, DrawNoClipThatNetworksLearntOn) {
  for (const std::string& name : shipped_suite_names()) {
    const Suite suite = load_suite(suite_file(name));
    for (const std::uint64_t seed : {kDemonstrationSeed, kValidationSeed, kTrainingSeed})
      EXPECT_NE(suite.clips.synth_seed, seed) << name;
  }
}

}  // namespace
}  // namespace duet
