// Runs that somebody changed: each is refused, and what is wrong is named.
#include "duet/bench/verification.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <sstream>

#include "duet/bench/clips.h"
#include "duet/bench/run_inputs.h"
#include "duet/bench/runner.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/bench/fixtures.h"
#include "tests/bench/verified_run.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

using test::make_run;
using test::objection;
using test::replace_in;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

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

TEST(OtherMachineSentence, NamesBothAndIsEmptyWhereTheyAreTheSame) {
  const nlohmann::json environment = {{"machine", "EPYC, AVX-512"}};
  EXPECT_THAT(other_machine_sentence(environment, "EPYC, AVX2"),
              AllOf(HasSubstr("(EPYC, AVX-512; this one: EPYC, AVX2)")));
  EXPECT_THAT(other_machine_sentence(environment, "EPYC, AVX-512"), IsEmpty());
  EXPECT_THAT(other_machine_sentence(nlohmann::json::object(), "EPYC, AVX2"), IsEmpty());
}

}  // namespace
}  // namespace duet
