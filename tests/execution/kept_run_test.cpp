// Runs that moved or lost what they were made from.
#include <gmock/gmock.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/clips.h"
#include "duet/experiment/plan/embodiments.h"
#include "duet/experiment/suite/profile.h"
#include "duet/report/ranking/golden.h"
#include "tests/execution/verified_run.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

using test::make_run;
using test::objection;
using test::replace_in;
using ::testing::AllOf;
using ::testing::HasSubstr;

// A suite with everything that a suite can name by its place.
class KeptRun : public testing::Test {
 protected:
  void SetUp() override {
    const auto robot = test::g1();
    save_paired_motion(test::paired(Task::kWave, *robot), scratch_ / "here/wave.npz");
    save_paired_motion(test::paired(Task::kHandshake, *robot), scratch_ / "here/shake.npz");
    const std::string examples = std::string(DUET_SOURCE_DIR) + "/examples/policies/";
    for (const char* file : {"wave_policy.yaml", "wave_policy.py", "duet_policy.py"})
      fs::copy(examples + file, scratch_ / (std::string("here/") + file));
    fs::copy(share_file("limits", "metrics/limits/iso_ts_15066.yaml"), scratch_ / "here/limits.yaml");
    write_file(scratch_ / "here/mine.safetensors",
               padded(read_file(share_file("network", "policies/dstar/dp.safetensors"))));
    write_file(scratch_ / "here/suite.yaml",
               "schema: duet.suite/1\nname: kept\nversion: 1.0.0\nclips: {files: [wave.npz, shake.npz]}\n"
               "tasks: [wave, handshake]\nengines: [playback]\ncontrollers: [pd]\nstart: clip\npartner: solid\n"
               "contact_limits: limits.yaml\n"
               "policies: [replay, {name: mine, use: dp, network: mine.safetensors}]\n");
  }

  // The same network in other bytes: a header of safetensors may end with spaces.
  static std::string padded(std::string file) {
    std::uint64_t length = 0;
    std::memcpy(&length, file.data(), sizeof length);
    file.insert(sizeof length + length, 8, ' ');
    length += 8;
    std::memcpy(file.data(), &length, sizeof length);
    return file;
  }

  test::ScratchFolder scratch_;
};

TEST_F(KeptRun, HoldsWhatItWasMadeFrom) {
  make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
  const std::string yaml = read_file(scratch_ / "run/suite.yaml");
  EXPECT_THAT(yaml, AllOf(HasSubstr("inputs/clips/0000_wave.npz"), HasSubstr("inputs/contact_limits.yaml")));
  EXPECT_EQ(yaml.find("\"/"), std::string::npos) << yaml;  // no place of this machine
  EXPECT_EQ(read_file(scratch_ / "run/inputs/clips/0001_shake.npz"), read_file(scratch_ / "here/shake.npz"));
  const nlohmann::json index = nlohmann::json::parse(read_file(scratch_ / "run/inputs/inputs.json"));
  EXPECT_EQ(index.at("schema"), "duet.inputs/1");
  EXPECT_EQ(index.at("files").size(), 4U);
  EXPECT_EQ(index.at("files").at(3).at("of"), "policy mine");
  EXPECT_EQ(index.at("files").at(3).at("kept"), false);
}

// A card that a controller's descriptor names by a path is found from the descriptor's folder alone: it is kept, too.
TEST_F(KeptRun, ADescriptorIsKeptWithACardOfItsOwn) {
  fs::create_directories(scratch_ / "here/cards");
  for (const char* file : {"g1.yaml", "g1.urdf"})
    fs::copy(std::string(DUET_SOURCE_DIR) + "/robots/g1/" + file, scratch_ / (std::string("here/cards/") + file));
  std::string text = read_file(std::string(DUET_SOURCE_DIR) + "/controllers/descriptors/twist2.yaml");
  write_file(scratch_ / "here/plain.yaml", text);
  text.replace(text.find("robot: g1_twist2"), 16, "robot: cards/g1.yaml");
  write_file(scratch_ / "here/mine.yaml", text);
  write_file(scratch_ / "here/twist2_1017_20k.onnx", "a network");
  Suite suite = load_suite(scratch_ / "here/suite.yaml");
  suite.controllers = {{"mine", scratch_ / "here/mine.yaml", {}}, {"plain", scratch_ / "here/plain.yaml", {}}};
  const ArchivedSuite kept = archive_inputs(suite, scratch_ / "run");
  EXPECT_EQ(kept.suite.controllers[0].use, "inputs/controllers/mine/mine.yaml");
  EXPECT_EQ(kept.suite.controllers[1].use, "inputs/controllers/plain/plain.yaml");
  fs::create_directories(scratch_ / "run");
  keep_inputs(kept, scratch_ / "run");
  fs::remove_all(scratch_ / "here/cards");
  const std::string mine = scratch_ / "run/inputs/controllers/mine/";
  Suite elsewhere = suite;
  elsewhere.controllers[0].use = mine + "mine.yaml";
  EXPECT_EQ(elsewhere.card_of(elsewhere.controllers[0]), mine + "cards/g1.yaml");
  EXPECT_EQ(load_robot(mine + "cards/g1.yaml").name, "g1");  // with its URDF
}

// A descriptor's network is where this machine has it, not where the other had it.
TEST_F(KeptRun, ADescriptorFindsItsNetworkAmongWhatIsShared) {
  fs::create_directories(scratch_ / "there/models");
  fs::create_directories(scratch_ / "run");
  write_file(scratch_ / "there/models/twist2_1017_20k.onnx", "a network");
  fs::copy(std::string(DUET_SOURCE_DIR) + "/controllers/descriptors/twist2.yaml", scratch_ / "here/plain.yaml");
  Suite suite = load_suite(scratch_ / "here/suite.yaml");
  suite.policies = {{"replay", "replay", {}}};
  suite.controllers = {{"plain", scratch_ / "here/plain.yaml", {}}};
  const char* shared = std::getenv("DUET_SHARED");
  const std::string before = shared == nullptr ? "" : shared;
  setenv("DUET_SHARED", (scratch_ / "there").c_str(), 1);
  const ArchivedSuite kept = archive_inputs(suite, scratch_ / "run");
  keep_inputs(kept, scratch_ / "run");
  fs::rename(scratch_ / "there", scratch_ / "elsewhere");
  setenv("DUET_SHARED", (scratch_ / "elsewhere").c_str(), 1);
  duet::Run run;
  run.path = scratch_ / "run";
  run.info.suite_yaml = resolved_yaml(kept.suite);
  EXPECT_EQ(suite_of_run(run).controllers[0].options.at("network"), scratch_ / "elsewhere/models/twist2_1017_20k.onnx");
  before.empty() ? unsetenv("DUET_SHARED") : setenv("DUET_SHARED", before.c_str(), 1);
}

TEST_F(KeptRun, IsVerifiedElsewhereWithoutTheOriginals) {
  make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
  fs::rename(scratch_ / "run", scratch_ / "elsewhere");
  fs::copy(scratch_ / "here/mine.safetensors", scratch_ / "elsewhere/mine.safetensors");  // networks go with it
  fs::remove_all(scratch_ / "here");
  EXPECT_EQ(objection(scratch_ / "elsewhere"), "");
}

TEST_F(KeptRun, FindsAnotherNamesNetworkAmongTheModels) {
  make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
  fs::rename(scratch_ / "here/mine.safetensors", scratch_ / "mine.safetensors");
  fs::remove_all(scratch_ / "here");
  EXPECT_SENTENCE(objection(scratch_ / "run"));
  setenv("DUET_MODELS", (scratch_ / "").c_str(), 1);
  EXPECT_EQ(objection(scratch_ / "run"), "");
  unsetenv("DUET_MODELS");
}

TEST_F(KeptRun, ANetworkThatChangedIsNamedWithBothDigests) {
  make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
  const std::string before = sha256_file(scratch_ / "here/mine.safetensors");
  write_file(scratch_ / "here/mine.safetensors", "other weights");
  EXPECT_THAT(objection(scratch_ / "run"),
              AllOf(HasSubstr("expected SHA-256 " + before),
                    HasSubstr("found " + sha256_hex("other weights") + " in " + (scratch_ / "here/mine.safetensors"))));
}

TEST_F(KeptRun, AKeptFileThatChangedIsNamedWithBothDigests) {
  make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
  write_file(scratch_ / "run/inputs/contact_limits.yaml", "changed");
  EXPECT_THAT(objection(scratch_ / "run"),
              AllOf(HasSubstr("inputs/contact_limits.yaml: SHA-256 expected "), HasSubstr(sha256_hex("changed"))));
}

TEST_F(KeptRun, KeepsADescriptorWithTheProgramBesideIt) {
  Suite suite = load_suite(scratch_ / "here/suite.yaml", {{"policies", "[wave_policy.yaml]"}});
  const ArchivedSuite kept = archive_inputs(suite, scratch_ / "run");
  const std::string place = "inputs/policies/" + suite.policies[0].name + "/";
  EXPECT_EQ(kept.suite.policies[0].use, place + "wave_policy.yaml");
  keep_inputs(kept, scratch_ / "run");
  EXPECT_TRUE(fs::exists(scratch_ / ("run/" + place + "wave_policy.py")));
  EXPECT_TRUE(fs::exists(scratch_ / ("run/" + place + "duet_policy.py")));  // which it imports
}

// Recordings that may not be passed on: others read the rows, and who has the recordings repeats them.
class PublishedWithoutClips : public KeptRun {
 protected:
  void SetUp() override {
    KeptRun::SetUp();
    make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
    publish_run(scratch_ / "run", scratch_ / "published", published_inputs(scratch_ / "run", true));
    fs::copy(scratch_ / "here/mine.safetensors", scratch_ / "published/mine.safetensors");
    fs::create_directories(scratch_ / "elsewhere/below");
    fs::copy(scratch_ / "here/wave.npz", scratch_ / "elsewhere/renamed.npz");
    fs::rename(scratch_ / "here/shake.npz", scratch_ / "elsewhere/below/shake.npz");
    fs::remove_all(scratch_ / "here");
    fs::remove_all(scratch_ / "run");
  }
};

TEST_F(PublishedWithoutClips, HasItsRowsAndNoClip) {
  EXPECT_FALSE(fs::exists(scratch_ / "published/inputs/clips"));
  EXPECT_TRUE(fs::exists(scratch_ / "published/inputs/contact_limits.yaml"));
  EXPECT_FALSE(load_run(scratch_ / "published").rows.empty());
  for (const RunInput& input : read_inputs(scratch_ / "published")) EXPECT_EQ(input.kept, input.of == "contact_limits");
}

TEST_F(PublishedWithoutClips, IsRepeatedByWhoHasThem) {
  EXPECT_EQ(objection(scratch_ / "published", scratch_ / "elsewhere"), "");
}

TEST_F(PublishedWithoutClips, SaysWhichClipIsMissing) {
  const std::string digest = sha256_file(scratch_ / "elsewhere/renamed.npz");
  EXPECT_THAT(objection(scratch_ / "published"),
              AllOf(HasSubstr("is without its clips: expected inputs/clips/0000_wave.npz with the SHA-256 " + digest),
                    HasSubstr("found none; say where they are with --clips")));
  write_file(scratch_ / "elsewhere/renamed.npz", "another clip");
  EXPECT_THAT(objection(scratch_ / "published", scratch_ / "elsewhere"),
              AllOf(HasSubstr(digest), HasSubstr("found none below '" + (scratch_ / "elsewhere") + "'")));
  fs::create_directories(scratch_ / "empty");
  EXPECT_THAT(objection(scratch_ / "published", scratch_ / "empty"), HasSubstr("empty': expected the clips of"));
}

TEST_F(PublishedWithoutClips, AnotherClipInItsPlaceIsRefused) {
  write_file(scratch_ / "published/inputs/clips/0000_wave.npz", "another clip");
  EXPECT_THAT(objection(scratch_ / "published"),
              AllOf(HasSubstr("0000_wave.npz: SHA-256 expected " + sha256_file(scratch_ / "elsewhere/renamed.npz")),
                    HasSubstr("found " + sha256_hex("another clip"))));
}

TEST_F(KeptRun, AnotherNetworkUnderOneNameIsNotResumed) {
  const Suite suite = load_suite(scratch_ / "here/suite.yaml");
  make_run(suite, scratch_ / "run");
  fs::copy_file(share_file("network", "policies/dstar/dstar.safetensors"), scratch_ / "here/mine.safetensors",
                fs::copy_options::overwrite_existing);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { make_run(suite, scratch_ / "run"); }));
}

TEST_F(KeptRun, ARunKilledBeforeItsInputsWereKeptGoesOn) {
  const Suite suite = load_suite(scratch_ / "here/suite.yaml", {{"policies", "[replay]"}});
  make_run(suite, scratch_ / "run");
  fs::remove_all(scratch_ / "run/inputs");
  fs::remove(scratch_ / "run/episodes.jsonl");
  make_run(suite, scratch_ / "run");
  EXPECT_EQ(objection(scratch_ / "run"), "");
}

TEST_F(KeptRun, OtherPoliciesThanTheFoldersAreRefused) {
  make_run(load_suite(scratch_ / "here/suite.yaml", {{"policies", "[replay]"}}), scratch_ / "run");
  const Suite other = load_suite(scratch_ / "here/suite.yaml", {{"policies", "[replay_dense]"}});
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { make_run(other, scratch_ / "run"); }));
}

TEST_F(KeptRun, NothingIsWrittenThroughALinkInTheFolder) {
  const Suite suite = load_suite(scratch_ / "here/suite.yaml");
  make_run(suite, scratch_ / "run");
  fs::remove_all(scratch_ / "run/inputs");
  fs::create_directory(scratch_ / "away");
  fs::create_symlink(scratch_ / "away", scratch_ / "run/inputs");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { make_run(suite, scratch_ / "run"); }));
  EXPECT_TRUE(fs::is_empty(scratch_ / "away"));
}

// Pages show clips: of the run, and of nobody's else.
TEST_F(KeptRun, AFileInThePlaceOfAKeptOneIsRefused) {
  make_run(load_suite(scratch_ / "here/suite.yaml", {{"policies", "[replay]"}}), scratch_ / "run");
  const std::string suite = read_file(scratch_ / "run/suite.yaml");
  const auto refusal = [&](const std::string& from, const std::string& to) {
    write_file(scratch_ / "run/suite.yaml", suite);
    replace_in(scratch_ / "run/suite.yaml", from, to);
    return test::thrown_message<InputError>([&] { suite_of_head(load_run(scratch_ / "run")); });
  };
  EXPECT_SENTENCE(refusal("inputs/clips/0000_wave.npz", "../here/wave.npz"));
  EXPECT_SENTENCE(refusal("inputs/contact_limits.yaml", scratch_ / "here/limits.yaml"));
  write_file(scratch_ / "run/suite.yaml", suite);
  const duet::Run run = load_run(scratch_ / "run");
  EXPECT_EQ(clips_fault(run, suite_of_head(run).clips.files), "");
  fs::remove(scratch_ / "run/inputs/inputs.json");  // and with it what the clips are to be
  replace_in(scratch_ / "run/suite.yaml", "contact_limits: \"inputs/contact_limits.yaml\"\n", "");
  EXPECT_SENTENCE(clips_fault(run, suite_of_head(load_run(scratch_ / "run")).clips.files));
}

TEST_F(KeptRun, PublishesNoFileThatItsIndexDoesNotName) {
  make_run(load_suite(scratch_ / "here/suite.yaml", {{"policies", "[replay]"}}), scratch_ / "run");
  write_file(scratch_ / "run/inputs/x.txt", "secret");
  const PublishedInputs inputs = published_inputs(scratch_ / "run", false);
  EXPECT_THAT(inputs.files, testing::ElementsAre("inputs/clips/0000_wave.npz", "inputs/clips/0001_shake.npz",
                                                 "inputs/contact_limits.yaml"));
  write_file(scratch_ / "run/inputs/contact_limits.yaml", "secret");
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { published_inputs(scratch_ / "run", false); }));
}

TEST_F(KeptRun, PreparedClipsAreRemovedAndNothingElse) {
  const std::string mine = scratch_ / "run/prepared/notes.txt",
                    made = scratch_ / "run/prepared/0123456789abcdef0123456789abcdef.npz";
  write_file(mine, "mine");
  write_file(made, "made");
  remove_prepared_clips(scratch_ / "run");
  EXPECT_FALSE(fs::exists(made));
  EXPECT_EQ(read_file(mine), "mine");
  fs::remove(mine);
  remove_prepared_clips(scratch_ / "run");
  EXPECT_FALSE(fs::exists(scratch_ / "run/prepared"));
}

TEST_F(KeptRun, AnIndexThatLeadsOutOfTheFolderIsRefused) {
  make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
  replace_in(scratch_ / "run/inputs/inputs.json", "inputs/contact_limits.yaml", "../here/limits.yaml");
  EXPECT_SENTENCE(objection(scratch_ / "run"));
}

// The blessed figures of results/golden, made again by this build: `duet run results/golden/suite.yaml -o RUN` and
// `duet bless RUN -o results/golden/baseline.json` where they change on purpose.

TEST(GoldenRun, AgreesWithTheBlessedBaseline) {
#ifdef DUET_SANITIZED
  GTEST_SKIP() << "not run: blessed with GCC; contact amplifies the last bits of another compiler's sums";
#endif
  const std::string folder = std::string(DUET_SOURCE_DIR) + "/results/golden/";
  const Suite suite = load_suite(folder + "suite.yaml");
  for (const std::string& engine : suite.engines)
    if (!can_run_in(engine)) GTEST_SKIP() << "not run: " << engine << " absent";
  const test::ScratchFolder scratch;
  Progress quiet(Progress::Style::kQuiet);
  RunOptions options;
  options.threads = 2;
  EXPECT_EQ(run_suite(suite, scratch / "run", options, quiet).end, RunEnd::kComplete);
  const duet::Run run = load_run(scratch / "run");
  for (const GoldenDifference& difference : check(read_file(folder + "baseline.json"), leaderboard(run.rows), run.info))
    ADD_FAILURE() << difference.where << ": expected " << difference.expected << ", found " << difference.found;
}

}  // namespace
}  // namespace duet
