// Runs that somebody changed: each is refused, and what is wrong is named.
#include "duet/execution/verification.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <functional>
#include <sstream>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/clips.h"
#include "tests/app/program.h"
#include "tests/execution/verified_run.h"
#include "tests/experiment/fixtures.h"
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
  // Forges rows of the policy, not of the null arm.
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
  forge_main([](EpisodeRow& row) { row.metrics[row.metrics.begin()->first] *= 1.0 + 1e-15; });
  EXPECT_THAT(objection(run_), StartsWith("differs: metrics."));
}

TEST_F(ForgedRun, MetricDropped) {
  forge_main([](EpisodeRow& row) { row.metrics.erase(std::string(row.metrics.begin()->first)); });
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

// A row that is not supported counts for nobody in most tables.
TEST_F(ForgedRun, FailuresMarkedAsUnsupported) {
  forge_main([](EpisodeRow& row) {
    row.outcome = Outcome::kUnsupported;
    row.message = "engine 'playback' is not here";
    row.success = false;
  });
  EXPECT_THAT(objection(run_), AllOf(HasSubstr("(main arm): is marked as unsupported (engine 'playback' is not here)"),
                                     HasSubstr("and this machine runs it")));
}

TEST_F(ForgedRun, NullArmMarkedAsUnsupported) {
  forge([](EpisodeRow& row) {
    if (row.arm == "null") row.outcome = Outcome::kUnsupported;
  });
  EXPECT_THAT(objection(run_), HasSubstr("(null arm): is marked as unsupported"));
}

TEST_F(ForgedRun, RivalsMarkedAsTimedOut) {
  forge_main([](EpisodeRow& row) {
    row.outcome = Outcome::kTimedOut;
    row.success = false;
  });
  Progress quiet(Progress::Style::kQuiet);
  // Also where few are drawn: rows that timed out are drawn apart.
  const Verification found = verify_run(load_run(run_), {.episodes = 1}, quiet);
  EXPECT_EQ(found.repeats.size(), 2U);
  EXPECT_EQ(found.timed_out(), 1);
  EXPECT_EQ(found.different(), 0);
  const Verification all = verify_run(load_run(run_), {.all = true}, quiet);
  EXPECT_EQ(all.timed_out(), 2);
  for (const RepeatedEpisode& repeat : all.repeats)
    if (repeat.row.arm == "main") {
      EXPECT_THAT(repeat.time_out, AllOf(StartsWith("timed out there, ends here in "), HasSubstr(" s (ok)")));
      EXPECT_THAT(differences_text(repeat.differences), HasSubstr("outcome: \"timeout\", \"ok\""));
    }
}

// With the part of run.json that has asked for them.
TEST_F(ForgedRun, ABlockLeftOutTogetherWithItsPlanIsSaid) {
  std::vector<std::string> forged;
  for (const EpisodeRow& row : load_run(run_).rows)
    if (row.task != "wave") forged.push_back(to_json(row).dump());
  write(forged);
  nlohmann::json json = nlohmann::json::parse(read_file(run_ + "/run.json"));
  json["plan"]["parts"] = {{{"tasks", {"handshake"}}}};
  json["plan"]["asked"] = 2;
  write_file(run_ + "/run.json", json.dump());
  Progress quiet(Progress::Style::kQuiet);
  const Verification found = verify_run(load_run(run_), {.all = true}, quiet);
  EXPECT_THAT(found.missing, IsEmpty());
  EXPECT_THAT(found.not_asked,
              testing::Contains("wave of playback/pd/replay clean: 1 of 1 episodes were not asked for, "
                                "as run.json says"));
  EXPECT_EQ(found.asked, 2);
  EXPECT_EQ(found.episodes, 4);
}

// A run of several policies without its plan is one of the policies that are left, and no part.
TEST_F(ForgedRun, APolicyLeftOutTogetherWithThePlan) {
  make_run(parse_suite("schema: duet.suite/1\nname: two\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
                       "engines: [playback]\ncontrollers: [pd]\npolicies: [replay, replay_dense]\nstart: clip\n",
                       "two.yaml"),
           scratch_ / "two");
  run_ = scratch_ / "two";
  std::vector<std::string> forged;
  for (const EpisodeRow& row : load_run(run_).rows)
    if (row.policy != "replay_dense") forged.push_back(to_json(row).dump());
  write(forged);
  nlohmann::json json = nlohmann::json::parse(read_file(run_ + "/run.json"));
  json.erase("plan");
  write_file(run_ + "/run.json", json.dump());
  EXPECT_EQ(objection(run_), "wave of playback/pd/replay_dense clean: 1 of 1 episodes are not in the run");
}

TEST_F(ForgedRun, AFieldGivenTwice) {
  std::vector<std::string> forged = lines();
  forged.front().insert(1, "\"success\":true,");
  write(forged);
  EXPECT_THAT(objection(run_), HasSubstr("episodes.jsonl:1: episode row: expected each key of an object once, found "
                                         "'success' twice"));
}

TEST(VerifyCommand, AllIsAllOfTheSuite) {
  const test::ScratchFolder folder;
  write_file(folder / "suite.yaml", resolved_yaml(test::playback_suite()));
  ASSERT_EQ(test::duet_program("run -q " + (folder / "suite.yaml") + " --tasks wave -o " + (folder / "run")).code, 0);
  const test::Answer all = test::duet_program("verify -q --all " + (folder / "run"));
  EXPECT_EQ(all.code, 5);
  EXPECT_THAT(all.out, AllOf(HasSubstr("LEFT OUT  handshake of playback/pd/replay clean: 1 of 1 episodes"),
                             HasSubstr("a part of its suite: 2 of 4 episodes were asked for"),
                             HasSubstr("2 of 2 episodes repeat bit for bit")));
  EXPECT_EQ(test::duet_program("verify -q --all --partial " + (folder / "run")).code, 0);
  EXPECT_EQ(test::duet_program("verify -q " + (folder / "run")).code, 0);
}

TEST(VerifyCommand, ATimeOutThatEndsHereIsADifferenceUnlessItMayBe) {
  const test::ScratchFolder folder;
  make_run(test::playback_suite(), folder / "run");
  std::string text;
  for (EpisodeRow row : load_run(folder / "run").rows) {
    if (row.arm == "main") row.outcome = Outcome::kTimedOut;
    if (row.arm == "main") row.success = false;
    text += to_json(row).dump() + "\n";
  }
  write_file(folder / "run/episodes.jsonl", text);
  const test::Answer answer = test::duet_program("verify -q -k 1 " + (folder / "run"));
  EXPECT_EQ(answer.code, 5);
  EXPECT_THAT(answer.out, AllOf(HasSubstr("TIMEOUT "), HasSubstr("timed out there, ends here in ")));
  EXPECT_EQ(test::duet_program("verify -q --all --allow-timeouts " + (folder / "run")).code, 0);
}

// Rows of an engine that this machine does not have are no rows that were held against something.
TEST(VerifyCommand, AllIsNotAllWhereRowsCannotRunHere) {
  const test::ScratchFolder folder;
  write_file(folder / "suite.yaml", resolved_yaml(test::playback_suite()));
  const std::string engines = "DUET_ENGINES='" + (folder / "none") + "'";
  const test::Answer made = test::duet_program(
      "run -q " + (folder / "suite.yaml") + " -s 'engines=[playback, ode]' -o " + (folder / "run"), engines);
  ASSERT_EQ(made.code, 3) << made.err;
  const test::Answer all = test::duet_program("verify -q --all " + (folder / "run"), engines);
  EXPECT_EQ(all.code, 4) << all.out;
  EXPECT_THAT(all.out, HasSubstr("; 4 rows were not run: engine 'ode' is not on this machine"));
  EXPECT_EQ(test::duet_program("verify -q " + (folder / "run"), engines).code, 0);
}

// A module of somebody's own, which another machine does not know by name: what runs here is held against the rows, and
// the folder is read. The suite itself is refused there.
TEST(VerifyCommand, RowsOfAnEngineThatIsUnknownHereAreLeftOut) {
  const test::ScratchFolder folder;
  write_file(folder / "suite.yaml", resolved_yaml(test::playback_suite()));
  fs::create_directory(folder / "engines");
  fs::create_symlink(DUET_FAULTY_ENGINE, fs::path(folder / "engines") / "duet_faulty.so");
  const std::string there = "DUET_ENGINES='" + (folder / "engines") + "'",
                    here = "DUET_ENGINES='" + (folder / "none") + "'";
  const std::string run =
      "run -q " + (folder / "suite.yaml") + " -s 'engines=[playback, faulty]' -o " + (folder / "run");
  ASSERT_EQ(test::duet_program(run, there).code, 3);
  const test::Answer all = test::duet_program("verify -q --all " + (folder / "run"), here);
  EXPECT_EQ(all.code, 4) << all.out << all.err;
  EXPECT_THAT(all.out, AllOf(HasSubstr("4 of 4 episodes repeat bit for bit"),
                             HasSubstr("; 4 rows were not run: engine 'faulty' is not on this machine")));
  EXPECT_EQ(test::duet_program("verify -q " + (folder / "run"), here).code, 0);
  EXPECT_EQ(test::duet_program("report " + (folder / "run"), here).code, 0);
  const test::Answer again = test::duet_program(run, here);
  EXPECT_EQ(again.code, 2);
  EXPECT_THAT(again.err, HasSubstr("unknown engine 'faulty'"));
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

TEST(OtherMakerSentences, NameMachineAndCommitAndAreEmptyWhereTheyAreTheSame) {
  const auto made = [](const std::string& machine, const std::string& commit) {
    return nlohmann::json{{"machine", machine}, {"build", {{"commit", commit}}}};
  };
  const nlohmann::json there = made("EPYC, AVX-512", "0123456789abcdef");
  EXPECT_THAT(other_maker_sentences(there, made("EPYC, AVX2", "0123456789abcdef")),
              AllOf(HasSubstr("(EPYC, AVX-512; this one: EPYC, AVX2)"), Not(HasSubstr("commit 0"))));
  EXPECT_EQ(other_maker_sentences(there, made("EPYC, AVX-512", "fedcba9876543210")),
            "the rows were made by the program of commit 0123456789ab, this one is of fedcba987654");
  EXPECT_THAT(other_maker_sentences(there, there), IsEmpty());
  EXPECT_THAT(other_maker_sentences(nlohmann::json::object(), there), IsEmpty());
}

}  // namespace
}  // namespace duet
