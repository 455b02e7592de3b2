// A run folder as users treat it: two programs at once, kills, full disks, links, closed streams. Runs the built
// `duet`.
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <array>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <map>
#include <thread>

#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/execution/runner.h"
#include "duet/experiment/plan/clips.h"
#include "tests/app/program.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct Ended {
  int code = -1;
  std::string text;  // both streams, unless the script sends them elsewhere
};

class RunFolder : public testing::Test {
 protected:
  // A script for bash in which $D is the program and $o the scratch folder; its exit code is that of its last command.
  [[nodiscard]] Ended bash(const std::string& script) const {
    write_file(folder_ / "script.sh", "D='" + test::program() + "'\no='" + (folder_ / "") + "'\n" + script + "\n");
    FILE* pipe = popen(("bash '" + (folder_ / "script.sh") + "' 2>&1").c_str(), "r");
    Ended ended;
    std::array<char, 4096> buffer{};
    while (const size_t count = fread(buffer.data(), 1, buffer.size(), pipe)) ended.text.append(buffer.data(), count);
    const int status = pclose(pipe);
    ended.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    return ended;
  }

  // `tasks` and `more` as YAML; playback of synthesised clips.
  void write_suite(const std::string& tasks = "[wave, handshake]", int per_task = 1,
                   const std::string& more = "") const {
    write_file(folder_ / "suite.yaml",
               "schema: duet.suite/1\nname: folder\nversion: 1.0.0\nclips: {synth: {per_task: " +
                   std::to_string(per_task) + "}}\ntasks: " + tasks +
                   "\nengines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\n" + more);
  }

  [[nodiscard]] std::vector<EpisodeRow> rows(const std::string& run = "run") const {
    return load_run(folder_ / run).rows;
  }

  test::ScratchFolder folder_;
};

TEST_F(RunFolder, TwoProgramsAtOnceShareTheWorkAndBothEndWell) {
  write_suite("[wave, handshake, bend]", 3);
  const Ended ended = bash(
      "$D run $o/suite.yaml -o $o/run -j1 -q >/dev/null & a=$!\n"
      "$D run $o/suite.yaml -o $o/run -j1 -q >/dev/null & b=$!\n"
      "wait $a; x=$?; wait $b; echo codes $x $?; wc -l < $o/run/episodes.jsonl");
  EXPECT_EQ(ended.text, "codes 0 0\n18\n");
  EXPECT_EQ(rows().size(), 18U);
  EXPECT_TRUE(load_run(folder_ / "run").warnings.empty());
}

TEST_F(RunFolder, PartsAtOnceMakeOneWholeRun) {
  write_suite("[wave, handshake, bend]", 2);
  const Ended ended = bash(
      "for t in wave handshake bend; do $D run $o/suite.yaml --tasks $t -o $o/run -j1 -q >/dev/null & done; wait\n"
      "$D report $o/run -q --no-clips");
  EXPECT_EQ(ended.code, 0) << ended.text;
  EXPECT_EQ(rows().size(), 12U);
  EXPECT_EQ(completeness(load_run(folder_ / "run")), "");
  EXPECT_THAT(ended.text, Not(HasSubstr("partial")));
}

TEST_F(RunFolder, APartialRunSaysSoInEveryOutputAndIsNeitherBlessedNorPublished) {
  write_suite();
  ASSERT_EQ(bash("$D run $o/suite.yaml -o $o/run -q").code, 0);
  const std::string path = folder_ / "run/episodes.jsonl", text = read_file(path);
  write_file(path, text.substr(0, text.rfind('\n', text.size() - 2) + 1));  // as after a kill
  const std::string note = "3 of 4 episodes: partial";
  EXPECT_THAT(bash("$D report $o/run -q -f md,csv,json,tex,html,sqlite -o $o/report").text, HasSubstr(note));
  for (const char* name : {"leaderboard.md", "leaderboard.csv", "leaderboard.json", "leaderboard.tex", "report.html",
                           "results.sqlite", "controllers.md", "controllers.csv"})
    if (const std::string file = folder_ / (std::string("report/") + name); fs::exists(file)) {
      EXPECT_THAT(read_file(file), HasSubstr(note)) << name;
    }
  EXPECT_TRUE(fs::exists(folder_ / "report/results.sqlite"));
  EXPECT_THAT(bash("$D report $o/run --no-clips -q --json -o $o/report").text, HasSubstr(note));
  EXPECT_THAT(bash("$D compare -q $o/run $o/run").text, HasSubstr(note));
  for (const std::string& action : {std::string("bless"), std::string("publish")}) {
    const Ended refused = bash("$D " + action + " -q $o/run -o $o/" + action);
    EXPECT_EQ(refused.code, 2) << action;
    EXPECT_THAT(refused.text, AllOf(HasSubstr(note), HasSubstr("with --partial"))) << action;
    EXPECT_FALSE(fs::exists(folder_ / action));
    const Ended allowed = bash("$D " + action + " -q $o/run --partial -o $o/" + action);
    EXPECT_EQ(allowed.code, 0) << allowed.text;
    EXPECT_THAT(allowed.text, HasSubstr(note)) << action;
  }
  EXPECT_THAT(bash("$D check -q $o/run -b $o/bless").text, HasSubstr(note));
  EXPECT_THAT(bash("$D report $o/publish -q --no-clips -o $o/report").text, HasSubstr(note));
  ASSERT_EQ(bash("$D run $o/suite.yaml -o $o/run -q").code, 0);
  EXPECT_THAT(bash("$D report $o/run -q --no-clips").text, Not(HasSubstr("partial")));
}

// The folder that is published lies elsewhere, and the name of the network is that of one that ships.
TEST_F(RunFolder, APublishedRunFindsANetworkThatIsNamedFromTheRun) {
  fs::create_directory(folder_ / "nets");
  fs::copy(std::string(DUET_SOURCE_DIR) + "/policies/dstar/dp.safetensors", folder_ / "nets/dstar.safetensors");
  write_suite("[wave]");
  const Ended ended = bash(
      "cd $o; $D run suite.yaml -o run -q -s 'policies=[{name: mine, use: dp, options: {network: "
      "nets/dstar.safetensors}}]' "
      "&& $D publish run -o a/b/published -q && $D verify a/b/published -q --all");
  EXPECT_EQ(ended.code, 0) << ended.text;
}

TEST_F(RunFolder, AnErrorOfStorageStopsTheRunAndNoEpisodeFailsByIt) {
  write_suite("[wave, handshake]", 1, "record: {trajectories: all}\n");
  const Ended full = bash("ulimit -f 24; $D run $o/suite.yaml -o $o/run -q");
  EXPECT_EQ(full.code, 2) << full.text;
  EXPECT_THAT(full.text, AllOf(HasSubstr("cannot write"), HasSubstr("File too large"),
                               HasSubstr("the same command goes on where it stopped")));
  for (const EpisodeRow& row : rows()) EXPECT_EQ(row.outcome, Outcome::kOk) << row.message;
  const Ended resumed = bash("$D run $o/suite.yaml -o $o/run -q");
  EXPECT_EQ(resumed.code, 0) << resumed.text;
  EXPECT_EQ(rows().size(), 4U);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "run/trajectories"), fs::directory_iterator()), 4);
}

TEST_F(RunFolder, AReportThatTheDiskDoesNotTakeLeavesNoNewTableAmongOldOnes) {
  write_suite();
  ASSERT_EQ(bash("$D run $o/suite.yaml -o $o/run -q").code, 0);
  write_file(folder_ / "report/leaderboard.md", "old");
  const Ended full = bash("ulimit -f 24; $D report $o/run -q --no-clips -f md,csv,html -o $o/report");
  EXPECT_EQ(full.code, 2) << full.text;
  EXPECT_THAT(full.text, AllOf(HasSubstr("cannot write '"), HasSubstr("/report/"), HasSubstr("File too large")));
  EXPECT_EQ(read_file(folder_ / "report/leaderboard.md"), "old");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "report"), fs::directory_iterator()), 1);
}

TEST_F(RunFolder, RetryErrorsRunsThemAgainAndNothingElse) {
  write_suite();
  ASSERT_EQ(bash("$D run $o/suite.yaml -o $o/run -q").code, 0);
  std::vector<EpisodeRow> before = rows();
  before[1].outcome = Outcome::kError;
  before[1].message = "cannot write: No space left on device";
  before[1].success = false;
  std::string text;
  for (const EpisodeRow& row : before) text += to_json(row).dump() + "\n";
  write_file(folder_ / "run/episodes.jsonl", text);
  EXPECT_THAT(bash("$D run $o/suite.yaml -o $o/run").text, HasSubstr("4 were there, 0 run now"));
  EXPECT_EQ(rows()[1].outcome, Outcome::kError);
  EXPECT_THAT(bash("$D run $o/suite.yaml --retry-errors -o $o/run").text, HasSubstr("3 were there, 1 run now: 1 ok"));
  EXPECT_EQ(rows().size(), 4U);
  EXPECT_EQ(rows()[1].outcome, Outcome::kOk);
  EXPECT_TRUE(read_file(folder_ / "run/episodes.jsonl").starts_with(text));  // append-only
}

TEST_F(RunFolder, TimeOutsAreSaidAndTheSameCommandRunsThemAgain) {
  write_suite("[wave, handshake]", 1, "limits: {wall_s_per_episode: 1.0e-9}\n");
  const Ended late = bash("$D run $o/suite.yaml -o $o/run -q 2>&1 >/dev/null");
  EXPECT_EQ(late.code, 3);
  EXPECT_THAT(late.text, HasSubstr("duet: warning: 4 of the episodes passed `limits.wall_s_per_episode`"));
  write_suite();
  ASSERT_EQ(bash("$D run $o/suite.yaml -o $o/good -q").code, 0);
  std::vector<EpisodeRow> before = rows("good");
  before[1].outcome = Outcome::kTimedOut;
  before[1].success = false;
  std::string text;
  for (const EpisodeRow& row : before) text += to_json(row).dump() + "\n";
  write_file(folder_ / "good/episodes.jsonl", text);
  const Ended again = bash("$D run $o/suite.yaml -o $o/good");
  EXPECT_EQ(again.code, 0);
  EXPECT_THAT(again.text, HasSubstr("3 were there, 1 run now: 1 ok"));
  EXPECT_EQ(rows("good")[1].outcome, Outcome::kOk);
}

TEST_F(RunFolder, NothingIsWrittenThroughALinkOfARunThatCameFromElsewhere) {
  write_suite();
  ASSERT_EQ(bash("$D run $o/suite.yaml -o $o/run -q").code, 0);
  write_file(folder_ / "mine", "mine");
  for (const char* name : {"leaderboard.md", "report.html", "results.sqlite", "leaderboard.csv"}) {
    fs::create_symlink(folder_ / "mine", folder_ / (std::string("run/") + name));
    const Ended refused = bash("$D report $o/run -q --no-clips -f md,html,sqlite,csv");
    EXPECT_EQ(refused.code, 2) << name;
    EXPECT_THAT(refused.text, AllOf(HasSubstr(name), HasSubstr("is a symbolic link"))) << name;
    EXPECT_EQ(read_file(folder_ / "mine"), "mine") << name;
    fs::remove(folder_ / (std::string("run/") + name));
  }
  fs::create_symlink(folder_ / "mine", folder_ / "run/lock.tmp");  // a name of nobody
  EXPECT_EQ(bash("$D report $o/run -q --no-clips").code, 0);
  fs::remove(folder_ / "run/episodes.jsonl");
  fs::create_symlink(folder_ / "mine", folder_ / "run/episodes.jsonl");
  EXPECT_EQ(bash("$D run $o/suite.yaml -q -o $o/run").code, 2);
  EXPECT_EQ(read_file(folder_ / "mine"), "mine");
  // The folder that the user names may itself be one.
  fs::create_directory(folder_ / "real");
  fs::create_symlink("real", folder_ / "alias");
  EXPECT_EQ(bash("$D run $o/suite.yaml -q -o $o/alias").code, 0);
  EXPECT_EQ(rows("real").size(), 4U);
}

TEST_F(RunFolder, ClosedStreamsDoNotEndTheProgram) {
  write_suite();
  EXPECT_EQ(bash("$D run $o/suite.yaml -o $o/a >/dev/null 2>&-").code, 0);
  EXPECT_EQ(bash("$D run $o/suite.yaml -o $o/b >&- 2>&- <&-").code, 0);
  EXPECT_EQ(rows("a").size(), 4U);
  EXPECT_EQ(rows("b").size(), 4U);
  EXPECT_EQ(bash("$D list tasks >&- 2>&-").code, 0);
  EXPECT_EQ(bash("$D list nothing 2>&-").code, 2);
  if (fs::exists("/dev/full")) {
    EXPECT_EQ(bash("$D run $o/nowhere.yaml -o $o/c 2>/dev/full").code, 2);
    EXPECT_EQ(bash("$D run $o/suite.yaml -o $o/d >/dev/null 2>/dev/full").code, 0);
  }
}

TEST_F(RunFolder, SignalsAndTheTimeLimitAreHeardWhileClipsArePreparedAndTheRunGoesOn) {
  write_suite("[hug, handshake, high_five, wave, bend, fly_kiss]", 40);
  for (const auto& [signal, code] : std::map<std::string, int>{{"HUP", 75}, {"TERM", 75}, {"INT", 130}}) {
    const Ended ended = bash(
        "ready() { ls $o/run/prepared 2>/dev/null | wc -l; }; n=$(ready); $D run $o/suite.yaml -o $o/run -j1 -q "
        ">/dev/null & p=$!; until [ $(ready) -gt $n ] || ! kill -0 $p; do sleep 0.01; done; kill -" +
        signal + " $p; wait $p");
    EXPECT_EQ(ended.code, code) << signal << ended.text;
  }
  EXPECT_EQ(bash("$D run $o/suite.yaml --time-limit 0.2 -o $o/run -j1 -q").code, 75);
  EXPECT_EQ(bash("nohup $D run $o/suite.yaml --time-limit 0.5 -o $o/run -j1 -q >/dev/null & p=$!; sleep 0.1; kill -HUP "
                 "$p; wait $p")
                .code,
            75);
  const duet::Run run = load_run(folder_ / "run");
  EXPECT_EQ(run.info.plan->episodes, 480);
  EXPECT_TRUE(is_partial(run));
}

TEST_F(RunFolder, AKilledPreparationKeepsTheClipsThatWereReadyAndACompleteRunKeepsNone) {
  write_suite();
  RunOptions options;
  options.time_limit = 1e9;
  Progress quiet(Progress::Style::kQuiet);
  const Suite suite = load_suite(folder_ / "suite.yaml");
  const auto robot = test::g1();
  const std::vector<PairedMotion> fresh = prepare_clips(suite, *robot, 1, quiet);
  const std::vector<PairedMotion> made = prepare_clips(suite, *robot, 1, quiet, {.keep_in = folder_ / "run"});
  ASSERT_EQ(std::distance(fs::directory_iterator(folder_ / "run/prepared"), fs::directory_iterator()), 2);
  const std::vector<PairedMotion> found = prepare_clips(suite, *robot, 1, quiet, {.keep_in = folder_ / "run"});
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    EXPECT_EQ(paired_motion_bytes(found[i]), paired_motion_bytes(fresh[i]));
    EXPECT_EQ(paired_motion_bytes(made[i]), paired_motion_bytes(fresh[i]));
  }
  // The clips that are kept are those that are used.
  const fs::path file = fs::directory_iterator(folder_ / "run/prepared")->path();
  PairedMotion other = load_paired_motion(file.string());
  other.clip_id = "from the folder";
  save_paired_motion(other, file.string());
  std::string ids;
  for (const PairedMotion& clip : prepare_clips(suite, *robot, 1, quiet, {.keep_in = folder_ / "run"}))
    ids += clip.clip_id + " ";
  EXPECT_THAT(ids, HasSubstr("from the folder"));
  fs::remove_all(folder_ / "run");
  EXPECT_EQ(bash("$D run $o/suite.yaml -o $o/run -q").code, 0);
  EXPECT_FALSE(fs::exists(folder_ / "run/prepared"));
}

TEST_F(RunFolder, ADamagedOrForeignPreparedClipIsMadeAnew) {
  write_suite();
  Progress quiet(Progress::Style::kQuiet);
  Suite suite = load_suite(folder_ / "suite.yaml");
  const auto robot = test::g1();
  const std::vector<PairedMotion> fresh = prepare_clips(suite, *robot, 1, quiet, {.keep_in = folder_ / "run"});
  for (const auto& entry : fs::directory_iterator(folder_ / "run/prepared")) {
    std::string bytes = read_file(entry.path().string());
    bytes[bytes.size() / 2] ^= 0x10;
    write_file(entry.path().string(), bytes);
  }
  const std::vector<PairedMotion> again = prepare_clips(suite, *robot, 1, quiet, {.keep_in = folder_ / "run"});
  for (std::size_t i = 0; i < fresh.size(); ++i)
    EXPECT_EQ(paired_motion_bytes(again[i]), paired_motion_bytes(fresh[i]));
  suite.retarget["stage1-iterations"] = "3";  // another option: other clips beside the first
  prepare_clips(suite, *robot, 1, quiet, {.keep_in = folder_ / "run"});
  suite.clips.synth_seed = 7;
  prepare_clips(suite, *robot, 1, quiet, {.keep_in = folder_ / "run"});
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "run/prepared"), fs::directory_iterator()), 6);
}

TEST_F(RunFolder, PreparationThatIsStoppedThrowsStopped) {
  write_suite();
  Progress quiet(Progress::Style::kQuiet);
  const StopToken stop(1e-9);
  EXPECT_THROW(prepare_clips(load_suite(folder_ / "suite.yaml"), *test::g1(), 1, quiet, {.stop = &stop}), Stopped);
}

TEST_F(RunFolder, WorkThatDoesNotHearTheSignIsEndedAfterItsGrace) {
  std::atomic<int> calls{0};
  const StopToken stop(1e-9);
  {
    const Watchdog watch(stop, 0.01, [&](RunEnd end) { calls += end == RunEnd::kTimeLimit ? 1 : 100; });
    while (calls == 0) std::this_thread::yield();
  }
  EXPECT_EQ(calls, 1);
  {
    const Watchdog watch(stop, 1e6, [&](RunEnd) { ++calls; });
  }
  const StopToken never;
  {
    const Watchdog watch(never, 0.0, [&](RunEnd) { ++calls; });
  }
  EXPECT_EQ(calls, 1);
}

TEST_F(RunFolder, TheStopIsHeardWithinAControlPeriodOfManySteps) {
  for (const EngineInfo& engine : engines())
    if (engine.name == "mujoco" && !engine.available) GTEST_SKIP() << "not run: MuJoCo absent";
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  suite.start = SuiteStart::kAct;
  suite.profile.engines["mujoco"].dt = 1e-6;
  const PairedMotion clip = test::paired(Task::kWave, *test::g1());
  const auto experiment = test::experiment_of(suite, {clip});
  int looks = 0;
  EXPECT_THROW((void)experiment->run(test::first_of(*experiment, 7), {.stop_asked = [&] { return ++looks >= 2; }}),
               EpisodeInterrupted);
  EXPECT_EQ(looks, 3);  // twice within the first period, once after it
  suite.wall_limit = 0.001;
  const auto hurried = test::experiment_of(suite, {clip});
  const EpisodeRow row = hurried->run(test::first_of(*hurried, 7));
  EXPECT_EQ(row.outcome, Outcome::kTimedOut);
  EXPECT_LE(row.frames, 1);
}

TEST_F(RunFolder, MistakesOfASuiteAreToldBeforeTheFirstEpisodeAndByADryRun) {
  write_file(folder_ / "limits.yaml", "schema: nonsense\n");
  const std::map<std::string, std::string> cases = {
      {"contact_limits: limits.yaml\npartner: solid\n", "limits.yaml"},
      {"dt: 4294967296\n", "expected a step [s] of 1e-06 or more that divides 0.02, found 4294967296"},
      {"dt: 1e-8\n", "expected a step [s] of 1e-06 or more that divides 0.02"},
      {"dt: .nan\n", "dt"},
      {"dt: 0.003\n", "that divides 0.02, found 0.003"},
      {"limits: {wall_s_per_episode: .inf}\n", "wall_s_per_episode"},
      {"episodes_per_clip: 3000000000\n", "'episodes_per_clip': expected a whole number, 1 to 2147483647"},
      {"episodes_per_clip: 2000000000\n", "expected at most 10000000 episodes, found 8000000000"}};
  for (const auto& [yaml, names] : cases) {
    write_suite("[wave, handshake]", 1, yaml);
    for (const std::string& rest : {std::string(" --dry-run"), std::string(" -q -o $o/run")}) {
      const Ended refused = bash("$D run $o/suite.yaml" + rest);
      EXPECT_EQ(refused.code, 2) << yaml << rest;
      EXPECT_THAT(refused.text, HasSubstr(names)) << rest;
    }
  }
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

TEST_F(RunFolder, NumbersOfTheCommandLineHaveBounds) {
  write_suite();
  for (const auto& [command, names] : std::map<std::string, std::string>{
           {"run $o/suite.yaml -o $o/run -j 0", "--threads"},
           {"synth wave -o $o/clips -j 0", "--threads"},
           {"score $o -j 0", "--threads"},
           {"retarget $o -o $o/paired -j -3", "--threads"},
           {"report $o -j 0", "--threads"},
           {"verify $o -j 0", "--threads"},
           {"bench -j 0", "--threads"},
           {"run $o/suite.yaml -o $o/run --time-limit -1", "--time-limit: expected 0 to 1e9 s, found '-1'"},
           {"run $o/suite.yaml -o $o/run --time-limit nan", "--time-limit: expected 0 to 1e9 s, found 'nan'"},
           {"synth wave -n 2000000000 -o $o/clips",
            "--count: expected 1 to 100000 clips of each task, found 2000000000"},
           {"compare $o $o --resamples 2000000000", "--resamples"},
           {"bench --seconds 1e9", "--seconds"},
           {"run /dev/zero --dry-run", "cannot read '/dev/zero': expected at most 67108864 bytes, found more"},
           {"score $o/loop", "cannot use '"}}) {
    const Ended refused = bash("ln -sfn loop $o/loop; $D " + command);
    EXPECT_EQ(refused.code, 2) << command << refused.text;
    EXPECT_THAT(refused.text, HasSubstr(names)) << command;
  }
}

TEST(EpisodePlan, ArmsOfAClipFollowOneAnotherAndEachEpisodeIsMadeWhenItIsAskedFor) {
  Suite suite = test::playback_suite();
  suite.episodes_per_clip = 2;
  Embodiments bodies(suite);
  Progress quiet(Progress::Style::kQuiet);
  bodies.take_clips(prepare_clips(suite, *bodies.nominal(), 1, quiet));
  const EpisodePlan plan(suite, bodies);
  ASSERT_EQ(plan.size(), 8);
  for (int i = 0; i < plan.size(); ++i) {
    EXPECT_EQ(plan.at(i).arm, i % 2 == 0 ? "main" : "null");
    EXPECT_EQ(plan.at(i).episode, i / 2 % 2);
    EXPECT_EQ(plan.at(i).clip, &bodies.clips("pd")[i / 4]);
    EXPECT_EQ(plan.at(i).seed, plan.at(i / 2 * 2).seed);
  }
  suite.episodes_per_clip = 3000000;
  EXPECT_THAT(test::thrown_message<InputError>([&] { EpisodePlan(suite, bodies); }),
              HasSubstr("expected at most 10000000 episodes, found 12000000"));
}

TEST(EpisodePlan, ASuiteMayDrawAsAnotherOneDoes) {
  const auto seed_of_first = [](const std::string& name, const std::string& draws_of) {
    Suite suite = test::playback_suite();
    suite.name = name;
    suite.draws_of = draws_of;
    Embodiments bodies(suite);
    Progress quiet(Progress::Style::kQuiet);
    bodies.take_clips(prepare_clips(suite, *bodies.nominal(), 1, quiet));
    return EpisodePlan(suite, bodies).at(0).seed;
  };
  EXPECT_NE(seed_of_first("other", ""), seed_of_first("test", ""));
  EXPECT_EQ(seed_of_first("other", "test@1.0.0"), seed_of_first("test", ""));
}

// Its specs point into the experiment: it stays where it is.
TEST(Experiment, AndItsPlanCannotBeMovedOrCopied) {
  EXPECT_FALSE(std::is_move_constructible_v<Experiment> || std::is_move_assignable_v<Experiment>);
  EXPECT_FALSE(std::is_move_constructible_v<Embodiments> || std::is_move_assignable_v<Embodiments>);
  EXPECT_FALSE(std::is_move_constructible_v<EpisodePlan> || std::is_move_assignable_v<EpisodePlan>);
  EXPECT_FALSE((std::is_constructible_v<EpisodePlan, Suite, const Embodiments&>)) << "of a suite that is gone";
}

TEST(EpisodePlan, CountsWhatPartsHave) {
  Suite suite = test::playback_suite();
  const std::vector<Task> clips = {Task::kWave, Task::kHandshake, Task::kHandshake};
  EpisodeFilter wave, playback, nobody;
  wave.tasks = {"wave"};
  playback.engines = {"playback"};
  nobody.policies = {"dstar"};
  EXPECT_EQ(count_episodes(suite, clips, {EpisodeFilter()}), 6);
  EXPECT_EQ(count_episodes(suite, clips, {wave}), 2);
  EXPECT_EQ(count_episodes(suite, clips, {wave, playback}), 6);
  EXPECT_EQ(count_episodes(suite, clips, {nobody}), 3);  // the null arm
}

}  // namespace
}  // namespace duet
