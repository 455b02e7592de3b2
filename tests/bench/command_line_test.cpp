// The program as a user meets it: outputs, messages, exit codes. Runs the built `duet`.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "tests/support.h"
#include "training/dstar/trainer.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

struct Answer {
  int code = -1;
  std::string out, err;
};

// Runs the program with `arguments` in a shell; standard error goes through a file.
Answer duet_program(const std::string& arguments, const std::string& prefix = "") {
  const test::ScratchFolder folder;
  const std::string err = folder / "stderr";
  const std::string command = prefix + " " + DUET_PROGRAM + " " + arguments + " 2>" + err;
  FILE* pipe = popen(command.c_str(), "r");
  Answer answer;
  std::array<char, 4096> buffer{};
  for (size_t n = fread(buffer.data(), 1, buffer.size(), pipe); n > 0; n = fread(buffer.data(), 1, buffer.size(), pipe))
    answer.out.append(buffer.data(), n);
  answer.code = WEXITSTATUS(pclose(pipe));
  answer.err = read_file(err);
  return answer;
}

TEST(CommandLine, EveryCommandHasHelpWithAnExample) {
  for (const char* command : {"doctor", "list", "synth", "import", "retarget", "score", "run", "report", "compare",
                              "check", "bless", "verify", "validate", "bench"}) {
    const Answer answer = duet_program(std::string(command) + " --help");
    EXPECT_EQ(answer.code, 0) << command;
    EXPECT_THAT(answer.out, HasSubstr("Example:\n  duet " + std::string(command))) << command;
    EXPECT_THAT(answer.out, HasSubstr("--json")) << command;
  }
}

TEST(CommandLine, VersionNamesTheEngines) { EXPECT_THAT(duet_program("--version").out, HasSubstr("playback")); }

TEST(CommandLine, UsageErrorsAreTwo) {
  EXPECT_EQ(duet_program("").code, 2);
  EXPECT_EQ(duet_program("dance").code, 2);
  EXPECT_EQ(duet_program("list taskz").code, 2);
  EXPECT_THAT(duet_program("list taskz").err, HasSubstr("did you mean 'tasks'"));
  EXPECT_EQ(duet_program("run").code, 2);
}

TEST(CommandLine, MissingEngineIsRefusedByName) {
  const Answer answer = duet_program("doctor --need warp9");
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("warp9"));
}

TEST(CommandLine, TrainingAPolicyWithoutLibtorchSaysHowToGetIt) {
  if (can_train_dstar()) GTEST_SKIP() << "not run: this program has libtorch";
  const test::ScratchFolder folder;
  const Answer answer = duet_program("train dstar --smoke -o " + (folder / "runs"));
  EXPECT_EQ(answer.code, 4);
  EXPECT_THAT(answer.err, HasSubstr("./run train dstar"));
  EXPECT_FALSE(std::filesystem::exists(folder / "runs"));
}

TEST(CommandLine, ListSaysWhatControllersAndPerturbationsAre) {
  const Answer controllers = duet_program("list controllers");
  EXPECT_EQ(controllers.code, 0) << controllers.err;
  EXPECT_THAT(controllers.out, HasSubstr("body g1, does not walk; "));
  const Answer perturbations = duet_program("list perturbations");
  EXPECT_EQ(perturbations.code, 0) << perturbations.err;
  EXPECT_THAT(perturbations.out, HasSubstr("push: {force: 60, duration: 1, every: 4, link: torso_link}"));
}

TEST(CommandLine, DoctorSaysWhichControllersCanRun) {
  EXPECT_THAT(duet_program("doctor").out, HasSubstr("controller vmc"));
}

TEST(CommandLine, JsonIsOneDocumentOnStandardOutput) {
  for (const char* command : {"doctor --json", "list tasks --json", "list metrics --json", "list readings --json"}) {
    const Answer answer = duet_program(command);
    EXPECT_EQ(answer.code, 0) << command << answer.err;
    EXPECT_FALSE(nlohmann::json::parse(answer.out, nullptr, false).is_discarded()) << command;
  }
}

// The whole way of a clip through the program, without physics.
TEST(CommandLine, SynthRetargetScoreRunReportVerify) {
  const test::ScratchFolder folder;
  ASSERT_EQ(duet_program("synth wave -n 2 -q -o " + (folder / "clips")).code, 0);
  ASSERT_EQ(duet_program("retarget -q " + (folder / "clips") + " -o " + (folder / "paired")).code, 0);
  const Answer score = duet_program("score -q --json " + (folder / "paired"));
  ASSERT_EQ(score.code, 0) << score.err;
  EXPECT_EQ(nlohmann::json::parse(score.out)["clips"].size(), 2u);

  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: cli\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nstart: clip\n");
  const std::string run =
      "run -q " + (folder / "suite.yaml") + " --clips " + (folder / "paired") + " -o " + (folder / "run");
  const Answer ran = duet_program(run + " --json");
  ASSERT_EQ(ran.code, 0) << ran.err;
  EXPECT_EQ(nlohmann::json::parse(ran.out)["planned"], 4);
  EXPECT_EQ(nlohmann::json::parse(duet_program(run + " --json").out)["already_there"], 4);

  const Answer verify = duet_program("verify -q -k 4 " + (folder / "run"));
  EXPECT_EQ(verify.code, 0) << verify.out << verify.err;
  EXPECT_THAT(verify.out, HasSubstr("4 of 4 episodes repeat bit for bit"));

  ASSERT_EQ(
      duet_program("report -q " + (folder / "run") + " -f md,csv,json,tex,html,sqlite -o " + (folder / "report")).code,
      0);
  for (const char* name :
       {"leaderboard.md", "leaderboard.csv", "leaderboard.json", "leaderboard.tex", "report.html", "results.sqlite"})
    EXPECT_TRUE(std::filesystem::exists(folder / ("report/" + std::string(name)))) << name;
  EXPECT_THAT(read_file(folder / "report/report.html"), HasSubstr("<svg"));
  write_file(folder / "curves.csv", "steps,return\n0,1\n100,3\n");
  const std::string report = "report -q " + (folder / "run") + " -f html --no-clips -o " + (folder / "report");
  ASSERT_EQ(duet_program(report + " --curves " + (folder / "curves.csv")).code, 0);
  EXPECT_THAT(read_file(folder / "report/report.html"), HasSubstr("return against steps"));
  write_file(folder / "curves.csv", "steps,return\n0,x\n");
  const Answer refused = duet_program(report + " --curves " + (folder / "curves.csv"));
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("curves.csv:2: column 'return': expected a number, found 'x'"));

  ASSERT_EQ(duet_program("bless -q " + (folder / "run") + " -o " + (folder / "golden.json")).code, 0);
  EXPECT_EQ(duet_program("check -q " + (folder / "run") + " -b " + (folder / "golden.json")).code, 0);
  std::string golden = read_file(folder / "golden.json");
  golden.replace(golden.find("\"value\": "), 9, "\"value\": 7");
  write_file(folder / "golden.json", golden);
  EXPECT_EQ(duet_program("check -q " + (folder / "run") + " -b " + (folder / "golden.json")).code, 1);

  const Answer compare = duet_program("compare -q " + (folder / "run") + " " + (folder / "run"));
  EXPECT_EQ(compare.code, 0) << compare.err;
}

TEST(CommandLine, TimeLimitIsResumable) {
  const test::ScratchFolder folder;
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: cli\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\nengines: "
             "[playback]\n"
             "controllers: [pd]\npolicies: [replay]\n");
  EXPECT_EQ(duet_program("run -q " + (folder / "suite.yaml") + " --time-limit 0.000001 -o " + (folder / "run")).code,
            75);
  EXPECT_EQ(duet_program("run -q " + (folder / "suite.yaml") + " -o " + (folder / "run")).code, 0);
}

TEST(CommandLine, BadInputIsOneSentenceAndTwo) {
  const test::ScratchFolder folder;
  write_file(folder / "empty.bvh", "");
  write_file(folder / "broken.npz", "PK not a zip");
  write_file(folder / "empty.pkl", "");
  struct Case {
    std::string arguments, names;
  };
  for (const Case& bad : std::vector<Case>{
           {"import " + (folder / "empty.bvh") + " " + (folder / "empty.bvh") + " --task hug -o x.npz", "empty.bvh"},
           {"import " + (folder / "empty.bvh") + " --task hug -o x.npz", "pair of BVH files"},
           {"import " + (folder / "empty.pkl") + " -o x.npz", "empty.pkl"},
           {"retarget " + (folder / "broken.npz") + " -o x", "broken.npz"},
           {"score " + (folder / "nowhere.npz"), "nowhere.npz"},
           {"run " + (folder / "nowhere.yaml") + " -o x", "nowhere.yaml"},
           {"report " + (folder / "nowhere"), "nowhere"},
           {"synth hugg -o x", "did you mean 'hug'"},
           {"synth hug --side up -o x", "left or right"},
           {"retarget x.npz --option kernel=v9 -o x", "v9"},
           {"bench pairr", "pair"}}) {
    const Answer answer = duet_program(bad.arguments + " -q");
    EXPECT_EQ(answer.code, 2) << bad.arguments;
    EXPECT_THAT(answer.err, HasSubstr(bad.names)) << bad.arguments;
    EXPECT_EQ(std::count(answer.err.begin(), answer.err.end(), '\n'), 1) << answer.err;
  }
  EXPECT_FALSE(std::filesystem::exists("x"));
  EXPECT_FALSE(std::filesystem::exists("x.npz"));
}

TEST(CommandLine, FullDiskLosesNothingThatWasThere) {
  const test::ScratchFolder folder;
  ASSERT_EQ(duet_program("synth wave -n 1 -q -o " + (folder / "clips")).code, 0);
  // A file-size limit stands in for a full disk: the write fails in the middle.
  const Answer answer =
      duet_program("synth wave -n 1 --first 0 --seed 7 -q -o " + (folder / "clips"), "ulimit -f 8; trap '' XFSZ;");
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("cannot write"));
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "clips")) {
    ++files;
    EXPECT_EQ(entry.path().extension(), ".npz");
  }
  EXPECT_EQ(files, 1);
}

}  // namespace
}  // namespace duet
