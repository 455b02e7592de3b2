// `duet hw episodes` as a user runs it: the built program, the twin within it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "duet/core/file.h"
#include "tests/app/program.h"
#include "tests/backends/engine_names.h"
#include "tests/support.h"

namespace duet {
namespace {

// In whichever half of an episode the signal comes, the program ends with its code and the episode leaves no row.
TEST(HwEpisodes, AnInterruptedEpisodeLeavesNoRow) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: engine mujoco absent";
  const test::ScratchFolder folder;
  const std::string examples = std::string(DUET_SOURCE_DIR) + "/examples/hardware/";
  for (const char* wait : {"0.6", "1.1", "1.9", "3.1"}) {
    const std::string out = folder / (std::string("out") + wait);
    write_file(folder / "script.sh", "'" + test::program() + "' hw episodes '" + examples + "twin.yaml' '" + examples +
                                         "episodes.yaml' -s 'controllers=[wbc_sim]' -s clips.synth.per_task=2 --clock "
                                         "in-process -q -o '" +
                                         out + "' >/dev/null 2>&1 & p=$!; sleep " + wait +
                                         "; kill -INT $p; wait $p; echo $? > '" + (folder / "code") + "'\n");
    ASSERT_EQ(std::system(("bash '" + (folder / "script.sh") + "'").c_str()), 0);
    EXPECT_EQ(read_file(folder / "code"), "130\n") << wait;
    const std::string rows = std::filesystem::exists(out + "/episodes.jsonl") ? read_file(out + "/episodes.jsonl") : "";
    EXPECT_EQ(std::count(rows.begin(), rows.end(), '\n') % 2, 0) << wait;
    EXPECT_EQ(rows.find("timed_out"), std::string::npos) << wait;
  }
}

// The folder is a run: its rows can be read, reported and gone on with.
TEST(HwEpisodes, LeaveARunThatReportReads) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: engine mujoco absent";
  const test::ScratchFolder folder;
  const std::string examples = std::string(DUET_SOURCE_DIR) + "/examples/hardware/", out = folder / "out";
  const std::string command = "hw episodes " + examples + "twin.yaml " + examples +
                              "episodes.yaml -s 'controllers=[wbc_sim]' -s clips.synth.per_task=1 --clock in-process "
                              "-n 1 -q -o " +
                              out;
  EXPECT_EQ(test::duet_program(command).code, 0);
  const std::string rows = read_file(out + "/episodes.jsonl");
  EXPECT_EQ(std::count(rows.begin(), rows.end(), '\n'), 2);
  for (const char* file : {"run.json", "env.json", "suite.yaml", "inputs/inputs.json"})
    EXPECT_TRUE(std::filesystem::exists(out + "/" + file)) << file;
  EXPECT_EQ(test::duet_program("report -q --no-clips " + out + " -o " + (folder / "page")).code, 0);
  EXPECT_EQ(test::duet_program(command).code, 0);  // again: each episode has its row once
  EXPECT_EQ(read_file(out + "/episodes.jsonl"), rows);
}

TEST(HwEpisodes, ASolidPersonNeedsTheTwinInThisProcess) {
  const test::ScratchFolder folder;
  const std::string examples = std::string(DUET_SOURCE_DIR) + "/examples/hardware/";
  const test::Answer answer =
      test::duet_program("hw episodes " + examples + "twin.yaml " + examples +
                         "episodes.yaml -s 'controllers=[wbc_sim]' -s partner=solid -o " + (folder / "out"));
  EXPECT_EQ(answer.code, 2);
  EXPECT_NE(answer.err.find("needs --clock in-process, found 'lock-step'"), std::string::npos) << answer.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(HwEpisodes, ATwinHasNoPersonWhoGivesWay) {
  const test::ScratchFolder folder;
  const std::string examples = std::string(DUET_SOURCE_DIR) + "/examples/hardware/";
  const test::Answer answer = test::duet_program(
      "hw episodes " + examples + "twin.yaml " + examples +
      "episodes.yaml -s 'controllers=[wbc_sim]' -s partner=yielding --clock in-process -o " + (folder / "out"));
  EXPECT_EQ(answer.code, 2);
  EXPECT_NE(answer.err.find("expected a partner who is none, ghost or solid, found yielding"), std::string::npos)
      << answer.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

TEST(HwEpisodes, AClockThatIsNoneIsRefused) {
  const test::ScratchFolder folder;
  const std::string examples = std::string(DUET_SOURCE_DIR) + "/examples/hardware/";
  const test::Answer answer = test::duet_program("hw episodes " + examples + "twin.yaml " + examples +
                                                 "episodes.yaml --clock real-tim -o " + (folder / "out"));
  EXPECT_EQ(answer.code, 2);
  EXPECT_NE(answer.err.find("clock of the twin 'real-tim': did you mean 'real-time'?"), std::string::npos)
      << answer.err;
}

}  // namespace
}  // namespace duet
