// Several processes in one run folder, rows that stand twice, errors that are run again, and how many episodes a run is
// to have.
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/folder/run_directory.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::append_text;
using test::episode;
using test::ScratchFolder;
using test::thrown_message;
using test::tiny_run;

// Runs `work` in a process of its own; its exit code, or 128 + the signal that ended it.
template <typename Work>
int in_process(Work&& work) {
  const pid_t child = fork();
  if (child == 0) {
    try {
      work();
    } catch (const std::exception& error) {
      fprintf(stderr, "%s\n", error.what());
      _exit(2);
    }
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
}

// Works through the episodes in order as a run does.
void work_through(const std::string& folder, int episodes) {
  RunDirectory run = RunDirectory::open(folder, tiny_run());
  for (int i = 0; i < episodes; ++i) {
    const EpisodeRow row = episode("replay", "hug", i, true);
    if (run.claim(row.key) != Claim::kMine) continue;
    usleep(300);
    run.append(row);
  }
}

TEST(RunDirectory, ProcessesOnOneFolderShareTheEpisodesAndWriteEachOnce) {
  const ScratchFolder scratch;
  constexpr int kProcesses = 4, kEpisodes = 120;
  std::vector<pid_t> children;
  for (int i = 0; i < kProcesses; ++i) {
    children.push_back(fork());
    if (children.back() == 0) _exit(in_process([&] { work_through(scratch / "run", kEpisodes); }));
  }
  for (const pid_t child : children) {
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(WEXITSTATUS(status), 0);
  }
  const duet::Run run = load_run(scratch / "run");
  EXPECT_EQ(run.rows.size(), static_cast<std::size_t>(kEpisodes));
  EXPECT_TRUE(run.warnings.empty());
  const std::string text = read_file(scratch / "run/episodes.jsonl");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), kEpisodes);
}

TEST(RunDirectory, AnEpisodeThatAnotherProcessIsAtIsTakenUntilThatProcessEnds) {
  const ScratchFolder scratch;
  const std::string key = episode("replay", "hug", 0, true).key;
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  RunDirectory other = RunDirectory::open(scratch / "run", tiny_run());
  ASSERT_EQ(other.claim(key), Claim::kMine);
  EXPECT_EQ(run.claim(key), Claim::kTaken);
  other.release(key);
  EXPECT_EQ(run.claim(key), Claim::kMine);
  run.release(key);
  const int code = in_process([&] {
    RunDirectory killed = RunDirectory::open(scratch / "run", tiny_run());
    killed.claim(key);
    raise(SIGKILL);
  });
  EXPECT_EQ(code, 128 + SIGKILL);
  EXPECT_EQ(run.claim(key), Claim::kMine);
}

TEST(RunDirectory, AnEpisodeThatAnotherProcessHasFinishedIsDoneAndASecondRowIsLeftOut) {
  const ScratchFolder scratch;
  const EpisodeRow row = episode("replay", "hug", 0, true);
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  RunDirectory other = RunDirectory::open(scratch / "run", tiny_run());
  EXPECT_TRUE(other.append(row));
  EXPECT_FALSE(run.has(row.key));  // has not looked since
  EXPECT_EQ(run.claim(row.key), Claim::kDone);
  EXPECT_TRUE(run.has(row.key));
  RunDirectory third = RunDirectory::open(scratch / "run", tiny_run());
  EpisodeRow late = episode("replay", "hug", 1, true);
  EXPECT_TRUE(run.append(late));
  EXPECT_FALSE(third.append(late));
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 2U);
}

TEST(RunDirectory, APartOfALineThatAKilledProcessLeftIsCutBeforeTheNextRow) {
  const ScratchFolder scratch;
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  run.append(episode("replay", "hug", 0, true));
  append_text(scratch / "run/episodes.jsonl", to_json(episode("replay", "hug", 1, true)).dump().substr(0, 100));
  EXPECT_EQ(run.claim(episode("replay", "hug", 1, true).key),
            Claim::kMine);  // asking cuts nothing: who knows who writes
  EXPECT_EQ(load_run(scratch / "run").dropped_lines, 1);
  run.append(episode("replay", "hug", 1, true));
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 2U);
  EXPECT_EQ(load_run(scratch / "run").dropped_lines, 0);
}

TEST(RunDirectory, RowsThatWereRemovedUnderARunStopIt) {
  const ScratchFolder scratch;
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  run.append(episode("replay", "hug", 0, true));
  std::filesystem::remove(scratch / "run/episodes.jsonl");
  EXPECT_SENTENCE(thrown_message<StorageError>([&] { run.append(episode("replay", "hug", 1, true)); }));
}

TEST(RunDirectory, AFolderThatTwoRunsDestroyedBeforeCanBeReadAndResumedAgain) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
  EpisodeRow again = episode("replay", "hug", 0, true);
  again.started_at = "2026-01-02T03:04:09Z";
  again.wall_s = 9.0;
  append_text(scratch / "run/episodes.jsonl", to_json(again).dump() + "\n");
  const duet::Run run = load_run(scratch / "run");
  EXPECT_EQ(run.rows.size(), 1U);
  ASSERT_EQ(run.warnings.size(), 1U);
  EXPECT_SENTENCE(run.warnings[0]);
  RunDirectory resumed = RunDirectory::open(scratch / "run", tiny_run());
  EXPECT_EQ(resumed.size(), 1U);
  EXPECT_TRUE(resumed.append(episode("replay", "hug", 1, true)));
}

TEST(RunDirectory, RowsOfOneEpisodeThatDifferAreNamedWithTheirFieldsAndAWayOut) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
  EpisodeRow other = episode("replay", "hug", 0, false);
  other.metrics["jpe"] = 0.5;
  append_text(scratch / "run/episodes.jsonl", to_json(other).dump() + "\n");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "run"); }));
}

EpisodeRow failed(int number, const std::string& message) {
  EpisodeRow row = episode("replay", "hug", number, false);
  row.outcome = Outcome::kError;
  row.message = message;
  return row;
}

TEST(RunDirectory, AnErrorGivesWayToAnyOtherRowOfItsEpisodeAndToALaterError) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run());
  const auto rows_of = [&](const std::vector<EpisodeRow>& rows) {
    std::string text;
    for (const EpisodeRow& row : rows) text += to_json(row).dump() + "\n";
    write_file(scratch / "run/episodes.jsonl", text);
    return load_run(scratch / "run").rows;
  };
  const EpisodeRow good = episode("replay", "hug", 0, true);
  EXPECT_EQ(rows_of({failed(0, "first"), good}).at(0).outcome, Outcome::kOk);
  EXPECT_EQ(rows_of({good, failed(0, "late")}).at(0).outcome, Outcome::kOk);
  EXPECT_EQ(rows_of({failed(0, "first"), failed(0, "second")}).at(0).message, "second");
  EXPECT_EQ(rows_of({failed(0, "first"), failed(0, "second"), good, good}).size(), 1U);
}

TEST(RunDirectory, ErrorsAreFinalUnlessTheyAreAskedForAgain) {
  const ScratchFolder scratch;
  RunDirectory first = RunDirectory::open(scratch / "run", tiny_run());
  first.append(failed(0, "the disk was full"));
  first.append(failed(1, "the disk was full"));
  first.append(episode("replay", "hug", 2, true));
  const std::string key = failed(0, "").key;
  EXPECT_TRUE(RunDirectory::open(scratch / "run", tiny_run()).has(key));
  RunDirectory retry = RunDirectory::open(scratch / "run", tiny_run(), true);
  RunDirectory beside = RunDirectory::open(scratch / "run", tiny_run(), true);
  EXPECT_FALSE(retry.has(key));
  EXPECT_TRUE(retry.has(episode("replay", "hug", 2, true).key));
  EXPECT_TRUE(retry.append(episode("replay", "hug", 0, true)));
  EXPECT_TRUE(retry.append(failed(1, "again")));
  EXPECT_TRUE(retry.has(failed(1, "").key));  // once a process, or it would not end
  EXPECT_EQ(beside.claim(failed(1, "").key), Claim::kDone);
  const std::vector<EpisodeRow> rows = load_run(scratch / "run").rows;
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[0].outcome, Outcome::kOk);
  EXPECT_EQ(rows[1].message, "again");
}

TEST(RunDirectory, NothingIsWrittenThroughALinkInTheFolder) {
  const ScratchFolder scratch;
  write_file(scratch / "outside", "mine");
  std::filesystem::create_directory(scratch / "away");
  for (const char* name : {"episodes.jsonl", "resumed.jsonl", "run.json", "env.json", "suite.yaml", "lock"}) {
    std::filesystem::remove_all(scratch / "run");
    RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
    std::filesystem::remove(scratch / (std::string("run/") + name));
    std::filesystem::create_symlink(scratch / "outside", scratch / (std::string("run/") + name));
    EXPECT_NE(thrown_message<InputError>([&] { RunDirectory::open(scratch / "run", tiny_run()); }),
              "(nothing was thrown)")
        << name;
    EXPECT_EQ(read_file(scratch / "outside"), "mine") << name;
  }
  std::filesystem::remove_all(scratch / "run");
  RunDirectory::open(scratch / "run", tiny_run());
  std::filesystem::create_symlink(scratch / "away", scratch / "run/trajectories");
  EXPECT_SENTENCE(thrown_message<StorageError>([&] { RunDirectory::open(scratch / "run", tiny_run()); }));
  // The folder that the user names may be one.
  std::filesystem::create_symlink(scratch / "other", scratch / "link");
  std::filesystem::create_directory(scratch / "other");
  EXPECT_EQ(RunDirectory::open(scratch / "link", tiny_run()).size(), 0U);
}

TEST(RunDirectory, HalfWrittenFilesOfDeadProcessesAreRemovedOnResume) {
  const ScratchFolder scratch;
  const pid_t dead = fork();
  if (dead == 0) _exit(0);
  waitpid(dead, nullptr, 0);
  RunDirectory::open(scratch / "run", tiny_run());
  const std::string mark = ".part-" + std::to_string(dead);
  write_file(scratch / ("run/run.json" + mark + "-0"), "x");
  write_file(scratch / ("run/trajectories/a.npz" + mark + "-0"), "x");
  write_file(scratch / ("run/results.sqlite" + mark + "-journal"), "x");
  write_file(scratch / "run/trajectories/b.npz.part-1-0", "x");  // lives
  write_file(scratch / "run/trajectories/c.npz", "x");
  write_file(scratch / "run/my.part-time", "x");
  {
    const RunDirectory present = RunDirectory::open(scratch / "run", tiny_run());
    write_file(scratch / ("run/late" + mark + "-0"), "x");
    RunDirectory::open(scratch / "run", tiny_run());  // not alone: the process may be of another machine
    EXPECT_TRUE(std::filesystem::exists(scratch / ("run/late" + mark + "-0")));
  }
  RunDirectory::open(scratch / "run", tiny_run());
  for (const std::string& name : {"run/run.json" + mark + "-0", "run/trajectories/a.npz" + mark + "-0",
                                  "run/results.sqlite" + mark + "-journal", "run/late" + mark + "-0"})
    EXPECT_FALSE(std::filesystem::exists(scratch / name)) << name;
  for (const char* name : {"run/trajectories/b.npz.part-1-0", "run/trajectories/c.npz", "run/my.part-time"})
    EXPECT_TRUE(std::filesystem::exists(scratch / name)) << name;
}

TEST(RunPlan, ARunSaysHowManyEpisodesAreMissing) {
  const ScratchFolder scratch;
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  run.append(episode("replay", "hug", 0, true));
  EXPECT_EQ(completeness(load_run(scratch / "run")), "");  // says nothing yet
  EXPECT_FALSE(is_partial(load_run(scratch / "run")));
  const auto count = [](const std::vector<EpisodeFilter>& parts) {
    return parts.front().is_whole() ? 4 : 1 * parts.size();
  };
  EpisodeFilter part;
  part.engines = {"mujoco"};
  run.ask_for(part, 4, count);
  EXPECT_EQ(completeness(load_run(scratch / "run")), "1 of 4 episodes: the part that was asked for");
  EXPECT_FALSE(is_partial(load_run(scratch / "run")));
  EXPECT_TRUE(run.is_finished());
  RunDirectory::open(scratch / "run", tiny_run()).ask_for(part, 4, count);  // the same part again
  EXPECT_EQ(load_run(scratch / "run").info.plan->asked, 1);
  part.engines = {"ode", "bullet"};
  run.ask_for(part, 4, count);
  EXPECT_EQ(completeness(load_run(scratch / "run")), "1 of 4 episodes, 2 were asked for: partial");
  EXPECT_TRUE(is_partial(load_run(scratch / "run")));
  EXPECT_FALSE(run.is_finished());
  run.ask_for({}, 4, count);
  EXPECT_EQ(load_run(scratch / "run").info.plan->parts.size(), 1U);
  EXPECT_EQ(completeness(load_run(scratch / "run")), "1 of 4 episodes: partial");
  for (int i = 1; i < 4; ++i) run.append(episode("replay", "hug", i, true));
  EXPECT_EQ(completeness(load_run(scratch / "run")), "");
  EXPECT_TRUE(run.is_finished());
}

TEST(RunPlan, PartsAreToldApartWhateverTheirOrder) {
  EpisodeFilter part, same;
  part.engines = {"ode", "bullet", "ode"};
  same.engines = {"bullet", "ode"};
  EXPECT_EQ(with_part(with_part({}, part), same).size(), 1U);
  same.tasks = {"hug"};
  EXPECT_EQ(with_part(with_part({}, part), same).size(), 2U);
  EXPECT_EQ(with_part(with_part({}, part), {}).size(), 1U);
}

TEST(RunPlan, ABrokenPlanIsRefusedByKey) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run());
  const nlohmann::json good = nlohmann::json::parse(read_file(scratch / "run/run.json"));
  for (const nlohmann::json& plan :
       std::vector<nlohmann::json>{3,
                                   {{"episodes", 1}, {"asked", 1}},
                                   {{"episodes", 1}, {"asked", 1}, {"parts", 1}},
                                   {{"episodes", 1}, {"asked", 1}, {"parts", {{{"engine", {"a"}}}}}}}) {
    nlohmann::json json = good;
    json["plan"] = plan;
    write_file(scratch / "run/run.json", json.dump());
    EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "run"); }));
  }
}

TEST(FolderLock, ExcludesOthersAndSharesWithThoseThatShare) {
  const ScratchFolder scratch;
  FolderLock a(scratch / "lock"), b(scratch / "lock");
  EXPECT_TRUE(a.try_lock(20));
  EXPECT_FALSE(b.try_lock(20));
  EXPECT_TRUE(b.try_lock(21));
  a.unlock(20);
  EXPECT_TRUE(b.try_lock(20));
  EXPECT_TRUE(a.try_lock(30, FolderLock::Kind::kShared));
  EXPECT_TRUE(b.try_lock(30, FolderLock::Kind::kShared));
  EXPECT_FALSE(b.try_lock(30));
  EXPECT_EQ(a.refusal(), "");
  EXPECT_NE(lock_place("a"), lock_place("b"));
  EXPECT_GE(lock_place(""), 16U);
}

}  // namespace
}  // namespace duet
