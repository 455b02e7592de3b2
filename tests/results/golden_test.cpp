#include "results/golden.h"

#include <gmock/gmock.h>

#include <cmath>

#include "core/require.h"
#include "tests/results/rows.h"
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
  return check(golden, entries, "tiny", "1.0.0");
}

std::string refusal(const std::string& golden) {
  return thrown_message<InputError>([&] { checked(golden, board(10, 0.1)); });
}

TEST(Golden, ARunAgreesWithItself) {
  const std::string golden = bless(board(10, 0.1), "tiny", "1.0.0");
  EXPECT_TRUE(checked(golden, board(10, 0.1)).empty());
  EXPECT_TRUE(checked(golden, board(11, 0.1001)).empty());  // one episode, a per mille
}

TEST(Golden, EachFigureIsHeldToItsTolerance) {
  const std::string golden = bless(board(10, 0.1), "tiny", "1.0.0");
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
  nlohmann::json golden = nlohmann::json::parse(bless(board(10, 0.1), "tiny", "1.0.0"));
  for (auto& [where, figures] : golden.at("entries").items()) {
    figures["jpe"]["rtol"] = 0.0;
    figures["jpe"]["atol"] = 0.5;
    figures["success"]["atol"] = 0.2;
  }
  EXPECT_TRUE(checked(golden.dump(), board(13, 0.55)).empty());
  EXPECT_EQ(checked(golden.dump(), board(13, 0.65)).size(), 2U);
}

TEST(Golden, MissingFiguresAndEpisodesAreDifferences) {
  const std::string golden = bless(board(10, 0.1), "tiny", "1.0.0");
  const std::vector<GoldenDifference> differences = checked(golden, {});
  ASSERT_EQ(differences.size(), 6U);
  EXPECT_TRUE(differences[0].missing);
  EXPECT_TRUE(std::isnan(differences[0].found));
  std::vector<EpisodeRow> half;
  for (int i = 0; i < 10; ++i) half.push_back(episode("replay", "hug", i, i < 5));
  std::vector<std::string> places;
  for (const GoldenDifference& difference : checked(golden, leaderboard(half))) places.push_back(difference.where);
  EXPECT_THAT(places, testing::Contains("mujoco/vmc/replay clean hug episodes"));
}

TEST(Golden, NewFiguresAreNoDifference) {
  const std::string golden = bless({}, "tiny", "1.0.0");
  EXPECT_TRUE(checked(golden, board(10, 0.1)).empty());
}

TEST(Golden, ArmsAreKeptApart) {
  std::vector<EpisodeRow> rows = {episode("null", "hug", 0, true), episode("null", "hug", 0, false, "null")};
  const std::string golden = bless(leaderboard(rows), "tiny", "1.0.0");
  EXPECT_TRUE(checked(golden, leaderboard(rows)).empty());
  EXPECT_THAT(golden, HasSubstr("mujoco/vmc/null (null arm) clean hug"));
}

TEST(Golden, RefusesAnotherSuite) {
  const std::string golden = bless(board(10, 0.1), "tiny", "0.9.0");
  EXPECT_THAT(refusal(golden), HasSubstr("is of suite tiny@0.9.0, the run of tiny@1.0.0"));
}

TEST(Golden, RefusesABrokenBaseline) {
  EXPECT_THAT(refusal("{"), HasSubstr("golden baseline: not valid JSON"));
  EXPECT_THAT(refusal("[]"), HasSubstr("expected an object, found array"));
  EXPECT_THAT(refusal(R"({"schema": "duet.golden/2"})"), HasSubstr("expected schema duet.golden/1"));
  const auto with_entries = [](const std::string& entries, const std::string& more = "") {
    return refusal(R"({"schema": "duet.golden/1", "suite": "tiny", "suite_version": "1.0.0", "entries": )" + entries +
                   more + "}");
  };
  EXPECT_THAT(with_entries("[]"), HasSubstr("key 'entries': expected an object"));
  EXPECT_THAT(with_entries("{}", R"(, "entrys": 1)"), HasSubstr("unknown key 'entrys'"));
  EXPECT_THAT(with_entries(R"({"a": 1})"), HasSubstr("a: expected an object of figures"));
  EXPECT_THAT(with_entries(R"({"a": {"jpe": {"value": 1, "atol": 0}}})"), HasSubstr("a: jpe: key 'rtol' is missing"));
  EXPECT_THAT(with_entries(R"({"a": {"jpe": {"value": null, "atol": 0, "rtol": 0}}})"), HasSubstr("key 'value'"));
  EXPECT_THAT(with_entries(R"({"a": {"jpe": {"value": 1, "atol": -1, "rtol": 0}}})"),
              HasSubstr("tolerances of at least 0"));
  EXPECT_THAT(with_entries(R"({"a": {"jpe": {"value": 1, "atol": 0, "rtol": 0, "tol": 0}}})"),
              HasSubstr("unknown key 'tol'"));
}

}  // namespace
}  // namespace duet
