// Suites that a commanded velocity leads: does it walk, how fast, does it fall.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "duet/execution/runner.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite/suite.h"
#include "duet/rows/folder/run_directory.h"
#include "duet/rows/groups/row_groups.h"
#include "tests/app/program.h"
#include "tests/backends/engine_names.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::ScratchFolder;
using ::testing::HasSubstr;

std::string yaml(const std::string& reference, const std::string& more = "engines: [playback]\ncontrollers: [pd]\n") {
  return "schema: duet.suite/1\nname: w\nversion: 1.0.0\nreference: " + reference + "\n" + more;
}

Suite suite(const std::string& reference, const std::string& more = "engines: [playback]\ncontrollers: [pd]\n") {
  return parse_suite(yaml(reference, more), "w.yaml");
}

std::string refusal(const std::string& reference,
                    const std::string& more = "engines: [playback]\ncontrollers: [pd]\n") {
  return test::thrown_message<InputError>([&] { suite(reference, more); });
}

std::vector<EpisodeRow> rows_of(const Suite& suite, const std::string& folder) {
  Progress quiet(Progress::Style::kQuiet);
  run_suite(suite, folder, {}, quiet);
  return load_run(folder).rows;
}

TEST(WalkSuite, ACommandHasANameOfItsDirection) {
  const std::vector<std::pair<const char*, const char*>> cases = {{"{velocity: [0, 0, 0]}", "stand"},
                                                                  {"{velocity: [0.3, 0, 0]}", "forward_0.3"},
                                                                  {"{velocity: [-0.2, 0, 0]}", "back_0.2"},
                                                                  {"{velocity: [0, 0.1, 0]}", "left_0.1"},
                                                                  {"{velocity: [0, -0.1, 0]}", "right_0.1"},
                                                                  {"{velocity: [0, 0, 0.4]}", "turn_left_0.4"},
                                                                  {"{velocity: [0, 0, -0.4]}", "turn_right_0.4"},
                                                                  {"{velocity: [0.3, 0, -0.4]}", "0.3_0_-0.4"},
                                                                  {"{name: mine, velocity: [1, 0, 0]}", "mine"}};
  for (const auto& [text, name] : cases) EXPECT_EQ(suite(text).references.at(0).name, name) << text;
}

TEST(WalkSuite, WrittenOutItReadsBackToTheSame) {
  const Suite once = suite(
      "[{velocity: [0.3, 0, 0]}, {name: gate, velocity: [0, 0.1, 0.2], seconds: 10, begin: 1, end: 7, pause: 1, "
      "upper_body: moving}]",
      "engines: [playback]\ncontrollers: [pd]\nperturbations: [clean, kick]\nepisodes_per_clip: 3\n");
  const std::string text = resolved_yaml(once);
  EXPECT_EQ(resolved_yaml(parse_suite(text, "again.yaml")), text);
  EXPECT_THAT(text, HasSubstr("end: 7, pause: 1, upper_body: moving"));
}

TEST(WalkSuite, WhatHasNoMeaningBesideACommandIsRefusedByItsLine) {
  EXPECT_THAT(refusal("{velocity: [0, 0]}"), HasSubstr("velocity"));
  EXPECT_THAT(refusal("{velocity: [0, 0, 40]}"), HasSubstr("at most 10 m/s"));
  EXPECT_THAT(refusal("{velocity: [0, 0, 0], seconds: 0}"), HasSubstr("'seconds': expected a number from 0.2"));
  EXPECT_THAT(refusal("{velocity: [0, 0, 0], begin: 3, end: 2}"), HasSubstr("'end': expected a number from 3"));
  EXPECT_THAT(refusal("{velocity: [0, 0, 0], upper_body: dancing}"),
              HasSubstr("unknown upper_body 'dancing'. Known: still, held, moving"));
  EXPECT_THAT(refusal("[{velocity: [0, 0, 0]}, {velocity: [0, 0, 0]}]"), HasSubstr("'stand' is there twice"));
  EXPECT_THAT(refusal("[]"), HasSubstr("expected at least one, found none"));
  EXPECT_THAT(refusal("{velocity: [0, 0, 0]}", "engines: [playback]\ncontrollers: [pd]\npolicies: [replay]\n"),
              ::testing::AllOf(HasSubstr("w.yaml:7"), HasSubstr("policies: expected no such key beside `reference`")));
  EXPECT_THAT(
      refusal("{velocity: [0, 0, 0]}", "engines: [playback]\ncontrollers: [pd]\nclips: {synth: {per_task: 1}}\n"),
      HasSubstr("clips: expected no such key"));
  EXPECT_THAT(refusal("{velocity: [0.1, 0, 0], begin: 1}", "engines: [playback]\ncontrollers: [homie]\n"),
              HasSubstr("controller 'homie' takes one velocity for the whole episode"));
}

// A command may be for some of the perturbations alone.
TEST(WalkSuite, ACommandIsRunUnderThePerturbationsThatItNames) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const std::string more =
      "engines: [mujoco]\ncontrollers: [pd]\nperturbations: [clean, noise, kick]\n"
      "episodes_per_clip: 2\n";
  const Suite walk = suite(
      "[{velocity: [0, 0, 0], seconds: 0.2, perturbations: [noise]}, "
      "{velocity: [0.3, 0, 0], seconds: 0.2}]",
      more);
  EXPECT_EQ(count_episodes(walk, walk.tasks_of_own_clips(), {EpisodeFilter()}), 2 * (1 + 3));
  EXPECT_EQ(resolved_yaml(parse_suite(resolved_yaml(walk), "again.yaml")), resolved_yaml(walk));
  EXPECT_THAT(resolved_yaml(walk), HasSubstr("upper_body: still, perturbations: [noise]}"));
  const ScratchFolder folder;
  std::map<std::pair<std::string, std::string>, int> ran;
  for (const EpisodeRow& row : rows_of(walk, folder / "run")) ++ran[{row.clip, row.perturbation}];
  EXPECT_THAT(ran, ::testing::ElementsAre(::testing::Pair(::testing::Pair("forward_0.3", "clean"), 2),
                                          ::testing::Pair(::testing::Pair("forward_0.3", "kick"), 2),
                                          ::testing::Pair(::testing::Pair("forward_0.3", "noise"), 2),
                                          ::testing::Pair(::testing::Pair("stand", "noise"), 2)));
  EXPECT_THAT(refusal("{velocity: [0, 0, 0], perturbations: [nosie]}", more),
              ::testing::AllOf(HasSubstr("w.yaml:4"), HasSubstr("'stand'"), HasSubstr("did you mean 'noise'?")));
  EXPECT_THAT(refusal("{velocity: [0, 0, 0], perturbations: [{kick: {speed: 1}}]}", more),
              HasSubstr("expected names of the suite's perturbations, found a mapping"));
}

TEST(WalkSuite, ARootThatIsPlayedBackMovesAsItIsCommanded) {
  const ScratchFolder folder;
  const std::vector<EpisodeRow> rows =
      rows_of(suite("[{velocity: [0.3, -0.1, 0], seconds: 6}, {velocity: [0, 0, 0.2], seconds: 6}]"), folder / "run");
  ASSERT_EQ(rows.size(), 2U);
  for (const EpisodeRow& row : rows) {
    EXPECT_EQ(row.task, "walk");
    EXPECT_EQ(row.policy, "velocity");
    EXPECT_EQ(row.success, true);
    EXPECT_EQ(row.frames, 300);
    EXPECT_NEAR(row.metrics.at("speed_forward"), row.metrics.at("command_forward"), 1e-9);
    EXPECT_NEAR(row.metrics.at("speed_sideways"), row.metrics.at("command_sideways"), 1e-9);
    EXPECT_NEAR(row.metrics.at("turn_rate"), row.metrics.at("command_turn"), 1e-9);
  }
}

// Joint targets alone do not balance; a controller that balances does; both are led by the same command.
TEST(WalkSuite, TellsWhoStandsFromWhoFalls) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const ScratchFolder folder;
  const Suite walk = suite("{name: moving, velocity: [0, 0, 0], seconds: 6, upper_body: moving}",
                           "engines: [mujoco]\ncontrollers: [pd, vmc]\nepisodes_per_clip: 2\n");
  const std::vector<EpisodeRow> rows = rows_of(walk, folder / "run");
  ASSERT_EQ(rows.size(), 4U);
  std::map<std::string, std::vector<const EpisodeRow*>> of;
  for (const EpisodeRow& row : rows) of[row.controller].push_back(&row);
  for (const EpisodeRow* row : of["pd"]) {
    EXPECT_TRUE(row->fell);
    EXPECT_EQ(row->success, false);
    EXPECT_LT(row->metrics.at("time_to_fall"), 6.0);
  }
  for (const EpisodeRow* row : of["vmc"]) EXPECT_EQ(row->outcome, Outcome::kOk) << row->message;
  EXPECT_NE(of["vmc"][0]->state_hash, of["vmc"][1]->state_hash);  // each episode draws its own poses
}

// 28 of 32 and more in suites/wbc_gates.yaml; these would notice a network that does not fit the program.
TEST(WalkSuite, TheShippedNetworksStandAndWalk) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const ScratchFolder folder;
  const Suite walk = suite(
      "[{velocity: [0, 0, 0], seconds: 10, upper_body: moving},"
      " {velocity: [0.3, 0, 0], seconds: 10, begin: 1, end: 7, upper_body: moving}]",
      "engines: [mujoco]\n"
      "controllers: [wbc_sim, {name: oracle, use: wbc_sim, options: {network: oracle}}]\n");
  for (const EpisodeRow& row : rows_of(walk, folder / "run")) {
    EXPECT_EQ(row.outcome, Outcome::kOk) << row.controller << " " << row.clip << " " << row.message;
    EXPECT_LT(row.metrics.at("upper_body_error"), 0.10) << row.controller << " " << row.clip;
  }
}

// The last stage of a ladder that is passed is printed above the walks.
TEST(WalkSuite, PrintsTheStagesThatItNames) {
  const ScratchFolder folder;
  write_file(folder / "w.yaml",
             yaml("[{name: own, tags: {stage: 1, stage_name: own}, velocity: [0, 0, 0], seconds: 2}, "
                  "{name: stage_7_lies, tags: {stage: 2, stage_name: held}, velocity: [0.2, 0, 0], seconds: 2, "
                  "upper_body: held}]"));
  const test::Answer ended = test::duet_program("run '" + (folder / "w.yaml") + "' -o '" + (folder / "run") + "'");
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_THAT(ended.out, ::testing::AllOf(HasSubstr("### Stages"), HasSubstr("2 held"), HasSubstr("95 % or more")));
  const test::Answer report = test::duet_program("report '" + (folder / "run") + "' -f md,csv,json,tex,html");
  ASSERT_EQ(report.code, 0) << report.err;
  for (const char* file : {"levels.md", "levels.csv", "levels.json", "levels.tex"})
    EXPECT_THAT(report.err, HasSubstr(file));
}

TEST(WalkSuite, RunsAgainToTheSameRows) {
  const ScratchFolder folder;
  const Suite walk = suite("{velocity: [0.2, 0, 0], seconds: 3, upper_body: moving}");
  const EpisodeRow one = rows_of(walk, folder / "one").at(0), two = rows_of(walk, folder / "two").at(0);
  EXPECT_EQ(one.key, two.key);
  EXPECT_EQ(one.state_hash, two.state_hash);
  EXPECT_EQ(one.metrics, two.metrics);
}

TEST(WalkSuite, TheCommandLinePrintsOneTableOfIt) {
  const ScratchFolder folder;
  write_file(folder / "w.yaml", yaml("[{velocity: [0, 0, 0], seconds: 3}, {velocity: [0.4, 0, 0], seconds: 3}]"));
  const test::Answer ended = test::duet_program("run '" + (folder / "w.yaml") + "' -o '" + (folder / "run") + "'");
  ASSERT_EQ(ended.code, 0) << ended.out;
  EXPECT_THAT(ended.out, HasSubstr("### Walking by command"));
  EXPECT_THAT(ended.out, ::testing::Not(HasSubstr("Success")));
  const test::Answer report = test::duet_program("report '" + (folder / "run") + "' -f md,csv,json,tex,html");
  ASSERT_EQ(report.code, 0) << report.out;
  for (const char* file : {"walking.md", "walking.csv", "walking.json", "walking.tex"})
    EXPECT_THAT(report.err, HasSubstr(file));
  EXPECT_THAT(report.out, ::testing::Not(HasSubstr("Policies")));
  EXPECT_THAT(read_file(folder / "run/report.html"), HasSubstr("Walking by command"));
  EXPECT_EQ(test::duet_program("verify '" + (folder / "run") + "'").code, 0);
}

}  // namespace
}  // namespace duet
