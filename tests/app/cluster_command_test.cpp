// plan, work, status, submit and merge as a user or a scheduler gives them: exit codes, crashes, signals, scripts.
#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "duet/core/file.h"
#include "duet/rows/folder/run_directory.h"
#include "tests/app/program.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using test::Answer;
using test::duet_program;
using ::testing::AllOf;
using ::testing::HasSubstr;

class ClusterCommand : public testing::Test {
 protected:
  ClusterCommand() {
    fs::create_directory(engines_);
    for (const auto& entry : fs::directory_iterator(test::built_engines()))
      fs::create_symlink(entry.path(), fs::path(engines_) / entry.path().filename());
    fs::create_symlink(DUET_FAULTY_ENGINE, fs::path(engines_) / "duet_faulty.so");
    fs::create_directory(folder_ / "bin");
  }
  [[nodiscard]] Answer duet(const std::string& arguments) const {
    return duet_program(arguments, "DUET_ENGINES='" + engines_ + "' PATH='" + (folder_ / "bin") + "':$PATH");
  }
  // A run of one clip, two episodes, in each of these engines; an engine is a shard.
  void plan(const std::string& engine_names = "playback", const std::string& fault = "none") const {
    write_file(folder_ / "suite.yaml",
               "schema: duet.suite/1\nname: cluster\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
               "engines: [" +
                   engine_names + "]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\n" +
                   "profile: {name: mine, engines: {faulty: {fault: " + fault + "}}}\n");
    std::string costs;
    for (const char* engine : {"playback", "faulty"})
      if (!pilot_ && engine_names.find(engine) != std::string::npos)
        costs += std::string(" --cost ") + engine + "/pd=0.01";
    const Answer planned = duet("plan -q " + (folder_ / "suite.yaml") + costs + " -o " + run_);
    ASSERT_EQ(planned.code, 0) << planned.err;
  }
  [[nodiscard]] nlohmann::json status() const { return nlohmann::json::parse(duet("status --json " + run_).out); }
  // A command of that name before all others.
  void stand_in(const std::string& name, const std::string& script) const {
    write_file(folder_ / ("bin/" + name), "#!/bin/sh\n" + script);
    fs::permissions(folder_ / ("bin/" + name), fs::perms::owner_all);
  }

  test::ScratchFolder folder_;
  std::string engines_ = folder_ / "engines", run_ = folder_ / "run";
  bool pilot_ = false;  // measures costs
};

TEST_F(ClusterCommand, GoesFromASuiteToTables) {
  pilot_ = true;
  plan();
  EXPECT_EQ(status().at("done"), 2);  // the pilot
  const Answer work = duet("work -q --json " + run_ + " --shard 0");
  EXPECT_EQ(work.code, 0) << work.err;
  EXPECT_EQ(nlohmann::json::parse(work.out).at("already_there"), 2);
  const Answer merge = duet("merge " + run_);
  EXPECT_EQ(merge.code, 0) << merge.err;
  EXPECT_THAT(merge.out, HasSubstr("all 2 planned episodes are there"));
  EXPECT_EQ(duet("verify -q --all " + run_).code, 0);
  EXPECT_EQ(duet("report -q --no-clips " + run_ + " -o " + (folder_ / "report")).code, 0);
  EXPECT_TRUE(status().at("complete"));
}

TEST_F(ClusterCommand, AnEpisodeThatCrashesItsWorkerTwiceIsAnErrorAndTheShardEnds) {
  plan("faulty, playback", "crash");
  int crashes = 0;
  Answer work;
  for (; crashes < 10; ++crashes)
    if (work = duet("work -q " + run_ + " --shard 0"); work.code == 3) break;
  EXPECT_EQ(crashes, 4);  // two episodes, each twice
  EXPECT_THAT(work.out, HasSubstr("2 of 2 done"));
  EXPECT_EQ(status().at("shards")[0].at("crashes"), 4);
  EXPECT_EQ(duet("merge " + run_).code, 0);
  for (const EpisodeRow& row : load_run(run_).rows) {
    EXPECT_EQ(row.outcome, Outcome::kError);
    EXPECT_EQ(row.message, "killed its worker 2 times: SIGSEGV, SIGSEGV");
  }
}

TEST_F(ClusterCommand, AnEpisodeWhoseWorkersVanishEndsInTheEnd) {
  plan("faulty", "vanish");
  int losses = 0;
  for (; losses < 20; ++losses)
    if (duet("work -q " + run_ + " --shard 0").code == 3) break;
  EXPECT_EQ(losses, 10);  // two episodes, each five times
  EXPECT_EQ(status().at("nodes").begin()->at("lost"), 10);
}

TEST_F(ClusterCommand, StoppedWorkersGoOn) {
  plan();
  const Answer stopped = duet("work -q " + run_ + " --shard 0 --time-limit 1e-9");
  EXPECT_EQ(stopped.code, 75) << stopped.err;
  EXPECT_THAT(stopped.out, HasSubstr("the same command goes on"));
  EXPECT_EQ(status().at("shards")[0].at("state"), "stopped");
  EXPECT_EQ(duet("work -q " + run_ + " --shard 0").code, 0);
}

TEST_F(ClusterCommand, AnotherEngineThanWasPlannedWithIsRefused) {
  plan("faulty");
  fs::remove(engines_ + "/duet_faulty.so");
  fs::copy_file(DUET_FAULTY_ENGINE, engines_ + "/duet_faulty.so");
  write_file(engines_ + "/duet_faulty.so", read_file(engines_ + "/duet_faulty.so") + " ");
  const Answer work = duet("work " + run_ + " --shard 0");
  EXPECT_EQ(work.code, 2);
  EXPECT_THAT(work.err, HasSubstr("was planned with the engine faulty"));
  fs::remove(engines_ + "/duet_faulty.so");
  EXPECT_THAT(duet("work " + run_ + " --shard 0").err, HasSubstr("unknown engine 'faulty'"));
}

TEST_F(ClusterCommand, AFullDiskStopsTheWorkerAndNoEpisodeFailsByIt) {
  plan();
  const Answer full = duet_program("work -q " + run_ + " --shard 0", "ulimit -f 8; DUET_ENGINES='" + engines_ + "'");
  EXPECT_EQ(full.code, 2);
  EXPECT_THAT(full.err, AllOf(HasSubstr("File too large"), HasSubstr("the same command goes on")));
  EXPECT_EQ(duet("work -q " + run_ + " --shard 0").code, 0);
  EXPECT_EQ(duet("merge -q " + run_).code, 0);
  for (const EpisodeRow& row : load_run(run_).rows) EXPECT_EQ(row.outcome, Outcome::kOk);
}

TEST_F(ClusterCommand, SubmitWritesScriptsOfWhatIsLeft) {
  plan("playback, faulty");
  ASSERT_EQ(duet("work -q " + run_ + " --shard 0").code, 0);
  const Answer written =
      duet("submit " + run_ + " --partition cpu --account lab --time 00:20:00 --mem 2G -j 2 --sbatch=--exclude=n7" +
           " --set-up 'module load gcc' --program 'apptainer exec duet.sif duet'");
  EXPECT_EQ(written.code, 0) << written.err;
  EXPECT_THAT(written.out,
              AllOf(HasSubstr("#SBATCH --partition=cpu\n"), HasSubstr("#SBATCH --account=lab\n"),
                    HasSubstr("#SBATCH --time=00:20:00\n"), HasSubstr("#SBATCH --mem=2G\n"),
                    HasSubstr("#SBATCH --cpus-per-task=2\n"), HasSubstr("#SBATCH --exclude=n7\n"),
                    HasSubstr("\nmodule load gcc\n"), HasSubstr("else duet=(apptainer exec duet.sif duet); fi"),
                    HasSubstr("#SBATCH --requeue\n"), HasSubstr("# --array=1 "), HasSubstr("not submitted")));
  const std::string script = run_ + "/slurm/array.sh";
  EXPECT_EQ(read_file(script).substr(0, 12), "#!/bin/bash\n");
  EXPECT_EQ(std::system(("bash -n " + script + " && bash -n " + run_ + "/slurm/merge.sh").c_str()), 0);
  ASSERT_EQ(duet("work -q " + run_ + " --shard 1").code, 0);
  const Answer nothing = duet("submit " + run_);
  EXPECT_EQ(nothing.code, 2);
  EXPECT_THAT(nothing.err, HasSubstr("all shards are done"));
}

TEST_F(ClusterCommand, SubmitGivesSbatchArraysAndAMergeThatWaitsForThem) {
  plan("playback, faulty");
  stand_in("sbatch", "echo \"$@\" >> '" + (folder_ / "said") + "'; echo 4711\n");
  const Answer submitted = duet("submit --slurm --largest-array 1 --at-once 7 --json " + run_);
  ASSERT_EQ(submitted.code, 0) << submitted.err;
  const auto json = nlohmann::json::parse(submitted.out);
  EXPECT_EQ(json.at("jobs"), nlohmann::json({"4711", "4711"}));
  EXPECT_EQ(json.at("merge"), "4711");
  EXPECT_THAT(read_file(folder_ / "said"), AllOf(HasSubstr("--array=0%7 --export=ALL,DUET_OFFSET=0 "),
                                                 HasSubstr("--array=0%7 --export=ALL,DUET_OFFSET=1 "),
                                                 HasSubstr("--dependency=afterany:4711:4711")));
  stand_in("sbatch", "echo 'sbatch: error: invalid partition' >&2; exit 1\n");
  const Answer refused = duet("submit --slurm " + run_);
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("sbatch refuses the job: sbatch: error: invalid partition"));
  stand_in("sbatch", "echo hello\n");
  EXPECT_THAT(duet("submit --slurm " + run_).err, HasSubstr("expected the number of a job, found 'hello'"));
}

// The script itself, with a scheduler and a program that only say what they are asked.
TEST_F(ClusterCommand, TheScriptPutsATaskBackBeforeItsTimeIsOver) {
  plan();
  stand_in("scontrol", "echo \"scontrol $@\" >> '" + (folder_ / "said") + "'\n");
  stand_in("worker",
           "trap 'exit 75' TERM; echo started >> '" + (folder_ / "said") + "'; while :; do sleep 0.05; done\n");
  ASSERT_EQ(duet("submit " + run_ + " --program worker").code, 0);
  const std::string script = "PATH='" + (folder_ / "bin") + "':$PATH SLURM_ARRAY_TASK_ID=0 SLURM_JOB_ID=12 bash " +
                             run_ + "/slurm/array.sh & job=$!; until grep -q started '" + (folder_ / "said") +
                             "' 2>/dev/null; do sleep 0.05; done; kill -USR1 $job; wait $job";
  EXPECT_EQ(WEXITSTATUS(std::system(script.c_str())), 75);
  EXPECT_THAT(read_file(folder_ / "said"), HasSubstr("scontrol requeue 12"));
}

TEST_F(ClusterCommand, TheScriptStartsAWorkerAgainThatCrashed) {
  plan("faulty", "crash");
  ASSERT_EQ(duet("submit " + run_).code, 0);
  const std::string script = "DUET_ENGINES='" + engines_ + "' SLURM_ARRAY_TASK_ID=0 SLURM_JOB_ID=12 bash " + run_ +
                             "/slurm/array.sh >/dev/null 2>&1";
  EXPECT_EQ(WEXITSTATUS(std::system(script.c_str())), 3);
  EXPECT_EQ(status().at("errors"), 2);
}

// sbatch reads its lines as a shell reads words, and a '%' in the name of a file as a pattern.
TEST_F(ClusterCommand, ARunMayHaveASpaceAndOtherSignsInItsName) {
  for (const std::string name : {"50% of $HOME's runs; `x`", "two \"words\""}) {
    const std::string odd = folder_ / name, quoted = "'" + std::regex_replace(odd, std::regex("'"), "'\\''") + "'";
    plan();
    fs::rename(run_, odd);
    const Answer submitted = duet("submit --program '/a b/duet' " + quoted);
    ASSERT_EQ(submitted.code, 0) << submitted.err;
    const bool has_double = name.find('"') != std::string::npos;
    const std::string path = std::regex_replace(odd, std::regex("%"), "%%"), mark = has_double ? "'" : "\"";
    const std::string script = odd + "/slurm/array.sh";
    EXPECT_THAT(read_file(script), HasSubstr("#SBATCH --output=" + mark + path + "/slurm/%A_%a.out" + mark + "\n"));
    stand_in("worker", "printf '%s|' \"$@\" > '" + (folder_ / "said") + "'\n");
    const std::string run_script = "DUET=worker PATH='" + (folder_ / "bin") + "':$PATH SLURM_ARRAY_TASK_ID=0 bash '" +
                                   std::regex_replace(script, std::regex("'"), "'\\''") + "'";
    EXPECT_EQ(WEXITSTATUS(std::system(run_script.c_str())), 0);
    EXPECT_EQ(read_file(folder_ / "said"), "work|" + odd + "|--shard|0|-j|1|--quiet|");
  }
  plan();
  const std::string none = folder_ / "back\\slash";
  fs::rename(run_, none);
  const Answer refused = duet("submit '" + none + "'");
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err, HasSubstr("output: expected a text without a backslash"));
}

TEST_F(ClusterCommand, HintsAreCommandsThatAShellTakes) {
  write_file(folder_ / "suite.yaml",
             "schema: duet.suite/1\nname: c\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\ntasks: [wave]\n"
             "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\nstart: clip\n");
  const Answer planned =
      duet("plan -q " + (folder_ / "suite.yaml") + " --cost playback/pd=0.01 -o '" + (folder_ / "a run") + "'");
  ASSERT_EQ(planned.code, 0) << planned.err;
  EXPECT_THAT(planned.out, AllOf(HasSubstr("`duet work '" + (folder_ / "a run") + "' --shard 0`"),
                                 HasSubstr("`duet submit '" + (folder_ / "a run") + "' --slurm`")));
}

TEST_F(ClusterCommand, BadInputIsOneSentence) {
  plan();
  const auto refusal = [&](const std::string& arguments) {
    const Answer answer = duet(arguments);
    EXPECT_EQ(answer.code, 2) << arguments;
    EXPECT_EQ(std::ranges::count(answer.err, '\n'), 1) << answer.err;
    return answer.err;
  };
  const std::string suite = folder_ / "suite.yaml", fresh = folder_ / "fresh";
  EXPECT_THAT(refusal("work " + run_ + " --shard 9"), HasSubstr("expected a shard of 0 to 0, found 9"));
  EXPECT_THAT(refusal("work " + run_), HasSubstr("expected --shard: "));
  EXPECT_THAT(refusal("work " + (folder_ / "none") + " --shard 0"), HasSubstr("(no plan.json)"));
  EXPECT_THAT(refusal("status " + (folder_ / "none")), HasSubstr("(no plan.json)"));
  EXPECT_THAT(refusal("submit " + (folder_ / "none")), HasSubstr("(no plan.json)"));
  EXPECT_THAT(refusal("submit " + run_ + " --partition \"$(printf 'a\\nb')\""),
              HasSubstr("partition: expected one line"));
  EXPECT_THAT(refusal("plan " + suite + " -o " + run_), HasSubstr("is planned already"));
  EXPECT_THAT(refusal("plan " + suite + " --shards some -o " + fresh), HasSubstr("--shards: expected 'auto' or"));
  EXPECT_THAT(refusal("plan -q " + suite + " --cost playback/pd=0.01 --shards 2 -o " + fresh),
              HasSubstr("expected 1 to 1 shards"));
  EXPECT_THAT(refusal("plan " + suite + " --cost playback/pd=x -o " + fresh), HasSubstr("--cost: expected ENGINE"));
  EXPECT_THAT(refusal("plan -q " + suite + " --cost ode/pd=1 -o " + fresh), HasSubstr("the suite runs no 'ode/pd'"));
  EXPECT_THAT(refusal("plan --trainings " + suite + " -o " + fresh), HasSubstr("trainings: unknown key 'name'"));
}

class TrainingJobs : public ClusterCommand {
 protected:
  void list(const std::string& text) const { write_file(folder_ / "arms.yaml", text); }
  [[nodiscard]] Answer plan_list() const {
    return duet("plan -q --trainings " + (folder_ / "arms.yaml") + " -o " + run_);
  }
  static constexpr const char* kList =
      "schema: duet.trainings/1\ntrain: wbc\narguments: [--stage, stand, --steps, '64', --environments, '4', "
      "--threads, '1', --quiet]\narms: {plain: [], other: [--card, g1]}\nseeds: [1, 2]\nminutes: 0.5\n";
};

TEST_F(TrainingJobs, AreShardsOfAPlan) {
  list(kList);
  const Answer planned = plan_list();
  ASSERT_EQ(planned.code, 0) << planned.err;
  EXPECT_THAT(planned.out, AllOf(HasSubstr("4 trainings in 4 shards"), HasSubstr("--shard 0 --allow-programs`")));
  const Answer work = duet("work -q --allow-programs " + run_ + " --shard 2");
  EXPECT_EQ(work.code, 0) << work.err << work.out;
  EXPECT_TRUE(fs::exists(run_ + "/trainings/plain-1"));
  EXPECT_EQ(status().at("done"), 1);
  EXPECT_EQ(status().at("unfinished"), "0-1,3");
  const Answer again = duet("work -q --json --allow-programs " + run_ + " --shard 2");
  EXPECT_EQ(nlohmann::json::parse(again.out).at("already_there"), 1);
  EXPECT_THAT(duet("merge " + run_).err, HasSubstr("is not a run directory"));
  EXPECT_THAT(plan_list().err, HasSubstr("is not empty"));
}

TEST_F(TrainingJobs, OneThatFailsIsSaidToHaveFailed) {
  std::string text = kList;
  list(text.replace(text.find("g1]"), 2, "nobody"));
  ASSERT_EQ(plan_list().code, 0);
  EXPECT_NE(duet("work -q --allow-programs " + run_ + " --shard 0").code, 0);
  EXPECT_EQ(status().at("shards")[0].at("state"), "failed");
}

TEST_F(TrainingJobs, AListThatIsNoneIsRefused) {
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::string text = kList;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    list(text.replace(at, from.size(), to));
    const Answer answer = plan_list();
    EXPECT_EQ(answer.code, 2);
    return answer.err;
  };
  EXPECT_THAT(refusal("train: wbc", "train: wcb"), HasSubstr("arms.yaml:2: trainings: unknown training 'wcb'"));
  EXPECT_THAT(refusal("seeds: [1, 2]", "seeds: [1, -2]"), HasSubstr("expected whole numbers of at least 0"));
  EXPECT_THAT(refusal("seeds: [1, 2]", "seeds: []"), HasSubstr("'seeds': expected one at least"));
  EXPECT_THAT(refusal("arms: {plain: [], other: [--card, g1]}", "arms: {}"), HasSubstr("'arms': expected a mapping"));
  EXPECT_THAT(refusal("plain: []", "../plain: []"), HasSubstr("'arms': expected names of letters"));
  EXPECT_THAT(refusal("plain: []", "plain: 7"), HasSubstr("arm 'plain': expected a list"));
  EXPECT_THAT(refusal("plain: []", "plain: [[7]]"), HasSubstr("arm 'plain': expected texts"));
  EXPECT_THAT(refusal("minutes: 0.5", "minutes: -1"), HasSubstr("'minutes': expected a number above 0"));
  EXPECT_THAT(refusal("minutes:", "minute:"), HasSubstr("minute"));
  EXPECT_THAT(refusal("'64'", "'6x'"), HasSubstr("option 'steps': expected a whole number"));
  EXPECT_THAT(refusal("--environments", "--seed"), HasSubstr("unknown option of a training 'seed'"));
  EXPECT_THAT(refusal("--quiet", "--allow-programs"), HasSubstr("unknown option of a training 'allow_programs'"));
  EXPECT_THAT(refusal("[--stage, stand,", "[run, --stage, stand,"), HasSubstr("expected an option of `duet train`"));
  EXPECT_THAT(refusal("plain: []", "plain: [--steps, '3']"), HasSubstr("the option 'steps' once, found it twice"));
}

TEST_F(TrainingJobs, NeedLeaveAsProgramsOfPoliciesDo) {
  list(kList);
  ASSERT_EQ(plan_list().code, 0);
  const std::string command =
      "runs 'duet train wbc --card g1 --environments 4 --quiet --stage stand --steps 64 "
      "--threads 1 --seed 1 -o trainings/other-1' in '";
  const Answer work = duet("work -q " + run_ + " --shard 0");
  EXPECT_EQ(work.code, 2);
  EXPECT_THAT(work.err, AllOf(HasSubstr("expected --allow-programs, or a folder in DUET_TRUSTED_FOLDERS, for: training "
                                        "'other-1' of "),
                              HasSubstr(command)));
  EXPECT_FALSE(fs::exists(run_ + "/trainings"));
  const Answer submit = duet("submit " + run_);
  EXPECT_EQ(submit.code, 2);
  EXPECT_THAT(submit.err, AllOf(HasSubstr("expected --allow-programs"), HasSubstr("training 'plain-2'")));
  EXPECT_FALSE(fs::exists(run_ + "/slurm"));
  EXPECT_EQ(duet("submit --allow-programs " + run_).code, 0);
  EXPECT_THAT(read_file(run_ + "/slurm/array.sh"), HasSubstr("\nallow=--allow-programs\n"));
  EXPECT_EQ(duet_program("submit " + run_, "DUET_TRUSTED_FOLDERS='" + (folder_ / "") + "'").code, 0);
  EXPECT_THAT(read_file(run_ + "/slurm/array.sh"), HasSubstr("\nallow=\n"));
}

// As a stranger would write it: a plan that this very program has made, with other words in it.
TEST_F(TrainingJobs, APlanSaysNothingButArmSeedAndKnownOptions) {
  list(kList);
  ASSERT_EQ(plan_list().code, 0);
  const std::string file = run_ + "/plan.json";
  const nlohmann::json honest = nlohmann::json::parse(read_file(file));
  const auto refusal = [&](const char* key, const nlohmann::json& value) {
    nlohmann::json plan = honest;
    plan.at("shards")[0][key] = value;
    write_file(file, plan.dump());
    std::string said;
    for (const std::string command : {"work -q --allow-programs --shard 0 ", "submit --allow-programs ", "status "}) {
      const Answer answer = duet(command + run_);
      EXPECT_EQ(answer.code, 2) << command << key << value;
      EXPECT_EQ(std::ranges::count(answer.err, '\n'), 1) << answer.err;
      said = answer.err;
    }
    EXPECT_FALSE(fs::exists(run_ + "/trainings"));
    return said;
  };
  EXPECT_THAT(refusal("arguments", {"run", "s.yaml", "--allow-programs", "-o", "out"}),
              HasSubstr("unknown key 'arguments'"));
  EXPECT_THAT(refusal("train", "run"), HasSubstr("unknown training 'run'"));
  EXPECT_THAT(refusal("train", "pack"), HasSubstr("unknown training 'pack'"));
  EXPECT_THAT(refusal("arm", "../../x"), HasSubstr("expected an arm of letters"));
  EXPECT_THAT(refusal("seed", "1; touch x"), HasSubstr("key 'seed'"));
  EXPECT_THAT(refusal("name", "../x"), HasSubstr("expected the name 'other-1' of its arm and seed"));
  EXPECT_THAT(refusal("options", {{"output", "/tmp/x"}}), HasSubstr("unknown option of a training 'output'"));
  EXPECT_THAT(refusal("options", {{"allow_programs", ""}}), HasSubstr("unknown option of a training"));
  EXPECT_THAT(refusal("options", {{"steps", "1 --card x"}}), HasSubstr("expected a whole number"));
  EXPECT_THAT(refusal("options", {{"quiet", "x"}}), HasSubstr("expected no value of a flag"));
}

TEST_F(TrainingJobs, AFolderThatIsALinkIsRefused) {
  list(kList);
  ASSERT_EQ(plan_list().code, 0);
  fs::create_directory(folder_ / "away");
  fs::create_symlink(folder_ / "away", run_ + "/trainings");
  EXPECT_THAT(duet("work -q --allow-programs --shard 0 " + run_).err, HasSubstr("trainings' is a symbolic link"));
  EXPECT_TRUE(fs::is_empty(folder_ / "away"));
}

}  // namespace
}  // namespace duet
