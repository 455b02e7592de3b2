#include "duet/report/ranking/golden.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "tests/deep_json.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::thrown_message;
using testing::HasSubstr;

std::vector<LeaderboardEntry> board(int successes, double jpe) {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 20; ++i) {
    rows.push_back(episode("replay", "hug", i, i < successes));
    rows.back().metrics = {{"jpe", jpe}};
  }
  return leaderboard(rows);
}

std::vector<GoldenDifference> checked(const std::string& golden, const std::vector<LeaderboardEntry>& entries) {
  return check(golden, entries, test::tiny_run());
}

std::string refusal(const std::string& golden) {
  return thrown_message<InputError>([&] { checked(golden, board(10, 0.1)); });
}

TEST(Golden, ARunAgreesWithItself) {
  const std::string golden = bless(board(10, 0.1), test::tiny_run());
  EXPECT_TRUE(checked(golden, board(10, 0.1)).empty());
  EXPECT_TRUE(checked(golden, board(11, 0.1001)).empty());  // one episode, a per mille
}

TEST(Golden, EachFigureIsHeldToItsTolerance) {
  const std::string golden = bless(board(10, 0.1), test::tiny_run());
  const std::vector<GoldenDifference> success = checked(golden, board(12, 0.1));
  ASSERT_EQ(success.size(), 2U);  // hug and all
  EXPECT_EQ(success[0].where, "mujoco/vmc/replay clean all success");
  EXPECT_EQ(success[1].where, "mujoco/vmc/replay clean hug success");
  EXPECT_DOUBLE_EQ(success[1].expected, 0.5);
  EXPECT_DOUBLE_EQ(success[1].found, 0.6);
  EXPECT_NEAR(success[1].tolerance, 0.05, 1e-9);
  const std::vector<GoldenDifference> metric = checked(golden, board(10, 0.103));
  ASSERT_EQ(metric.size(), 2U);
  EXPECT_EQ(metric[1].where, "mujoco/vmc/replay clean hug jpe");
}

TEST(Golden, TolerancesInTheFileCount) {
  nlohmann::json golden = nlohmann::json::parse(bless(board(10, 0.1), test::tiny_run()));
  for (auto& [where, figures] : golden.at("entries").items()) {
    figures["jpe"]["rtol"] = 0.0;
    figures["jpe"]["atol"] = 0.5;
    figures["success"]["atol"] = 0.2;
  }
  EXPECT_TRUE(checked(golden.dump(), board(13, 0.55)).empty());
  EXPECT_EQ(checked(golden.dump(), board(13, 0.65)).size(), 2U);
}

TEST(Golden, MissingFiguresAndEpisodesAreDifferences) {
  const std::string golden = bless(board(10, 0.1), test::tiny_run());
  const std::vector<GoldenDifference> differences = checked(golden, {});
  ASSERT_EQ(differences.size(), 1U);  // one policy is missing, not six figures
  EXPECT_EQ(differences[0].where, "policy 'replay'");
  EXPECT_EQ(differences[0].figures, 6);
  EXPECT_TRUE(differences[0].missing);
  EXPECT_TRUE(std::isnan(differences[0].found));
  std::vector<EpisodeRow> half;
  for (int i = 0; i < 10; ++i) half.push_back(episode("replay", "hug", i, i < 5));
  std::vector<std::string> places;
  for (const GoldenDifference& difference : checked(golden, leaderboard(half))) places.push_back(difference.where);
  EXPECT_THAT(places, testing::Contains("mujoco/vmc/replay clean hug episodes"));
}

TEST(Golden, NewFiguresAreNoDifference) {
  const std::string golden = bless({}, test::tiny_run());
  EXPECT_TRUE(checked(golden, board(10, 0.1)).empty());
}

TEST(Golden, ArmsAreKeptApart) {
  std::vector<EpisodeRow> rows = {episode("null", "hug", 0, true), episode("null", "hug", 0, false, "null")};
  const std::string golden = bless(leaderboard(rows), test::tiny_run());
  EXPECT_TRUE(checked(golden, leaderboard(rows)).empty());
  EXPECT_THAT(golden, HasSubstr("mujoco/vmc/null (null arm) clean hug"));
}

TEST(Golden, RefusesAnotherSuite) {
  RunInfo other = test::tiny_run();
  other.suite_version = "0.9.0";
  const std::string golden = bless(board(10, 0.1), other);
  EXPECT_SENTENCE(refusal(golden));
}

TEST(Golden, RefusesAnotherSuiteHashAndNamesTheLineThatDiffers) {
  RunInfo other = test::tiny_run();
  other.suite_hash = "fedcba9876543210";
  other.suite_yaml = "name: tiny\nversion: 1.0.0\nstart_radius: 0.5\npolicies: [mine]\n# made here\n";
  const std::string golden = bless(board(10, 0.1), other);
  EXPECT_SENTENCE(refusal(golden));
  other.suite_yaml = test::tiny_run().suite_yaml;
  EXPECT_SENTENCE(refusal(bless(board(10, 0.1), other)));
}

TEST(Golden, OneFlipOfFewEpisodesIsADifference) {
  const auto few = [](bool success) { return leaderboard({episode("replay", "hug", 0, success)}); };
  const std::vector<GoldenDifference> differences = checked(bless(few(true), test::tiny_run()), few(false));
  ASSERT_EQ(differences.size(), 2U);
  EXPECT_EQ(differences[1].where, "mujoco/vmc/replay clean hug success");
  EXPECT_TRUE(checked(bless(few(true), test::tiny_run()), few(true)).empty());
}

TEST(Golden, WhatDidNotRunIsOneLine) {
  std::vector<EpisodeRow> rows = {episode("a", "hug", 0, true), episode("a", "wave", 0, true),
                                  episode("b", "hug", 0, true), episode("b", "wave", 0, true)};
  EpisodeRow elsewhere = test::engine_episode("bullet", "b", 0, true);
  rows.push_back(elsewhere);
  const std::string golden = bless(leaderboard(rows), test::tiny_run());
  const auto lines = [&](const std::vector<EpisodeRow>& there) {
    std::vector<std::string> places;
    for (const GoldenDifference& difference : checked(golden, leaderboard(there))) places.push_back(difference.where);
    return places;
  };
  EXPECT_THAT(lines({rows[2], rows[3], rows[4]}), testing::ElementsAre("policy 'a'"));
  EXPECT_THAT(lines({rows[0], rows[1], rows[4]}), testing::ElementsAre("mujoco/vmc/b clean"));
}

duet::Run run_of(const std::vector<EpisodeRow>& rows) {
  duet::Run run;
  run.path = "base";
  run.info = test::tiny_run();
  run.rows = rows;
  return run;
}

TEST(Golden, ExactlyHoldsEveryFieldOfEveryEpisode) {
  EpisodeRow row = episode("replay", "hug", 0, true), other = row;
  other.wall_s = 9.0;
  EXPECT_THAT(exact_differences(run_of({row}), run_of({other, episode("more", "hug", 0, true)})), testing::IsEmpty());
  other.metrics["jpe"] = 0.5;
  EXPECT_THAT(exact_differences(run_of({row}), run_of({other})),
              testing::ElementsAre("hug-0 0 of mujoco/vmc/replay clean: expected, found: metrics.jpe: nothing, 0.5"));
  EXPECT_THAT(exact_differences(run_of({row}), run_of({})),
              testing::ElementsAre("hug-0 0 of mujoco/vmc/replay clean: not in the run"));
  duet::Run foreign = run_of({row});
  foreign.info.suite_hash = "fedcba9876543210";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { exact_differences(run_of({row}), foreign); }));
}

TEST(Golden, RefusesABrokenBaseline) {
  EXPECT_SENTENCE(refusal("{"));
  EXPECT_SENTENCE(refusal("{\"schema\":" + test::deep_json() + "}"));
  EXPECT_SENTENCE(refusal("[]"));
  EXPECT_SENTENCE(refusal(R"({"schema": "duet.golden/2"})"));
  const auto with_entries = [](const std::string& entries, const std::string& more = "") {
    return refusal(R"({"schema": "duet.golden/1", "suite": "tiny", "suite_version": "1.0.0", )"
                   R"("suite_hash": "0123456789abcdef", "suite_yaml": "", "entries": )" +
                   entries + more + "}");
  };
  EXPECT_SENTENCE(with_entries("[]"));
  EXPECT_SENTENCE(with_entries("{}", R"(, "entrys": 1)"));
  for (const char* text : {R"({"a": 1})", R"({"a": {"jpe": {"value": 1, "atol": 0}}})",
                           R"({"a": {"jpe": {"value": null, "atol": 0, "rtol": 0}}})",
                           R"({"a": {"jpe": {"value": 1, "atol": -1, "rtol": 0}}})",
                           R"({"a": {"jpe": {"value": 1, "atol": 0, "rtol": 0, "tol": 0}}})"})
    EXPECT_SENTENCE(with_entries(text));
}

}  // namespace
}  // namespace duet
