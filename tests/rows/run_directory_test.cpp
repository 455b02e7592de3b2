#include "duet/rows/folder/run_directory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/rows/folder/environment.h"
#include "duet/rows/folder/run_files.h"
#include "tests/deep_json.h"
#include "tests/file_size_limit.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::append_text;
using test::episode;
using test::FileSizeLimit;
using test::ScratchFolder;
using test::thrown_message;
using test::tiny_run;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(RunDirectory, KeepsWhatWasAppended) {
  const ScratchFolder scratch;
  const std::string path = scratch / "runs/first";
  RunDirectory run = RunDirectory::open(path, tiny_run());
  run.append(episode("replay", "hug", 0, true));
  run.append(episode("replay", "hug", 1, false));
  EXPECT_EQ(run.size(), 2U);
  EXPECT_TRUE(run.has(episode("replay", "hug", 1, false).key));
  EXPECT_FALSE(run.has(episode("replay", "hug", 2, false).key));
  // On disk while the run goes on.
  const duet::Run loaded = load_run(path);
  ASSERT_EQ(loaded.rows.size(), 2U);
  EXPECT_EQ(to_json(loaded.rows[1]), to_json(episode("replay", "hug", 1, false)));
  EXPECT_EQ(loaded.info.suite, "tiny");
  EXPECT_EQ(loaded.info.suite_yaml, tiny_run().suite_yaml);
  EXPECT_EQ(loaded.info.argv, tiny_run().argv);
  EXPECT_EQ(loaded.info.environment, tiny_run().environment);
  EXPECT_EQ(loaded.dropped_lines, 0);
}

TEST(RunDirectory, ResumesWithoutForgettingOrRewriting) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
  RunInfo later = tiny_run();
  later.created_at = "2026-01-03T00:00:00Z";
  later.environment = {{"machine", "another machine"}};
  RunDirectory resumed = RunDirectory::open(scratch / "run", later);
  EXPECT_TRUE(resumed.has(episode("replay", "hug", 0, true).key));
  resumed.append(episode("replay", "hug", 1, true));
  const duet::Run run = load_run(scratch / "run");
  EXPECT_EQ(run.rows.size(), 2U);
  EXPECT_EQ(run.info.created_at, tiny_run().created_at);
  EXPECT_EQ(run.info.environment, tiny_run().environment);
  const nlohmann::json resumption = nlohmann::json::parse(read_file(scratch / "run/resumed.jsonl"));
  EXPECT_EQ(resumption.at("at"), later.created_at);
  EXPECT_EQ(resumption.at("environment"), later.environment);
}

TEST(RunDirectory, KeepsTheParityCertificateWhole) {
  const ScratchFolder scratch;
  RunInfo info = tiny_run();
  info.certificate = {{"schema", "duet.certificate/1"}, {"figures", {0.1, 1e-300}}};
  RunDirectory::open(scratch / "run", info);
  EXPECT_EQ(load_run(scratch / "run").info.certificate, info.certificate);
  const nlohmann::json first = info.certificate;
  info.certificate["effort"] = "full";
  RunDirectory::open(scratch / "run", info);
  EXPECT_EQ(load_run(scratch / "run").info.certificate, first);
  EXPECT_EQ(nlohmann::json::parse(read_file(scratch / "run/resumed.jsonl")).at("certificate"), info.certificate);
  RunDirectory::open(scratch / "plain", tiny_run());
  EXPECT_EQ(read_file(scratch / "plain/run.json").find("certificate"), std::string::npos);
  EXPECT_TRUE(load_run(scratch / "plain").info.certificate.is_null());
}

TEST(RunDirectory, AKilledRunLosesOnlyTheLineItWasWriting) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
  const std::string rows = scratch / "run/episodes.jsonl";
  append_text(rows, to_json(episode("replay", "hug", 1, true)).dump().substr(0, 100));
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 1U);
  EXPECT_EQ(load_run(scratch / "run").dropped_lines, 1);
  RunDirectory resumed = RunDirectory::open(scratch / "run", tiny_run());
  EXPECT_EQ(resumed.size(), 1U);
  resumed.append(episode("replay", "hug", 1, true));
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 2U);
  EXPECT_EQ(load_run(scratch / "run").dropped_lines, 0);
}

TEST(RunDirectory, AnEpisodeThatTimedOutRunsAgainAndItsRowGivesWay) {
  const ScratchFolder scratch;
  EpisodeRow row = episode("replay", "hug", 0, false);
  row.outcome = Outcome::kTimedOut;
  RunDirectory first = RunDirectory::open(scratch / "run", tiny_run());
  first.append(row);
  EXPECT_EQ(first.claim(row.key), Claim::kDone);  // by the process that saw it time out it is not tried twice
  RunDirectory second = RunDirectory::open(scratch / "run", tiny_run());
  EXPECT_EQ(second.claim(row.key), Claim::kMine);
  EXPECT_TRUE(second.append(episode("replay", "hug", 0, true)));
  const std::vector<EpisodeRow> rows = load_run(scratch / "run").rows;
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows[0].outcome, Outcome::kOk);
  EXPECT_EQ(RunDirectory::open(scratch / "run", tiny_run()).claim(row.key), Claim::kDone);
}

TEST(RunDirectory, ARunKilledWhileItWasCreatedCanStartAgain) {
  const ScratchFolder scratch;
  std::filesystem::create_directories(scratch / "run");
  append_text(scratch / "run/run.json.part-1-0", "{");
  EXPECT_EQ(RunDirectory::open(scratch / "run", tiny_run()).size(), 0U);
  std::filesystem::remove(scratch / "run/env.json");
  std::filesystem::remove(scratch / "run/suite.yaml");
  RunDirectory::open(scratch / "run", tiny_run());
  EXPECT_EQ(load_run(scratch / "run").info.suite_yaml, tiny_run().suite_yaml);
}

TEST(RunDirectory, RefusesAnotherSuiteAndNamesBoth) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run());
  RunInfo other = tiny_run();
  other.suite = "large";
  other.suite_version = "2.0.0";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { RunDirectory::open(scratch / "run", other); }));
  RunInfo edited = tiny_run();
  edited.suite_hash = "fedcba9876543210";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { RunDirectory::open(scratch / "run", edited); }));
}

TEST(RunDirectory, RefusesAFolderOfSomethingElse) {
  const ScratchFolder scratch;
  std::filesystem::create_directories(scratch / "photos");
  append_text(scratch / "photos/a.jpg", "x");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { RunDirectory::open(scratch / "photos", tiny_run()); }));
  EXPECT_FALSE(std::filesystem::exists(scratch / "photos/run.json"));
  append_text(scratch / "file", "x");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { RunDirectory::open(scratch / "file", tiny_run()); }));
}

// A file system without locks lets two processes run one episode; the first row stands, whoever has looked when.
TEST(RunDirectory, AnEpisodeThatAnotherHasAppendedMeanwhileIsLeftOut) {
  const ScratchFolder scratch;
  RunDirectory one = RunDirectory::open(scratch / "run", tiny_run()),
               other = RunDirectory::open(scratch / "run", tiny_run());
  const EpisodeRow row = episode("replay", "hug", 0, true), next = episode("replay", "hug", 1, true);
  EXPECT_TRUE(one.append(row));
  EXPECT_EQ(other.claim(next.key), Claim::kMine);  // and has looked
  EXPECT_TRUE(other.has(row.key));
  EXPECT_FALSE(other.append(row));
  EXPECT_TRUE(other.append(next));
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 2U);
}

TEST(LoadRun, ALinkAPipeOrADeviceInThePlaceOfAFileIsRefused) {
  const ScratchFolder scratch;
  const auto refusal = [&] { return thrown_message<InputError>([&] { load_run(scratch / "run"); }); };
  for (const std::string name : {"run.json", "env.json", "suite.yaml", "episodes.jsonl"}) {
    RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
    std::filesystem::rename(scratch / ("run/" + name), scratch / name);
    std::filesystem::create_symlink(scratch / name, scratch / ("run/" + name));
    EXPECT_SENTENCE(refusal()) << name;
    std::filesystem::remove(scratch / ("run/" + name));
    ASSERT_EQ(mkfifo((scratch / ("run/" + name)).c_str(), 0600), 0);
    EXPECT_SENTENCE(refusal()) << name;
    std::filesystem::remove_all(scratch / "run");
  }
}

TEST(RunDirectory, RefusesTheSameEpisodeTwiceAndRowsOfAnotherSuite) {
  const ScratchFolder scratch;
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  EXPECT_TRUE(run.append(episode("replay", "hug", 0, true)));
  EXPECT_FALSE(run.append(episode("replay", "hug", 0, false)));
  EpisodeRow foreign = episode("replay", "hug", 1, true);
  foreign.suite_hash = "another";
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { run.append(foreign); }));
  EpisodeRow nameless = episode("replay", "hug", 1, true);
  nameless.key = "";
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { run.append(nameless); }));
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 1U);
}

TEST(RunDirectory, AFullDiskLeavesWholeRowsAndTheEpisodeCanBeAppendedLater) {
  const ScratchFolder scratch;
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  run.append(episode("replay", "hug", 0, true));
  const EpisodeRow late = episode("replay", "hug", 1, true);
  {
    const FileSizeLimit limit(std::filesystem::file_size(scratch / "run/episodes.jsonl") + 100);
    EXPECT_SENTENCE(thrown_message<InputError>([&] { run.append(late); }));
  }
  EXPECT_FALSE(run.has(late.key));
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 1U);
  EXPECT_EQ(load_run(scratch / "run").dropped_lines, 0);
  run.append(late);
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 2U);
}

TEST(RunDirectory, TextThatIsNoUtf8DoesNotLoseTheEpisode) {
  const ScratchFolder scratch;
  RunDirectory run = RunDirectory::open(scratch / "run", tiny_run());
  EpisodeRow row = episode("replay", "hug", 0, false);
  row.message = "engine said \xff\xfe";
  run.append(row);
  EXPECT_THAT(load_run(scratch / "run").rows.at(0).message, HasSubstr("engine said"));
}

TEST(LoadRun, NamesFileAndLineOfABrokenRow) {
  const ScratchFolder scratch;
  RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
  const std::string rows = scratch / "run/episodes.jsonl";
  const std::string whole = read_file(rows);
  const auto with_line = [&](const std::string& line) {
    std::ofstream(rows, std::ios::binary | std::ios::trunc) << whole << line << "\n";
    const std::string message = thrown_message<InputError>([&] { load_run(scratch / "run"); });
    // Resuming must not paper over it either.
    EXPECT_EQ(thrown_message<InputError>([&] { RunDirectory::open(scratch / "run", tiny_run()); }), message);
    return message;
  };
  EXPECT_SENTENCE(with_line("{\"schema\": 1,"));
  EXPECT_SENTENCE(with_line(""));
  nlohmann::json json = to_json(episode("replay", "hug", 1, true));
  json["extra"] = 1;
  EXPECT_SENTENCE(with_line(json.dump()));
  EXPECT_SENTENCE(with_line(to_json(episode("replay", "hug", 0, false)).dump()));
  EpisodeRow foreign = episode("replay", "hug", 1, true);
  foreign.suite = "large";
  foreign.suite_hash = "fedcba9876543210";
  foreign.key = episode_key(foreign);
  EXPECT_SENTENCE(with_line(to_json(foreign).dump()));
  EpisodeRow renamed = episode("replay", "hug", 1, true);
  renamed.policy = "mine";
  EXPECT_THAT(with_line(to_json(renamed).dump()),
              AllOf(HasSubstr("episodes.jsonl:2: key 'key': expected " + episode_key(renamed)),
                    HasSubstr("found " + renamed.key + ": the row was changed")));
  EpisodeRow other = episode("replay", "hug", 1, true);
  other.policy_digest = std::string(64, 'b');
  other.key = episode_key(other);
  EXPECT_SENTENCE(with_line(to_json(other).dump()));
}

TEST(RunDirectory, KeepsTheDigestsOfItsPoliciesAndRefusesOthers) {
  const ScratchFolder scratch;
  RunInfo info = tiny_run();
  info.policies = {{"replay", std::string(64, 'a')}, {"absent", ""}};
  RunDirectory::open(scratch / "run", info);
  EXPECT_EQ(load_run(scratch / "run").info.policies, info.policies);
  EXPECT_EQ(load_run(scratch / "run").info.controllers, info.controllers);
  info.policies["absent"] = std::string(64, 'c');  // it has come since
  EXPECT_EQ(RunDirectory::open(scratch / "run", info).size(), 0U);
  info.policies["replay"] = std::string(64, 'b');
  EXPECT_EQ(thrown_message<InputError>([&] { RunDirectory::open(scratch / "run", info); }),
            "'" + (scratch / "run") + "' cannot be resumed: policy 'replay' is aaaaaaaaaaaa in " +
                (scratch / "run/run.json") +
                " and bbbbbbbbbbbb in this machine: one name stands for one policy; choose another folder");
  nlohmann::json json = nlohmann::json::parse(read_file(scratch / "run/run.json"));
  json["controllers"] = {{"vmc", 1}};
  std::ofstream(scratch / "run/run.json", std::ios::trunc) << json;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "run"); }));
}

TEST(LoadRun, NamesTheRunsInAFolderThatIsNone) {
  const ScratchFolder scratch;
  std::filesystem::create_directory(scratch / "demo");
  std::filesystem::create_directory(scratch / "demo/clips");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "demo"); }));
  RunDirectory::open(scratch / "demo/run", tiny_run());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "demo"); }));
}

TEST(RunDirectory, ReplacesRowsOfAPolicyThatIsAnotherAndNothingElse) {
  const ScratchFolder scratch;
  const auto row = [](const std::string& policy, char digest, int number) {
    EpisodeRow row = episode(policy, "hug", number, true);
    row.policy_digest = std::string(64, digest);
    row.key = episode_key(row);
    return row;
  };
  RunInfo info = tiny_run();
  info.policies = {{"mine", std::string(64, 'a')}, {"other", std::string(64, 'b')}};
  const EpisodeRow gone = row("mine", 'a', 0), stays = row("other", 'b', 0);
  {
    RunDirectory run = RunDirectory::open(scratch / "run", info);
    run.append(gone);
    run.append(stays);
    for (const EpisodeRow& of : {gone, stays})
      write_file(scratch / ("run/trajectories/" + of.key.substr(0, 16) + ".npz"), "");
    info.policies["mine"] = std::string(64, 'c');
    EXPECT_SENTENCE(thrown_message<InputError>([&] { RunDirectory::open(scratch / "run", info, false, {"mine"}); }));
  }
  EXPECT_EQ(load_run(scratch / "run").rows.size(), 2U);
  RunDirectory run = RunDirectory::open(scratch / "run", info, false, {"mine", "other", "nobody"});
  EXPECT_FALSE(run.has(gone.key));
  EXPECT_TRUE(run.has(stays.key));
  EXPECT_FALSE(std::filesystem::exists(scratch / ("run/trajectories/" + gone.key.substr(0, 16) + ".npz")));
  EXPECT_TRUE(std::filesystem::exists(scratch / ("run/trajectories/" + stays.key.substr(0, 16) + ".npz")));
  run.append(row("mine", 'c', 0));
  const duet::Run loaded = load_run(scratch / "run");
  EXPECT_EQ(loaded.rows.size(), 2U);
  EXPECT_EQ(loaded.info.policies, info.policies);
}

TEST(LoadRun, RefusesWhatIsNoRun) {
  const ScratchFolder scratch;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "nowhere"); }));
  RunDirectory::open(scratch / "run", tiny_run());
  append_text(scratch / "run/run.json", "}");
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "run"); }));
  std::ofstream(scratch / "run/run.json", std::ios::trunc) << R"({"schema": "duet.run/9"})";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "run"); }));
  RunDirectory::open(scratch / "other", tiny_run());
  nlohmann::json json = nlohmann::json::parse(read_file(scratch / "other/run.json"));
  json["certificate"] = "yes";
  std::ofstream(scratch / "other/run.json", std::ios::trunc) << json;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { load_run(scratch / "other"); }));
}

// Each document of a run, and the place of the value in it, as a stranger's run could bring it.
TEST(LoadRun, RefusesJsonThatNestsWithoutEnd) {
  const ScratchFolder scratch;
  const auto refusal = [&](const std::string& file, const std::string& text) {
    std::filesystem::remove_all(scratch / "run");
    RunDirectory::open(scratch / "run", tiny_run()).append(episode("replay", "hug", 0, true));
    write_file(scratch / ("run/" + file), text);
    return thrown_message<InputError>([&] { load_run(scratch / "run"); });
  };
  for (const std::string file : {"episodes.jsonl", "run.json", "env.json"})
    for (const std::string& text : {test::deep_json() + "\n", "{\"schema\":" + test::deep_json() + "}\n",
                                    "{\"extra\":" + test::deep_json() + "}\n"})
      EXPECT_SENTENCE(refusal(file, text));
}

TEST(Environment, HasWhatResultsDependOnAndNamesNobody) {
  setenv("DUET_TEST_FOLDER", "/people/somebody/data", 1);
  const char* before = std::getenv("HOME");
  const std::string home = before != nullptr ? before : "";
  setenv("HOME", "/people/somebody", 1);
  const nlohmann::json environment = capture_environment();
  setenv("HOME", home.c_str(), 1);
  unsetenv("DUET_TEST_FOLDER");
  for (const char* key : {"machine", "build", "processor", "load_average", "memory", "kernel", "locale",
                          "floating_point", "libraries", "random_numbers", "variables"}) {
    EXPECT_TRUE(environment.contains(key)) << key;
  }
  EXPECT_GE(environment.at("processor").at("usable_cores").get<int>(), 1);
  EXPECT_GT(environment.at("memory").at("total_bytes").get<std::uint64_t>(), 1U << 20);
  EXPECT_THAT(environment.at("build").at("compiler").get<std::string>(), HasSubstr(" "));
  EXPECT_THAT(environment.at("build").at("flags").get<std::string>(), HasSubstr("-ffp-contract=off"));
  EXPECT_EQ(environment.at("variables").at("DUET_TEST_FOLDER"), "~/data");
  char host[256] = {};
  ASSERT_EQ(gethostname(host, sizeof host - 1), 0);
  if (std::string(host).size() > 3) {
    EXPECT_EQ(environment.dump().find(host), std::string::npos);
  }
  EXPECT_EQ(environment.dump().find("somebody"), std::string::npos);
}

TEST(Environment, DescribesTheMachineInOneLine) {
  const std::string line = describe_machine();
  EXPECT_THAT(line, AllOf(HasSubstr(" core"), HasSubstr(", ")));
  EXPECT_EQ(line.find('\n'), std::string::npos);
}

TEST(RunLitter, OnlyWhatADeadProcessLeftHalfWrittenGoes) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "trajectories");
  const std::string dead = "run.json.part-999999999-0", mine = "run.json.part-" + std::to_string(getpid()) + "-0";
  for (const std::string& name : {dead, mine, std::string("run.json.part-"), std::string("run.json.part-me"),
                                  std::string("run.json"), "trajectories/" + dead})
    write_file(folder / name, "x");
  remove_litter(folder / "");
  EXPECT_FALSE(std::filesystem::exists(folder / dead));
  EXPECT_FALSE(std::filesystem::exists(folder / ("trajectories/" + dead)));
  for (const std::string& name :
       {mine, std::string("run.json.part-"), std::string("run.json.part-me"), std::string("run.json")})
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
}

}  // namespace
}  // namespace duet
