// Policies in programs of their own, as a user meets them: what is started and what not, what is said of one that does
// not play, `duet policy check`. Runs the built `duet`.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "duet/core/child_process.h"
#include "duet/core/require.h"
#include "duet/rows/folder/run_directory.h"
#include "tests/app/program.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using test::Answer;
using test::duet_program;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

const std::string kExamples = std::string(DUET_SOURCE_DIR) + "/examples/policies";

bool python_is_here() {
  try {
    return !find_program("python3", ".").empty();
  } catch (const MissingError&) {
    return false;
  }
}

class PolicyCommand : public ::testing::Test {
 protected:
  // A descriptor "NAME.yaml" whose process is `command`.
  [[nodiscard]] std::string descriptor(const std::string& name, const std::string& command,
                                       const std::string& more = "") const {
    std::string path = folder_ / (name + ".yaml");
    write_file(path,
               "schema: duet.policy/1\nname: " + name + "\nabout: a test\nkind: process\n" + command + "\n" + more);
    return path;
  }

  // The descriptor of a Python class that answers with what `plan` returns.
  [[nodiscard]] std::string python(const std::string& name, const std::string& plan) const {
    write_file(folder_ / (name + ".py"), "import sys\nsys.path.insert(0, '" + kExamples + R"(')
from duet_policy import serve
class P:
    def __init__(self, hello): pass
    def reset(self, episode): pass
    def plan(self, observation):
        good = [[0, 0, 0.75, 1, 0, 0, 0] + [0] * 29] * 5
        return )" + plan + "\nserve(P)\n");
    return descriptor(name, "command: [python3, " + name + ".py]");
  }

  [[nodiscard]] std::string suite(const std::string& policies, const std::string& more = "") const {
    std::string path = folder_ / "suite.yaml";
    write_file(path,
               "schema: duet.suite/1\nname: tiny\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
               "engines: [playback]\ncontrollers: [pd]\npolicies: [" +
                   policies + "]\nstart: act\n" + more);
    return path;
  }

  [[nodiscard]] Answer run(const std::string& suite_file, const std::string& more = "",
                           const std::string& prefix = "") const {
    return duet_program("run -q -j 1 " + suite_file + " -o " + (folder_ / "run") + " " + more, prefix);
  }

  [[nodiscard]] Answer check(const std::string& policy, const std::string& more = "--allow-programs") const {
    return duet_program("policy check " + policy + " " + more);
  }

  test::ScratchFolder folder_;
};

TEST_F(PolicyCommand, AProgramThatDoesNotPlayIsAnErrorWithItsNameEverywhere) {
  const Answer ran = run(suite("replay, " + descriptor("dead", "command: [/bin/false]")), "--allow-programs --tables");
  EXPECT_EQ(ran.code, 3) << ran.err;
  EXPECT_THAT(ran.err,
              HasSubstr("duet: warning: Policy 'dead' lost plans (in 1 episodes: dead in 1, which are errors and "
                        "count as failures). The first fault: policy 'dead': its process ended with exit "
                        "status 1\n"));
  EXPECT_THAT(ran.out, AllOf(HasSubstr("Plans lost"), HasSubstr("dead in 1 |"), HasSubstr("ended with exit status 1")));
  int dead = 0;
  for (const EpisodeRow& row : load_run(folder_ / "run").rows) {
    EXPECT_EQ(row.outcome, row.policy == "dead" ? Outcome::kError : Outcome::kOk);
    dead += row.policy_faults.dead ? 1 : 0;
  }
  EXPECT_EQ(dead, 1);
  const std::string report =
      "report -q --no-clips " + (folder_ / "run") + " -f md,html,csv,json,tex -o " + (folder_ / "out");
  ASSERT_EQ(duet_program(report).code, 0);
  for (const char* file : {"leaderboard.md", "leaderboard.tex", "leaderboard.json", "report.html"})
    EXPECT_THAT(read_file(folder_ / ("out/" + std::string(file))), HasSubstr("ended with exit status 1")) << file;
  EXPECT_THAT(read_file(folder_ / "out/leaderboard.csv"), HasSubstr(",policy_dead"));
}

TEST_F(PolicyCommand, AServerThatDoesNotListenIsAnErrorToo) {
  const Answer ran = run(suite(descriptor("far", "socket: nosuch.sock")), "--allow-programs");
  EXPECT_EQ(ran.code, 3) << ran.err;
  EXPECT_THAT(ran.err, AllOf(HasSubstr("policy 'far': cannot connect to '"), HasSubstr("nosuch.sock': No such file")));
}

TEST_F(PolicyCommand, AProgramThatIsNotThereIsFour) {
  const Answer ran = run(suite(descriptor("gone", "command: [no_such_program]")), "--allow-programs");
  EXPECT_EQ(ran.code, 4) << ran.err;
  EXPECT_THAT(ran.err, HasSubstr("cannot run 'no_such_program': no such program in PATH"));
  EXPECT_EQ(run(suite("replay, " + (folder_ / "gone.yaml")), "--allow-programs").code, 3);
}

TEST_F(PolicyCommand, RunAndVerifyStartNoProgramUnasked) {
  const std::string evil = descriptor("evil", "command: [/bin/sh, -c, \"touch " + (folder_ / "PWNED") + "\"]");
  const Answer refused = run(suite(evil));
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, StartsWith("duet: expected --allow-programs, or a folder in DUET_TRUSTED_FOLDERS, for: "
                                      "policy 'evil' of " +
                                      evil + " runs '/bin/sh -c touch " + (folder_ / "PWNED")));
  EXPECT_EQ(std::count(refused.err.begin(), refused.err.end(), '\n'), 1);
  EXPECT_FALSE(fs::exists(folder_ / "run"));
  const Answer dry = run(suite(evil), "--dry-run");
  EXPECT_EQ(dry.code, 0);
  EXPECT_THAT(dry.out, HasSubstr("\n# program: policy 'evil' of " + evil + " runs '/bin/sh -c touch "));
  EXPECT_EQ(nlohmann::json::parse(run(suite(evil), "--dry-run --json").out).at("programs").size(), 1U);
  EXPECT_FALSE(fs::exists(folder_ / "PWNED"));
  EXPECT_EQ(run(suite(evil), "--allow-programs").code, 3);
  EXPECT_TRUE(fs::exists(folder_ / "PWNED"));
  fs::remove(folder_ / "PWNED");
  const Answer verified = duet_program("verify -q " + (folder_ / "run"));
  EXPECT_EQ(verified.code, 2);
  EXPECT_THAT(verified.err, StartsWith("duet: expected --allow-programs"));
  EXPECT_FALSE(fs::exists(folder_ / "PWNED"));
}

TEST_F(PolicyCommand, ATrustedFolderNeedsNoOption) {
  const std::string mine = descriptor("mine", "command: [/bin/false]");
  EXPECT_EQ(run(suite(mine), "", "DUET_TRUSTED_FOLDERS=/nowhere").code, 2);
  EXPECT_EQ(run(suite(mine), "", "DUET_TRUSTED_FOLDERS=/nowhere:" + (folder_ / "")).code, 3);
}

// The example succeeds at its own task, in the words of the demonstration.
TEST_F(PolicyCommand, TheExampleWavesWellEnoughForTheDetector) {
  if (!python_is_here()) GTEST_SKIP() << "not run: python3 absent";
  const Answer ran = run(suite(kExamples + "/wave_policy.yaml"), "--allow-programs");
  EXPECT_EQ(ran.code, 0) << ran.err;
  int rows = 0;
  for (const EpisodeRow& row : load_run(folder_ / "run").rows) {
    if (row.policy != "wave_policy") continue;
    EXPECT_EQ(row.success, true);
    EXPECT_FALSE(row.policy_faults.any()) << row.policy_faults.message;
    ++rows;
  }
  EXPECT_EQ(rows, 1);
}

TEST_F(PolicyCommand, CheckSaysWhatWentInAndWhatCameBack) {
  if (!python_is_here()) GTEST_SKIP() << "not run: python3 absent";
  const Answer answer = check(kExamples + "/wave_policy.yaml");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out,
              AllOf(HasSubstr("policy 'wave_policy': Example"), HasSubstr("shown: observation, 12 x 149 numbers"),
                    HasSubstr("  partner_joints           72 "),
                    HasSubstr("asked for: 100 anchors of 36 numbers, 0.02 s apart, frame world"),
                    HasSubstr("came back: 100 references"), HasSubstr("  at +0.50 s   root ("), HasSubstr("took: ")));
  const nlohmann::json json =
      nlohmann::json::parse(check(kExamples + "/wave_policy.yaml", "--allow-programs --json").out);
  EXPECT_EQ(json.at("references"), 100);
  EXPECT_EQ(json.at("fault"), "");
}

TEST_F(PolicyCommand, CheckOfOneOfDuetsOwnNeedsNoLeave) {
  for (const char* name : {"replay", "null"}) {
    const Answer answer = check(name, "");
    EXPECT_EQ(answer.code, 0) << answer.err;
    EXPECT_THAT(answer.out, AllOf(HasSubstr("came back: "), Not(HasSubstr("asked for"))));
  }
  const Answer unknown = check("replya", "");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("did you mean 'replay'"));
}

TEST_F(PolicyCommand, CheckStartsNoProgramUnasked) {
  const std::string evil = descriptor("evil", "command: [/bin/sh, -c, \"touch " + (folder_ / "PWNED") + "\"]");
  const Answer answer = check(evil, "");
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("expected --allow-programs"));
  EXPECT_FALSE(fs::exists(folder_ / "PWNED"));
}

TEST_F(PolicyCommand, CheckNamesWhatIsWrongInOneSentence) {
  const Answer dead = check(descriptor("dead", "command: [/bin/false]"));
  EXPECT_EQ(dead.code, 2);
  EXPECT_EQ(dead.err, "duet: policy 'dead': its process ended with exit status 1\n");
  const Answer gone = check(descriptor("gone", "command: [no_such_program]"));
  EXPECT_EQ(gone.code, 4);
  EXPECT_EQ(gone.err, "duet: cannot run 'no_such_program': no such program in PATH\n");
  EXPECT_EQ(check(folder_ / "nowhere.yaml").code, 2);
  if (!python_is_here()) GTEST_SKIP() << "not run: python3 absent";
  const Answer few = check(python("few", "good[:4]"));
  EXPECT_EQ(few.code, 2);
  EXPECT_EQ(few.err, "duet: policy 'few': plan: expected 5 anchors, found 4\n");
  const Answer nan = check(python("nan", "[[float('nan')] * 36] * 5"));
  EXPECT_EQ(nan.code, 2);
  EXPECT_EQ(nan.err, "duet: policy 'nan': message of the policy: expected finite numbers, found NaN\n");
  EXPECT_THAT(nan.out, HasSubstr("came back: 0 references"));
  const Answer far = check(python("far", "[[9, 9, 0.75, 1, 0, 0, 0] + [9] * 29] * 5"));
  EXPECT_EQ(far.code, 0) << far.err;
  EXPECT_THAT(far.out, AllOf(HasSubstr("m from the robot; is the frame of 'output' right?"),
                             HasSubstr("note: 29 joints of the plan's first reference are at their limits")));
  // As the robot faces, but in the order x, y, z, w.
  const Answer turned = check(python("turned", "[[0, 0, 0.75, 0, 0, 1, 0] + [0] * 29] * 5"));
  EXPECT_EQ(turned.code, 0) << turned.err;
  EXPECT_THAT(turned.out, HasSubstr("are its quaternions w, x, y, z"));
}

TEST_F(PolicyCommand, TheExampleOfANetworkRunsAsItIsWritten) {
  const Answer answer = check(kExamples + "/onnx_policy.yaml", "--task high_five");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_THAT(answer.out,
              AllOf(HasSubstr("shown: observation, 12 x 149 numbers"), HasSubstr("shown: task, 1 x 6 numbers"),
                    HasSubstr("asked for: 5 anchors of 36 numbers, 0.5 s apart, frame ego"), Not(HasSubstr("note: "))));
}

TEST_F(PolicyCommand, TheScriptMakesTheNetworkOfTheExample) {
  if (!python_is_here()) GTEST_SKIP() << "not run: python3 absent";
  const std::string made = folder_ / "made.onnx";
  ASSERT_EQ(std::system(("python3 " + kExamples + "/make_onnx_policy.py " + made).c_str()), 0);
  EXPECT_EQ(read_file(made), read_file(kExamples + "/onnx_policy.onnx"));
}

}  // namespace
}  // namespace duet
