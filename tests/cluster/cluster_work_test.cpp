// A planned run in workers' pieces is the run of one process: in this process, without physics.
#include <gmock/gmock.h>
#include <signal.h>

#include <ctime>
#include <filesystem>
#include <mutex>
#include <thread>

#include "duet/cluster/attempt.h"
#include "duet/cluster/merge.h"
#include "duet/cluster/plan_run.h"
#include "duet/cluster/run_status.h"
#include "duet/cluster/work_shard.h"
#include "duet/execution/run_inputs.h"
#include "duet/execution/runner.h"
#include "duet/execution/verification.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"
#include "tests/execution/verified_run.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class ClusterWork : public testing::Test {
 protected:
  void plan(const Suite& suite = test::playback_suite(), std::int64_t shards = 2) {
    PlanOptions options;
    options.shards = shards;
    options.threads = 2;
    options.costs = {{"playback/pd", 0.01}};
    summary_ = plan_run(suite, run_, options, stop_, quiet_);
  }
  WorkSummary work(std::int64_t shard, WorkOptions options = {}) {
    return work_shard(run_, shard, options, stop_, quiet_);
  }
  MergeSummary merge() { return merge_runs({run_}, {}); }
  std::string refusal(std::int64_t shard = 0) {
    return test::thrown_message<InputError>([&] { work(shard); });
  }
  // The files of a shard's attempts that end so.
  [[nodiscard]] std::vector<std::string> files(std::int64_t shard, const std::string& ending) const {
    std::vector<std::string> found;
    for (const AttemptRecord& attempt : read_attempts(run_, shard))
      found.push_back(ending == ".log" ? attempt.journal : attempt.rows_file);
    return found;
  }
  // Rows of a run that one process made.
  [[nodiscard]] std::map<std::string, EpisodeRow> reference() const {
    test::make_run(test::playback_suite(), folder_ / "reference");
    std::map<std::string, EpisodeRow> rows;
    for (const EpisodeRow& row : load_run(folder_ / "reference").rows) rows[row.key] = row;
    return rows;
  }
  void expect_reference() {
    const auto wanted = reference();
    const duet::Run found = load_run(run_);
    EXPECT_EQ(found.rows.size(), wanted.size());
    for (const EpisodeRow& row : found.rows) EXPECT_THAT(differing_fields(row, wanted.at(row.key)), testing::IsEmpty());
  }

  test::ScratchFolder folder_;
  std::string run_ = folder_ / "run";
  StopToken stop_;
  Progress quiet_{Progress::Style::kQuiet};
  PlanSummary summary_;
};

TEST_F(ClusterWork, APartOfASuiteIsPlannedAsARunOfThatPartIsRun) {
  PlanOptions options;
  options.shards = 1;
  options.costs = {{"playback/pd", 0.01}};
  options.part.tasks = {"handshake"};
  const Suite suite = test::playback_suite();
  summary_ = plan_run(suite, run_, options, stop_, quiet_);
  EXPECT_EQ(summary_.plan.episodes, 2);
  EXPECT_EQ(work(0).run, 2);
  merge();
  RunOptions alone;
  alone.tasks = {"handshake"};
  run_suite(suite, folder_ / "alone", alone, quiet_);
  const duet::Run wanted = load_run(folder_ / "alone"), found = load_run(run_);
  ASSERT_EQ(found.rows.size(), wanted.rows.size());
  for (std::size_t i = 0; i < found.rows.size(); ++i) {
    EXPECT_EQ(found.rows[i].key, wanted.rows[i].key);
    EXPECT_EQ(found.rows[i].state_hash, wanted.rows[i].state_hash);
  }
  ASSERT_TRUE(found.info.plan);
  EXPECT_EQ(found.info.plan->parts, wanted.info.plan->parts);
  options.part.tasks = {"tango"};
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { plan_run(suite, folder_ / "b", options, stop_, quiet_); }));
}

TEST_F(ClusterWork, ShardsTogetherAreTheRunOfOneProcess) {
  plan();
  ASSERT_EQ(summary_.plan.shards.size(), 2U);
  EXPECT_EQ(run_status(run_).numbers({ShardState::kWaiting}), "0-1");
  EXPECT_EQ(work(1).run, 2);
  const MergeSummary part = merge();
  EXPECT_EQ(part.rows.rows, 2);
  ASSERT_EQ(part.gaps.size(), 1U);
  EXPECT_EQ(part.gaps[0].shard, 0);
  EXPECT_EQ(part.gaps[0].rows, 0);
  EXPECT_EQ(part.gaps[0].episodes, 2);
  EXPECT_TRUE(is_partial(load_run(run_)));
  EXPECT_EQ(work(0).run, 2);
  EXPECT_TRUE(merge().gaps.empty());
  expect_reference();
  EXPECT_EQ(test::objection(run_), "");
  EXPECT_TRUE(run_status(run_).is_complete());
}

TEST_F(ClusterWork, WorkIsDoneOnceAndTwiceAtOnceIsTheSame) {
  plan();
  work(0);
  const WorkSummary again = work(0);
  EXPECT_EQ(again.already_there, 2);
  EXPECT_EQ(again.run, 0);
  EXPECT_EQ(files(0, ".log").size(), 1U);  // a worker without work leaves nothing
  std::thread other([&] { work(1); });
  work(1);
  other.join();
  EXPECT_EQ(merge().rows.rows, 4);
  expect_reference();
}

TEST_F(ClusterWork, ATimeOutOfOneWorkerGivesWayToTheRowOfAnother) {
  plan();
  work(0);
  work(1);
  const std::string mine = files(0, ".jsonl").front();
  const std::string rows = read_file(mine);
  const std::string other = fs::path(mine).replace_filename("n2-1-00000000.jsonl").string();
  std::string late = rows;
  late.replace(late.find("\"outcome\":\"ok\""), 14, "\"outcome\":\"timeout\"");
  write_file(other, late);
  EXPECT_EQ(merge().rows.superseded, 1);
  expect_reference();
  fs::remove(other);
  write_file(mine, late);
  EXPECT_EQ(run_status(run_).timeouts, 0);  // its journal says that all went well
  EXPECT_EQ(work(0).run, 1);
  merge();
  expect_reference();
}

// Many at once: each does what nobody has done when it begins with it.
TEST_F(ClusterWork, AWorkerLeavesOutWhatAnotherOneDoesMeanwhile) {
  plan(test::playback_suite(), 1);
  std::int64_t made = 0;
  {
    std::vector<std::thread> workers;
    std::mutex mutex;
    for (int i = 0; i < 8; ++i)
      workers.emplace_back([&] {
        const WorkSummary summary = work(0);
        const std::lock_guard lock(mutex);
        EXPECT_EQ(summary.already_there + summary.run, 4);
        made += summary.run;
      });
    for (std::thread& worker : workers) worker.join();
  }
  EXPECT_LT(made, 8 * 4);
  EXPECT_EQ(merge().rows.rows, 4);
  expect_reference();
}

TEST_F(ClusterWork, ATornRowRunsAgain) {
  plan();
  work(0);
  const std::string file = files(0, ".jsonl").front();
  fs::resize_file(file, fs::file_size(file) - 100);
  EXPECT_EQ(work(0).run, 1);
  work(1);
  const MergeSummary merged = merge();
  EXPECT_EQ(merged.rows.torn, 1);
  expect_reference();
}

TEST_F(ClusterWork, MergedTwiceIsTheSameFile) {
  plan();
  work(0);
  work(1);
  merge();
  const std::string once = read_file(run_ + "/episodes.jsonl");
  EXPECT_EQ(merge().rows.folded, 4);
  EXPECT_EQ(read_file(run_ + "/episodes.jsonl"), once);
  const MergeSummary other = merge_runs({run_}, {.output = folder_ / "other"});
  EXPECT_TRUE(other.written);
  EXPECT_EQ(read_file(folder_ / "other/episodes.jsonl"), once);
  EXPECT_EQ(test::objection(folder_ / "other"), "");
}

// Rows of one suite before and after it got another arm: the plan is that of the suite with both.
TEST_F(ClusterWork, ArmsThatRanApartAreMergedToTheWholeSuite) {
  Suite before = test::playback_suite(), after = before;
  after.policies.push_back({"patient"});
  test::make_run(before, folder_ / "before");
  RunOptions arm;
  arm.policies = {"patient"};
  run_suite(after, folder_ / "arm", arm, quiet_);
  test::make_run(after, folder_ / "whole");
  merge_runs({folder_ / "before", folder_ / "arm"}, {.output = folder_ / "merged"});
  const duet::Run merged = load_run(folder_ / "merged"), whole = load_run(folder_ / "whole");
  EXPECT_EQ(merged.rows.size(), whole.rows.size());
  EXPECT_EQ(merged.info.plan, whole.info.plan);
  merge_runs({folder_ / "arm"}, {.output = folder_ / "alone"});
  EXPECT_EQ(load_run(folder_ / "alone").info.plan, load_run(folder_ / "arm").info.plan);
}

TEST_F(ClusterWork, ARowThatDiffersIsToldWithBothNodesAndOneCanBeLeftOut) {
  plan();
  setenv("SLURMD_NODENAME", "n1", 1);
  work(0);
  const std::string mine = files(0, ".jsonl").front();
  const std::string other = fs::path(mine).replace_filename("n2-1-00000000").string();
  std::string rows = read_file(mine), journal = read_file(files(0, ".log").front());
  unsetenv("SLURMD_NODENAME");
  rows.replace(rows.find("\"fell\":false"), 12, "\"fell\":true");
  journal.replace(journal.find("\"node\":\"n1\""), 11, "\"node\":\"n2\"");
  write_file(other + ".jsonl", rows);
  write_file(other + ".log", journal);
  const MergeSummary found = merge();
  EXPECT_FALSE(found.written);
  EXPECT_EQ(found.rows.violations, 1);
  EXPECT_THAT(found.rows.conflicts.front(),
              HasSubstr(mine + " on n1' and '" + other + ".jsonl on n2': fell: false, true"));
  EXPECT_EQ(found.rows.agreement.at({"n1", "n2"}).compared, 2);
  const MergeSummary without = merge_runs({run_}, {.without_nodes = {"n2"}});
  EXPECT_TRUE(without.written);
  EXPECT_EQ(without.rows.rows, 2);
  EXPECT_THAT(read_file(run_ + "/hosts.json"), HasSubstr("\"node\": \"n1\""));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { merge_runs({run_}, {.without_nodes = {"n9"}}); }));
}

TEST_F(ClusterWork, AFolderThatIsMovedIsWorkedOnWhereItIs) {
  plan();
  work(0);
  fs::rename(run_, folder_ / "elsewhere");
  run_ = folder_ / "elsewhere";
  EXPECT_EQ(work(1).run, 2);
  merge();
  expect_reference();
}

TEST_F(ClusterWork, AnotherProgramIsRefused) {
  plan();
  test::replace_in(run_ + "/plan.json", summary_.plan.program.at("duet"), std::string(64, 'f'));
  EXPECT_SENTENCE(refusal());
  EXPECT_TRUE(read_attempts(run_, 0).empty());
}

TEST_F(ClusterWork, AnotherClipIsRefused) {
  plan();
  const std::string clip = run_ + "/" + summary_.plan.clips.at(0).file;
  write_file(clip, read_file(clip) + " ");
  EXPECT_SENTENCE(refusal(0));
  EXPECT_EQ(work(1).run, 2);  // which does not need it
}

TEST_F(ClusterWork, AnotherSuiteIsRefused) {
  plan();
  test::replace_in(run_ + "/run.json", load_run_head(run_).info.suite_hash, std::string(64, 'e'));
  EXPECT_SENTENCE(refusal());
}

TEST_F(ClusterWork, AnotherPolicyIsRefused) {
  plan();
  test::replace_in(run_ + "/run.json", load_run_head(run_).info.policies.at("replay"), std::string(64, 'e'));
  EXPECT_SENTENCE(refusal());
}

TEST_F(ClusterWork, KeysThatAreNotThePlansAreRefused) {
  plan();
  test::replace_in(run_ + "/plan.json", summary_.plan.shards[0].keys, std::string(64, '0'));
  EXPECT_SENTENCE(refusal(0));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { work(2); }));
}

TEST_F(ClusterWork, ABrokenRowIsToldWithFileAndLine) {
  plan();
  work(0);
  const std::string file = files(0, ".jsonl").front();
  write_file(file, "{}\n" + read_file(file));
  EXPECT_SENTENCE(refusal(0));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { merge(); }));
}

TEST_F(ClusterWork, AnAttemptAtAnotherPlanIsNotMerged) {
  plan();
  work(0);
  test::replace_in(files(0, ".log").front(), shard_plan_digest(run_), std::string(64, '9'));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { merge(); }));
}

TEST_F(ClusterWork, PilotsAreRowsAndMeasureCosts) {
  PlanOptions options;
  options.shards = 2;
  summary_ = plan_run(test::playback_suite(), run_, options, stop_, quiet_);
  EXPECT_EQ(summary_.pilots, 2);
  EXPECT_GT(summary_.plan.costs.at("playback/pd"), 0.0);
  EXPECT_EQ(work(0).already_there, 2);
  EXPECT_EQ(run_status(run_).done, 2);
  EXPECT_EQ(run_status(run_).shards[0].attempts, 0);
  work(1);
  merge();
  expect_reference();
}

TEST_F(ClusterWork, AFolderIsPlannedOnce) {
  plan();
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { plan(); }));
  run_ = folder_ / "reference";
  static_cast<void>(reference());
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { plan(); }));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { merge_runs({run_}, {}); }));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { merge_runs({run_, run_}, {}); }));
}

TEST_F(ClusterWork, CostsOfWhatTheSuiteDoesNotRunAreRefused) {
  PlanOptions options;
  options.costs = {{"mujoco/pd", 1.0}};
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [&] { plan_run(test::playback_suite(), run_, options, stop_, quiet_); }));
}

// Journals as workers leave them that were killed.
std::string open_journal(const std::string& key, std::int64_t pid, const std::string& more = "") {
  AttemptHeader header = new_attempt(0, "");
  return dumped(nlohmann::json({{"schema", "duet.attempt/1"},
                                {"shard", 0},
                                {"node", header.node},
                                {"pid", pid},
                                {"plan", ""},
                                {"started_at", "2026-01-02T03:04:05Z"},
                                {"environment", nullptr}})) +
         "\nbegan " + key + "\n" + more;
}

class PoisonedEpisode : public ClusterWork {
 protected:
  PoisonedEpisode() { plan(); }
  void leave(int number, const std::string& more) {
    // A process of this number cannot be: the kernel's largest is 2^22.
    write_file(run_ + "/attempts/000000/x-1-" + std::to_string(number) + ".log", open_journal(key_, 1 << 30, more));
  }
  std::string key_ = reference().begin()->first;
  [[nodiscard]] std::string key_of_shard() {
    work(0);
    std::string key = read_attempts(run_, 0).front().done.front().key;
    fs::remove_all(run_ + "/attempts");
    return key;
  }
};

TEST_F(PoisonedEpisode, ThatCrashedTwoWorkersIsARowWithTheSignals) {
  key_ = key_of_shard();
  leave(1, "\ncrashed " + key_ + " SIGSEGV\n");
  EXPECT_EQ(run_status(run_).shards[0].crashes, 1);
  leave(2, "\ncrashed " + key_ + " SIGABRT\n");
  const WorkSummary summary = work(0);
  EXPECT_EQ(summary.poisoned, 1);
  EXPECT_EQ(summary.outcomes.at("error"), 1);
  work(1);
  const MergeSummary merged = merge();
  EXPECT_EQ(merged.rows.errors, 1);
  std::map<std::string, std::string> messages;
  for (const EpisodeRow& row : load_run(run_).rows) messages[row.key] = row.message;
  EXPECT_SENTENCE(messages.at(key_));
  EXPECT_EQ(work(0).run, 0);
  EXPECT_EQ(work(0, {.retry_errors = true}).run, 1);
  EXPECT_EQ(merge().rows.superseded, 2);  // of the attempt, and of the merge before
  expect_reference();
}

TEST_F(PoisonedEpisode, OneCrashIsTriedAgain) {
  key_ = key_of_shard();
  leave(1, "\ncrashed " + key_ + " SIGSEGV\n");
  EXPECT_EQ(work(0).poisoned, 0);
}

TEST_F(PoisonedEpisode, WorkersThatVanishCountLessThanCrashes) {
  key_ = key_of_shard();
  for (int i = 1; i < kMostLosses; ++i) leave(i, "");
  {
    const WorkSummary summary = work(0);
    EXPECT_EQ(summary.poisoned, 0);
    fs::remove_all(run_ + "/attempts");
  }
  for (int i = 0; i < kMostLosses; ++i) leave(i, "");
  EXPECT_EQ(work(0).poisoned, 1);
}

TEST_F(PoisonedEpisode, AWorkerThatIsStoppedOrAliveLostNothing) {
  key_ = key_of_shard();
  for (int i = 0; i < 2 * kMostLosses; ++i) leave(i, "ended stopped\n");
  for (int i = 0; i < 2 * kMostLosses; ++i)
    write_file(run_ + "/attempts/000000/y-1-" + std::to_string(i) + ".log", open_journal(key_, getpid()));
  EXPECT_EQ(run_status(run_).shards[0].state, ShardState::kRunning);
  EXPECT_EQ(work(0).poisoned, 0);
}

TEST(Journal, ALineThatIsNotWholeIsLeftOut) {
  const std::string whole = open_journal("K1", 1, "did K1 ok 0.250\nbegan K2\n");
  const auto record = parse_journal(whole + "did K2 o", "a.log");
  ASSERT_TRUE(record);
  EXPECT_EQ(record->done.size(), 1U);
  EXPECT_EQ(record->done[0].seconds, 0.25);
  EXPECT_THAT(record->open, testing::ElementsAre("K2"));
  const auto torn = parse_journal(whole + "did K2 o\ncrashed K2 SIGBUS\nended complete\n", "a.log");
  EXPECT_TRUE(torn->open.empty());
  EXPECT_EQ(torn->crashes.at(0).signal, "SIGBUS");
  EXPECT_EQ(torn->end, "complete");
  EXPECT_FALSE(parse_journal(whole.substr(0, 20), "a.log"));
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { parse_journal("{\"schema\":\"other/1\"}\n", "a.log"); }));
}

TEST(FileSystemTime, IsThatOfANewFileAndLeavesNothing) {
  const test::ScratchFolder folder;
  const auto now = static_cast<double>(std::time(nullptr));
  EXPECT_NEAR(static_cast<double>(file_system_time(folder / "")), now, 5.0);
  EXPECT_TRUE(fs::is_empty(folder / ""));
  EXPECT_NEAR(static_cast<double>(file_system_time(folder / "absent")), now, 5.0);
}

TEST(Ranges, AreShort) {
  EXPECT_EQ(ranges_text({}), "");
  EXPECT_EQ(ranges_text({3}), "3");
  EXPECT_EQ(ranges_text({0, 1, 2, 5, 7, 8}), "0-2,5,7-8");
}

}  // namespace
}  // namespace duet
