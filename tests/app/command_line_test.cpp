// The program as a user meets it: outputs, messages, exit codes. Runs the built `duet`.
#include <gmock/gmock.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "duet/archives/npy/npz.h"
#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/robots/robot_model.h"
#include "duet/training/dstar/trainer.h"
#include "tests/app/program.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::Answer;
using test::duet_program;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

TEST(CommandLine, EveryCommandHasHelpWithAnExample) {
  for (const char* command : {"doctor", "list", "synth", "import", "convert", "retarget", "score", "run", "report",
                              "compare", "check", "bless", "merge", "verify", "validate", "bench", "completion"}) {
    const Answer answer = duet_program(std::string(command) + " --help");
    EXPECT_EQ(answer.code, 0) << command;
    EXPECT_THAT(answer.out, HasSubstr("Example:\n  duet " + std::string(command))) << command;
    EXPECT_THAT(answer.out, HasSubstr("--json")) << command;
  }
}

TEST(CommandLine, VersionNamesTheEngines) {
  const std::string out = duet_program("--version").out;
  for (const EngineInfo& engine : engines()) {
    if (!engine.available) continue;
    EXPECT_THAT(out, HasSubstr(engine.name + " " + engine.version));
  }
}

// "\&" keeps roff from taking a line's first point or apostrophe for a request; elsewhere it does not belong.
TEST(CommandLine, TheManualPageEscapesWhatWouldBeARequest) {
  std::istringstream page(duet_program("man").out);
  int lines = 0;
  for (std::string line; std::getline(page, line); ++lines) {
    const bool escaped = line.starts_with("\\&");
    EXPECT_TRUE(!escaped || line.substr(2, 1) == "." || line.substr(2, 1) == "'") << line;
  }
  EXPECT_GT(lines, 300);
}

TEST(CommandLine, UsageErrorsAreTwo) {
  EXPECT_EQ(duet_program("").code, 2);
  EXPECT_EQ(duet_program("dance").code, 2);
  EXPECT_EQ(duet_program("--jsn").code, 2);
  EXPECT_EQ(duet_program("list taskz").code, 2);
  EXPECT_THAT(duet_program("list taskz").err, HasSubstr("did you mean 'tasks'"));
  EXPECT_EQ(duet_program("run").code, 2);
}

// Work that is done is reported: a file's name is bytes, and JSON is UTF-8.
TEST(CommandLine, JsonIsPrintedWhateverTheNamesOfFilesAre) {
  const test::ScratchFolder folder;
  const test::Answer answer = test::duet_program("synth wave --count 1 --json -q -o '" + (folder / "bad\xff") + "'");
  EXPECT_EQ(answer.code, 0) << answer.err;
  EXPECT_NE(answer.out.find("\"clips\""), std::string::npos) << answer.out;
}

TEST(CommandLine, PlanTakesTheFiltersOfRun) {
  const std::string help = test::duet_program("plan --help").out;
  for (const char* option : {"--engines", "--controllers", "--policies", "--tasks", "--perturbations"})
    EXPECT_NE(help.find(option), std::string::npos) << option;
}

TEST(CommandLine, AMistypedCommandIsAskedAbout) {
  const Answer answer = duet_program("runn suites/demo.yaml");
  EXPECT_EQ(answer.code, 2);
  EXPECT_THAT(answer.err, HasSubstr("duet: unknown command 'runn': did you mean 'run'?"));
  EXPECT_THAT(duet_program("train wcb").err, HasSubstr("unknown command 'wcb': did you mean 'wbc'?"));
  EXPECT_EQ(duet_program("train wcb").code, 2);
}

// The options that are not known stand in the order in which they were given, with the nearest option.
TEST(CommandLine, AMistypedOptionIsAskedAbout) {
  const auto refusal = [](const char* arguments) {
    const Answer answer = duet_program(arguments);
    EXPECT_EQ(answer.code, 2) << arguments;
    EXPECT_EQ(answer.out, "") << arguments;
    return answer.err;
  };
  EXPECT_THAT(refusal("run demo --engine mujoco"),
              HasSubstr("duet: run: unexpected: --engine mujoco; did you mean '--engines'?"));
  EXPECT_THAT(refusal("run demo --polices=null"), HasSubstr("did you mean '--policies'?"));
  EXPECT_THAT(refusal("compare r --jsn"), HasSubstr("unexpected: --jsn; did you mean '--json'?"));
  EXPECT_THAT(refusal("--hepl"), HasSubstr("duet: unexpected: --hepl; did you mean '--help'?"));
  EXPECT_THAT(refusal("run demo --outp x"), HasSubstr("did you mean '--output'?"));
  EXPECT_THAT(refusal("run demo extra words"), HasSubstr("duet: run: unexpected: extra words (duet run --help"));
}

TEST(CommandLine, WhatACommandNeedsIsSaidInItsWords) {
  const Answer bare = duet_program("");
  EXPECT_THAT(bare.err, AllOf(HasSubstr("duet [OPTIONS] SUBCOMMAND"), HasSubstr("retarget")));
  EXPECT_THAT(duet_program("list").err, HasSubstr("duet: list: expected what: tasks, "));
  EXPECT_THAT(duet_program("compare r").err,
              AllOf(HasSubstr("duet: compare: expected b: run"), Not(HasSubstr("expected a "))));
  EXPECT_THAT(duet_program("synth hug").err,
              HasSubstr("duet: synth: expected --output: folder for the clips (NPZ) (duet synth --help"));
  EXPECT_THAT(duet_program("dataset").err, HasSubstr("duet: dataset: expected a command, one of inspect"));
}

TEST(CommandLine, APolicyThatTakesTheTimeOfTheRunIsNamed) {
  const test::ScratchFolder folder;
  ASSERT_EQ(duet_program("run demo -q -s clips.synth.per_task=1 -s tasks=[wave] --engines playback --controllers pd "
                         "--policies replay -o " +
                         (folder / "run"))
                .code,
            0);
  const std::string report = "report -q " + (folder / "run") + " -f md -o " + folder / "report";
  EXPECT_THAT(duet_program(report).out, Not(HasSubstr("for a plan")));
  const std::string rows = folder / "run/episodes.jsonl";
  std::istringstream lines(read_file(rows));
  std::string slow;
  for (std::string line; std::getline(lines, line);) {
    nlohmann::json row = nlohmann::json::parse(line);
    if (row["policy"] == "replay") row["policy_ms"] = {{"p50", 1900.0}, {"p95", 1950.0}, {"max", 2000.0}};
    slow += row.dump() + '\n';
  }
  write_file(rows, slow);
  ASSERT_EQ(duet_program(report).code, 0);
  EXPECT_THAT(
      read_file(folder / "report/leaderboard.md"),
      HasSubstr("policy 'replay' takes 1.9 s for a plan (median over 1 episodes) and is asked for one every 0.2 s"));
}

TEST(CommandLine, SuitesAreListedAndRunByName) {
  const Answer list = duet_program("list suites");
  EXPECT_EQ(list.code, 0);
  EXPECT_THAT(list.out, AllOf(HasSubstr("reactivity"), HasSubstr("hhoi-reactivity"), HasSubstr("1134 episodes"),
                              HasSubstr("Does the robot act when its partner does?")));
  const Answer dry = duet_program("run spatial --dry-run");
  EXPECT_EQ(dry.code, 0);
  EXPECT_THAT(dry.out, HasSubstr("name: hhoi-spatial"));
  const Answer unknown = duet_program("run spacial --dry-run");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("unknown suite 'spacial': did you mean 'spatial'?"));
}

TEST(CommandLine, CompletionNamesCommandsOptionsAndSuites) {
  const Answer bash = duet_program("completion bash");
  EXPECT_EQ(bash.code, 0);
  EXPECT_THAT(bash.out, AllOf(HasSubstr("complete -o default -F _duet duet"), HasSubstr("--certificate"),
                              HasSubstr("controllers core"), HasSubstr("doctor list")));
  EXPECT_EQ(duet_program("completion bash | bash -n").code, 0);
  EXPECT_THAT(duet_program("completion zsh").out, HasSubstr("bashcompinit"));
  EXPECT_EQ(duet_program("completion fish").code, 2);
}

// A program in a pipe: standard output is one document or empty, what went wrong is on standard error.
TEST(CommandLine, ErrorsWithJsonLeaveStandardOutputEmpty) {
  for (const char* arguments :
       {"run nowhere.yaml --json -o x", "list taskz --json", "score nowhere.npz --json", "list --jsn", "run --json"}) {
    const Answer answer = duet_program(arguments);
    EXPECT_EQ(answer.code, 2) << arguments;
    EXPECT_EQ(answer.out, "") << arguments;
    EXPECT_THAT(answer.err, ::testing::StartsWith("duet: ")) << arguments;
  }
}

TEST(CommandLine, BenchGatesWhatIsNotReached) {
  const Answer answer = duet_program("bench kinematics/forward metrics/detectors --seconds 0.05 --gate --json -q");
  bool reached = true;
  const nlohmann::json report = nlohmann::json::parse(answer.out);
  for (const auto& figure : report.at("benchmarks")) reached = reached && figure.value("reached", true);
  EXPECT_EQ(answer.code, reached ? 0 : 1);
  EXPECT_EQ(duet_program("bench kinematics/forward --seconds 0.05 -q").code, 0);  // without it a figure is a figure
}

TEST(CommandLine, MissingEngineIsRefusedByName) {
  const Answer answer = duet_program("doctor --need warp9");
  EXPECT_EQ(answer.code, 2);
  EXPECT_EQ(answer.out, "");
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

TEST(CommandLine, ClipsOfATrainingAreAMannerAndACount) {
  const auto refusal = [](const std::string& kind) {
    const Answer answer = duet_program("train dstar --clips " + kind);
    EXPECT_EQ(answer.code, 2) << kind;
    return answer.err;
  };
  const std::string expected = "--clips: expected a manner, ':' and 1 to 100000 clips, as in people:400, found ";
  for (const char* kind : {"people", "people:0", "people:-3", "people:2.5", "people:x", "people:100001"})
    EXPECT_THAT(refusal(kind), HasSubstr(expected + "'" + kind + "'"));
  EXPECT_THAT(refusal("persons:3"),
              HasSubstr("--clips: expected rehearsed or people or varied before the ':', found 'persons:3'"));
}

TEST(CommandLine, ListSaysWhatControllersAndPerturbationsAre) {
  const Answer controllers = duet_program("list controllers");
  EXPECT_EQ(controllers.code, 0) << controllers.err;
  EXPECT_THAT(controllers.out, HasSubstr("body any, does not walk; "));
  const Answer perturbations = duet_program("list perturbations");
  EXPECT_EQ(perturbations.code, 0) << perturbations.err;
  EXPECT_THAT(perturbations.out, HasSubstr("push: {force: 60, duration: 1, every: 4}"));
}

TEST(CommandLine, ListHasTheLargestExplicitStepOfEveryController) {
  const Answer answer = duet_program("list controllers --stability --json");
  ASSERT_EQ(answer.code, 0) << answer.err;
  const nlohmann::json list = nlohmann::json::parse(answer.out);
  std::map<std::string, const nlohmann::json*> by_name;
  for (const nlohmann::json& entry : list) by_name[entry.at("name")] = &entry;
  for (const char* name : {"pd on g1", "wbc_sim on g1", "holosoma on g1", "rl_gym on g1_12dof", "holosoma_t1 on t1"}) {
    ASSERT_TRUE(by_name.contains(name)) << answer.out;
    const nlohmann::json& entry = *by_name[name];
    EXPECT_LT(entry.at("bare").at("largest_step_s"), entry.at("with_armature").at("largest_step_s")) << name;
    EXPECT_THAT(entry.at("bare").at("joint").get<std::string>(), Not(IsEmpty())) << name;
  }
  EXPECT_THAT(duet_program("list tasks --stability").err, HasSubstr("expected `duet list controllers`, found 'tasks'"));
}

TEST(CommandLine, DoctorSaysWhichControllersCanRun) {
  EXPECT_THAT(duet_program("doctor").out, AllOf(HasSubstr("controller vmc"), HasSubstr("viewer of replays")));
}

TEST(CommandLine, JsonIsOneDocumentOnStandardOutput) {
  for (const char* command : {"doctor --json", "list tasks --json", "list metrics --json", "list readings --json"}) {
    const Answer answer = duet_program(command);
    EXPECT_EQ(answer.code, 0) << command << answer.err;
    EXPECT_FALSE(nlohmann::json::parse(answer.out, nullptr, false).is_discarded()) << command;
  }
}

TEST(CommandLine, ThePlotOfEnginesStandsBesideThePageAlone) {
  const test::ScratchFolder folder;
  const std::string report = "report -q --no-clips " + std::string(DUET_SOURCE_DIR) + "/results/published/policies -o ";
  ASSERT_EQ(duet_program(report + (folder / "page") + " -f html").code, 0);
  ASSERT_EQ(duet_program(report + (folder / "text") + " -f md,csv").code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder / "page/engines.svg"));
  EXPECT_FALSE(std::filesystem::exists(folder / "text/engines.svg"));
  EXPECT_FALSE(std::filesystem::exists(folder / "page/engines.md"));
  for (const char* name : {"leaderboard", "engines", "controllers", "policies"})
    EXPECT_TRUE(std::filesystem::exists(folder / ("text/" + std::string(name) + ".md"))) << name;
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
  EXPECT_FALSE(std::filesystem::exists(folder / "report/engines.svg"));  // of one engine there is nothing to draw
  EXPECT_THAT(read_file(folder / "report/report.html"), HasSubstr("<svg"));
  EXPECT_THAT(read_file(folder / "report/report.html"),
              AllOf(::testing::Not(HasSubstr("id=\"training\"")), HasSubstr("It is no upper bound"),
                    HasSubstr("the robot passes through it")));
  write_file(folder / "curves.csv", "steps,return\n0,1\n100,3\n");
  const std::string report = "report -q " + (folder / "run") + " -f html --no-clips -o " + (folder / "report");
  ASSERT_EQ(duet_program(report + " --curves " + (folder / "curves.csv")).code, 0);
  EXPECT_THAT(read_file(folder / "report/report.html"), HasSubstr("return against steps"));
  write_file(folder / "curves.csv", "steps,return\n0,x\n");
  const Answer refused = duet_program(report + " --curves " + (folder / "curves.csv"));
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("curves.csv': line 2: column 'return': expected a number, found 'x'"));

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

// A fault that is found only after a file was read names the file all the same.
TEST(CommandLine, EveryRefusalNamesItsFile) {
  const test::ScratchFolder folder;
  ASSERT_EQ(duet_program("synth hug -q -n 1 -o " + (folder / "clips")).code, 0);
  const std::string clip = std::filesystem::directory_iterator(folder / "clips")->path().string();
  const std::string suite =
      "schema: duet.suite/1\nname: cli\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
      "controllers: [pd]\npolicies: [replay]\nstart: clip\n";
  for (const char* task : {"hug", "wave"}) {
    write_file(folder / "suite.yaml", suite + "tasks: [" + task + "]\n");
    ASSERT_EQ(duet_program("run -q " + (folder / "suite.yaml") + " -o " + (folder / task)).code, 0);
  }
  Npz slow = Npz::load(clip);
  slow.set_number("rate_hz", 0.001);
  slow.save(folder / "slow.npz");
  write_file(folder / "golden.json", R"({"schema": "duet.golden/1"})");
  const std::string g1 = default_card_path(), last = "  - {frame: pelvis, smpl: pelvis}\n";
  std::string card = read_file(g1);
  ASSERT_NE(card.find(last), std::string::npos);
  write_file(folder / "fewer.yaml", card.erase(card.find(last), last.size()));
  const auto refusal = [](const std::string& arguments) {
    const Answer answer = duet_program(arguments);
    EXPECT_EQ(answer.code, 2) << arguments;
    return answer.err;
  };
  EXPECT_EQ(refusal("check -q " + (folder / "hug") + " -b " + (folder / "golden.json")),
            "duet: " + (folder / "golden.json") + ": golden baseline: expected the key 'suite', found none\n");
  for (const char* command : {"score -q ", "retarget -q -o x "})
    EXPECT_THAT(refusal(command + (folder / "slow.npz")), HasSubstr("slow.npz': key 'rate_hz': expected 5 Hz or more"));
  EXPECT_THAT(refusal("retarget -q -o x " + clip + " --card " + (folder / "fewer.yaml") + " --urdf " +
                      std::filesystem::path(g1).replace_filename("g1.urdf").string()),
              HasSubstr("fewer.yaml: robot 'g1': expected the 16 retarget pairs"));
  EXPECT_EQ(refusal("run -q /dev/zero --dry-run -o x"),
            "duet: cannot read '/dev/zero': expected at most 67108864 bytes, found more\n");
  EXPECT_THAT(refusal("compare -q " + (folder / "hug") + " " + (folder / "wave")),
              HasSubstr("B = " + (folder / "wave") + ": nothing pairs"));
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
           {"import " + (folder / "empty.bvh") + " --task hug -o x.npz", "the file is empty"},
           {"import " + (folder / "empty.pkl") + " -o x.npz", "empty.pkl"},
           {"retarget " + (folder / "broken.npz") + " -o x", "broken.npz"},
           {"score " + (folder / "nowhere.npz"), "nowhere.npz"},
           {"run " + (folder / "nowhere.yaml") + " -o x", "nowhere.yaml"},
           {"report " + (folder / "nowhere"), "nowhere"},
           {"synth hugg -o x", "did you mean 'hug'"},
           {"synth hug --side up -o x", "--side 'up'"},
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

// Somebody who goes through the act 25 times, slowly: 500 s at 5 Hz.
InteractionClip long_clip() {
  InteractionClip clip = synthesize(Task::kHandshake, SynthesisOptions());
  for (HumanMotion* motion : {&clip.a, &clip.b}) {
    PointTracks joints(25 * motion->frames(), kSmplJoints);
    for (int t = 0; t < joints.frames(); ++t) joints.frame(t) = motion->joints.frame(t % motion->frames());
    motion->joints = joints;
    motion->rotations.clear();
    motion->rate_hz = 5.0;
  }
  return clip;
}

#ifndef DUET_SANITIZED  // it needs terabytes of addresses
TEST(CommandLine, AClipTooLongForTheMemoryIsRefusedByNameBeforeTheWork) {
  const test::ScratchFolder folder;
  const std::string file = folder / "long.npz";
  save_clip(long_clip(), file);
  for (const std::string& command : {"retarget " + file + " -o " + (folder / "out"), "score " + file}) {
    const Answer answer = duet_program(command + " -q", "ulimit -v 500000;");
    EXPECT_EQ(answer.code, 2);
    EXPECT_THAT(answer.err, AllOf(HasSubstr(file), HasSubstr("frames at 50 Hz ("), HasSubstr("GB of memory, and ")));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(CommandLine, WithoutMemoryItSaysWhatThereIsNotEnoughFor) {
  const test::ScratchFolder folder;
  ASSERT_EQ(duet_program("synth wave -n 1 -q -o " + (folder / "clips")).code, 0);
  int told = 0;
  for (int kilobytes = 40000; kilobytes <= 240000; kilobytes += 10000) {
    const Answer answer =
        duet_program("score -q -j4 " + (folder / "clips"), "ulimit -v " + std::to_string(kilobytes) + ";");
    if (answer.code == 0 || answer.code == 127) continue;  // 127: the libraries find no room
    EXPECT_EQ(answer.code, 2) << kilobytes << ": " << answer.err;
    EXPECT_THAT(answer.err, AllOf(Not(HasSubstr("bad_alloc")), Not(HasSubstr("terminate")))) << kilobytes;
    told += answer.err.find("not enough memory for") != std::string::npos ? 1 : 0;
  }
  EXPECT_GT(told, 0);
}
#endif

TEST(CommandLine, LongNamesAreCutInMessages) {
  const std::string name(4400, 'a');
  for (const std::string& command : {"retarget " + name + " -o x", "report " + name, "run " + name, "list " + name,
                                     "run demo -o x --controllers " + name}) {
    const Answer answer = duet_program(command);
    EXPECT_EQ(answer.code, 2) << command.substr(0, 12);
    EXPECT_LT(answer.err.size(), 1800U) << answer.err;
    EXPECT_THAT(answer.err, HasSubstr("aaa...")) << command.substr(0, 12);
  }
}

// A suite under the name of one that ships, its oracle under a name of its own.
TEST(CommandLine, ARunEndsOnOneScreenThatSaysWhatIsNoCompetitorAndNotTheSuite) {
  const test::ScratchFolder folder;
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: hhoi-spatial\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
             "engines: [playback]\ncontrollers: [pd]\nstart: clip\n"
             "policies: [{name: hindsight, use: replay}, retrieval]\n");
  const Answer run = duet_program("run " + (folder / "suite.yaml") + " -o " + (folder / "run"));
  ASSERT_EQ(run.code, 0) << run.err;
  const char* warning = "hhoi-spatial 1.0.0 is NOT the suite of that name that ships";
  EXPECT_THAT(run.out, AllOf(::testing::StartsWith("pd with retrieval: "), HasSubstr(warning),
                             HasSubstr("(playback, 1 episode)"), HasSubstr("\n  -  hindsight (knows the motion) "),
                             HasSubstr("\n  -  null (stands still) ")));
  std::istringstream lines(run.out);
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) EXPECT_LE(line.size(), 100U) << line;
  EXPECT_LE(count, 20);
  ASSERT_EQ(duet_program("report -q --no-clips " + (folder / "run") + " -f md,csv,json,tex,html").code, 0);
  for (const char* name : {"board.md", "board.csv", "board.json", "board.tex", "leaderboard.md", "leaderboard.csv",
                           "leaderboard.json", "leaderboard.tex", "report.html"})
    EXPECT_THAT(read_file(folder / ("run/" + std::string(name))), HasSubstr(warning)) << name;
  EXPECT_THAT(read_file(folder / "run/report.html"), HasSubstr("<title>hhoi-spatial 1.0.0, NOT the suite"));
}

TEST(CommandLine, RepeatsOfAnEpisodeCountOnceAndAreSaid) {
  const test::ScratchFolder folder;
  write_file(folder / "suite.yaml",
             "schema: duet.suite/1\nname: cli\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
             "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\nepisodes_per_clip: 4\n");
  const Answer run = duet_program("run " + (folder / "suite.yaml") + " -o " + (folder / "run"));
  ASSERT_EQ(run.code, 0) << run.err;
  const char* note = "6 of 8 episodes repeat another one of their clip bit for bit and count once";
  EXPECT_THAT(run.err, HasSubstr(note));
  EXPECT_THAT(run.out, HasSubstr(note));
  ASSERT_EQ(duet_program("report -q --no-clips " + (folder / "run")).code, 0);
  EXPECT_THAT(read_file(folder / "run/leaderboard.md"), HasSubstr(note));
  EXPECT_THAT(read_file(folder / "run/report.html"), HasSubstr(note));
}

}  // namespace
}  // namespace duet
