#include "duet/bench/shipped_suites.h"

#include <filesystem>

#include "duet/bench/demonstrations.h"
#include "duet/bench/training_motions.h"
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
