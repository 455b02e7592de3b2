// Runs that somebody changed: each is refused, and what is wrong is named.
#include "bench/verification.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <functional>
#include <sstream>

#include "bench/clips.h"
#include "bench/run_inputs.h"
#include "bench/runner.h"
#include "core/digest.h"
#include "core/file.h"
#include "core/require.h"
#include "core/share.h"
#include "tests/bench/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

// One sentence of what `duet verify --all` has against a run; "" where it has nothing.
std::string objection(const std::string& folder) {
  Progress quiet(Progress::Style::kQuiet);
  try {
    const Verification found = verify_run(load_run(folder), {.all = true, .threads = 2}, quiet);
    if (!found.faults.empty()) return found.faults.front();
    if (!found.missing.empty()) return found.missing.front();
    for (const RepeatedEpisode& repeat : found.repeats)
      if (!repeat.differences.empty()) return "differs: " + differences_text(repeat.differences);
    return "";
  } catch (const std::exception& error) {
    return error.what();
  }
}

void make_run(const Suite& suite, const std::string& folder) {
  Progress quiet(Progress::Style::kQuiet);
  RunOptions options;
  options.threads = 2;
  run_suite(suite, folder, options, quiet);
}

void replace_in(const std::string& file, const std::string& from, const std::string& to) {
  std::string text = read_file(file);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from;
  write_file(file, text.replace(at, from.size(), to));
}

class ForgedRun : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    honest_ = new test::ScratchFolder();
    make_run(test::playback_suite(), *honest_ / "run");
  }
  static void TearDownTestSuite() { delete honest_; }
  void SetUp() override { fs::copy(*honest_ / "run", run_, fs::copy_options::recursive); }

  // Changes rows, and their keys with them where `with_key`.
  void forge(const std::function<void(EpisodeRow&)>& change, bool with_key = true) {
    std::string text;
    for (EpisodeRow row : load_run(run_).rows) {
      change(row);
      if (with_key) row.key = episode_key(row);
      text += to_json(row).dump() + "\n";
    }
    write_file(run_ + "/episodes.jsonl", text);
  }
  // Of the policy, not of the null arm.
  void forge_main(const std::function<void(EpisodeRow&)>& change) {
    forge([&](EpisodeRow& row) {
      if (row.arm == "main") change(row);
    });
  }
  std::vector<std::string> lines() {
    std::istringstream file(read_file(run_ + "/episodes.jsonl"));
    std::vector<std::string> lines;
    for (std::string line; std::getline(file, line);) lines.push_back(line);
    return lines;
  }
  void write(const std::vector<std::string>& lines) {
    std::string text;
    for (const std::string& line : lines) text += line + "\n";
    write_file(run_ + "/episodes.jsonl", text);
  }

  test::ScratchFolder scratch_;
  std::string run_ = scratch_ / "run";

 private:
  static test::ScratchFolder* honest_;
};
test::ScratchFolder* ForgedRun::honest_ = nullptr;

TEST_F(ForgedRun, ThatNobodyForgedPasses) { EXPECT_EQ(objection(run_), ""); }

TEST_F(ForgedRun, SuccessFlipped) {
  forge_main([](EpisodeRow& row) { row.success = !row.success.value(); });
  EXPECT_THAT(objection(run_), AllOf(StartsWith("differs: "), HasSubstr("success: ")));
}

TEST_F(ForgedRun, MetricChangedInItsLastDigit) {
  forge_main([](EpisodeRow& row) { row.metrics.begin()->second *= 1.0 + 1e-15; });
  EXPECT_THAT(objection(run_), StartsWith("differs: metrics."));
}

TEST_F(ForgedRun, MetricDropped) {
  forge_main([](EpisodeRow& row) { row.metrics.erase(row.metrics.begin()); });
  EXPECT_THAT(objection(run_), AllOf(StartsWith("differs: metrics."), HasSubstr(": nothing, ")));
}

TEST_F(ForgedRun, VerdictChanged) {
  forge_main([](EpisodeRow& row) { row.verdicts.front().success = !row.verdicts.front().success; });
  EXPECT_THAT(objection(run_), StartsWith("differs: verdicts.0.success: "));
}

TEST_F(ForgedRun, ForceAndContactAdded) {
  forge_main([](EpisodeRow& row) {
    row.forces["human.peak_n"] = 12.0;
    row.contact_peak_n = 12.0;
  });
  EXPECT_THAT(objection(run_), AllOf(HasSubstr("contact_peak_n: 12.0, 0.0"), HasSubstr("forces.human.peak_n: 12.0")));
}

TEST_F(ForgedRun, OutcomeMadeWorse) {
  forge_main([](EpisodeRow& row) { row.outcome = Outcome::kFell; });
  EXPECT_THAT(objection(run_), HasSubstr("outcome: \"fell\", \"ok\""));
}

TEST_F(ForgedRun, AnyFieldChangedWithoutItsKey) {
  forge([](EpisodeRow& row) { row.policy = "mine"; }, false);
  EXPECT_THAT(objection(run_), AllOf(HasSubstr("episodes.jsonl:1: key 'key': expected "), HasSubstr("was changed")));
}

TEST_F(ForgedRun, PolicyRenamed) {
  forge_main([](EpisodeRow& row) { row.policy = "my_great_policy"; });
  EXPECT_THAT(objection(run_), HasSubstr("my_great_policy clean (main arm): is no episode of the suite"));
}

TEST_F(ForgedRun, PolicyRenamedInSuiteAndRunToo) {
  forge_main([](EpisodeRow& row) { row.policy = "my_great_policy"; });
  replace_in(run_ + "/suite.yaml", "policies: [replay]", "policies: [my_great_policy]");
  replace_in(run_ + "/run.json", "\"replay\"", "\"my_great_policy\"");
  EXPECT_THAT(objection(run_), HasSubstr("unknown policy 'my_great_policy'"));
}

TEST_F(ForgedRun, PolicyOfAnotherDigest) {
  forge_main([](EpisodeRow& row) { row.policy_digest = std::string(64, 'a'); });
  EXPECT_THAT(objection(run_), HasSubstr("and aaaaaaaaaaaa in"));
  std::string json = read_file(run_ + "/run.json");
  const std::string digest = nlohmann::json::parse(json).at("policies").at("replay");
  replace_in(run_ + "/run.json", digest, std::string(64, 'a'));
  EXPECT_THAT(objection(run_), HasSubstr("policy 'replay': run.json says aaaaaaaaaaaa, this machine has "));
}

TEST_F(ForgedRun, ControllerRenamed) {
  forge([](EpisodeRow& row) { row.controller = "vmc"; });
  EXPECT_THAT(objection(run_), HasSubstr("is no episode of the suite"));
}

TEST_F(ForgedRun, EngineRenamed) {
  forge([](EpisodeRow& row) { row.engine = "mujoco"; });
  EXPECT_THAT(objection(run_), AllOf(HasSubstr(" of mujoco/pd/"), HasSubstr("is no episode of the suite")));
}

TEST_F(ForgedRun, ClipRenamed) {
  forge_main([](EpisodeRow& row) { row.clip += "-easy"; });
  EXPECT_THAT(objection(run_), HasSubstr("-easy 0 of playback/pd/replay clean (main arm): is no episode"));
}

TEST_F(ForgedRun, EpisodeCountedAgainUnderAnotherNumber) {
  std::vector<std::string> forged = lines();
  EpisodeRow row = load_run(run_).rows.front();
  row.episode = 1;
  row.key = episode_key(row);
  forged.push_back(to_json(row).dump());
  write(forged);
  EXPECT_THAT(objection(run_), HasSubstr("is no episode of the suite"));
}

TEST_F(ForgedRun, NullArmTakenFromAnotherArm) {
  std::map<std::string, EpisodeRow> main_rows;
  for (const EpisodeRow& row : load_run(run_).rows)
    if (row.arm == "main") main_rows[row.clip] = row;
  forge([&](EpisodeRow& row) {
    if (row.arm != "null") return;
    const EpisodeRow null_row = row;
    row = main_rows.at(row.clip);
    row.policy = null_row.policy;
    row.policy_digest = null_row.policy_digest;
    row.arm = "null";
  });
  EXPECT_THAT(objection(run_), AllOf(StartsWith("differs: "), HasSubstr("state_hash: ")));
}

TEST_F(ForgedRun, FailuresLeftOut) {
  std::vector<std::string> forged;
  for (const EpisodeRow& row : load_run(run_).rows)
    if (row.arm != "main" || row.task != "wave") forged.push_back(to_json(row).dump());
  write(forged);
  const char* missing = "wave of playback/pd/replay clean: 1 of 1 episodes are not in the run";
  EXPECT_EQ(objection(run_), missing);
  nlohmann::json json = nlohmann::json::parse(read_file(run_ + "/run.json"));
  json.erase("plan");  // and with it what was asked for
  write_file(run_ + "/run.json", json.dump());
  EXPECT_EQ(objection(run_), missing);
}

TEST_F(ForgedRun, NullArmLeftOut) {
  std::vector<std::string> forged;
  for (const EpisodeRow& row : load_run(run_).rows)
    if (row.arm == "main") forged.push_back(to_json(row).dump());
  write(forged);
  EXPECT_THAT(objection(run_), HasSubstr("of playback/pd/null clean: 1 of 1 episodes are not in the run"));
}

TEST_F(ForgedRun, SuiteEdited) {
  replace_in(run_ + "/suite.yaml", "start: clip", "start: act");
  EXPECT_THAT(objection(run_), AllOf(HasSubstr("suite.yaml, with its inputs"), HasSubstr("run.json says ")));
}

TEST_F(ForgedRun, JudgedByOtherDetectors) {
  forge([](EpisodeRow& row) { row.detectors = "0"; });
  EXPECT_THAT(objection(run_), HasSubstr("its rows were judged by detectors 0, this program has "));
}

TEST_F(ForgedRun, SeedAndProfileOfAnother) {
  forge_main([](EpisodeRow& row) { row.seed += 1; });
  EXPECT_THAT(objection(run_), HasSubstr("(main arm): seed: expected '"));
}

TEST_F(ForgedRun, AnyOtherFieldChanged) {
  forge_main([](EpisodeRow& row) { row.frames += 1; });
  EXPECT_THAT(objection(run_), StartsWith("differs: frames: "));
}

TEST(Verification, DrawsAsManyAsAskedForAndSaysOfHowMany) {
  const test::ScratchFolder folder;
  make_run(test::playback_suite(), folder / "run");
  Progress quiet(Progress::Style::kQuiet);
  const Verification found = verify_run(load_run(folder / "run"), {.episodes = 2}, quiet);
  EXPECT_EQ(found.repeats.size(), 2U);
  EXPECT_EQ(found.repeatable, 4);
  EXPECT_EQ(found.different(), 0);
}

TEST(Verification, APartOfASuiteIsWholeInItself) {
  const test::ScratchFolder folder;
  Progress quiet(Progress::Style::kQuiet);
  RunOptions options;
  options.tasks = {"wave"};
  run_suite(test::playback_suite(), folder / "run", options, quiet);
  EXPECT_EQ(objection(folder / "run"), "");
}

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
  EXPECT_THAT(objection(scratch_ / "run"),
              AllOf(HasSubstr("policy mine: network 'mine.safetensors': expected SHA-256 "),
                    HasSubstr("found none: looked at ")));
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
  const KeptSuite kept = kept_suite(suite, scratch_ / "run");
  const std::string place = "inputs/policies/" + suite.policies[0].name + "/";
  EXPECT_EQ(kept.suite.policies[0].use, place + "wave_policy.yaml");
  keep_inputs(kept, scratch_ / "run");
  EXPECT_TRUE(fs::exists(scratch_ / ("run/" + place + "wave_policy.py")));
  EXPECT_TRUE(fs::exists(scratch_ / ("run/" + place + "duet_policy.py")));  // which it imports
}

TEST_F(KeptRun, AnotherNetworkUnderOneNameIsNotResumed) {
  const Suite suite = load_suite(scratch_ / "here/suite.yaml");
  make_run(suite, scratch_ / "run");
  fs::copy_file(share_file("network", "policies/dstar/dstar.safetensors"), scratch_ / "here/mine.safetensors",
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(test::thrown_message<InputError>([&] { make_run(suite, scratch_ / "run"); }),
              AllOf(HasSubstr("cannot be resumed: policy 'mine' is "), HasSubstr("in this machine")));
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
  EXPECT_THAT(test::thrown_message<InputError>([&] { make_run(other, scratch_ / "run"); }),
              HasSubstr("holds a run of the policies replay, not of 'replay_dense': choose another folder"));
}

TEST_F(KeptRun, NothingIsWrittenThroughALinkInTheFolder) {
  const Suite suite = load_suite(scratch_ / "here/suite.yaml");
  make_run(suite, scratch_ / "run");
  fs::remove_all(scratch_ / "run/inputs");
  fs::create_directory(scratch_ / "away");
  fs::create_symlink(scratch_ / "away", scratch_ / "run/inputs");
  EXPECT_THAT(test::thrown_message<StorageError>([&] { make_run(suite, scratch_ / "run"); }),
              AllOf(HasSubstr("run/inputs"), HasSubstr("is a symbolic link")));
  EXPECT_TRUE(fs::is_empty(scratch_ / "away"));
}

TEST_F(KeptRun, AnIndexThatLeadsOutOfTheFolderIsRefused) {
  make_run(load_suite(scratch_ / "here/suite.yaml"), scratch_ / "run");
  replace_in(scratch_ / "run/inputs/inputs.json", "inputs/contact_limits.yaml", "../here/limits.yaml");
  EXPECT_THAT(objection(scratch_ / "run"), HasSubstr("expected a path below the run directory"));
}

}  // namespace
}  // namespace duet
