#include "duet/report/ranking/policy_table.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::estimate;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// Two policies and the null arm in one engine: 3 of 4, 1 of 4, 1 of 4.
std::vector<EpisodeRow> two_policies(const std::string& engine = "mujoco") {
  std::vector<EpisodeRow> rows;
  add_episodes({.engine = engine, .policy = "dstar", .successes = "1110"}, rows);
  add_episodes({.engine = engine, .policy = "dp", .successes = "1000"}, rows);
  add_episodes({.engine = engine, .policy = "null", .arm = "null", .successes = "1000"}, rows);
  return rows;
}

Analysis policies(const std::vector<EpisodeRow>& rows) { return policy_analysis(rows, leaderboard(rows)); }

std::string text_of(const std::vector<EpisodeRow>& rows) { return analysis_markdown(policies(rows)); }

Estimate of_dstar(const std::vector<EpisodeRow>& rows, const char* name, const char* engine = "") {
  return estimate(policies(rows), {.engine = engine, .policy = "dstar", .task = "all", .name = name});
}

TEST(PolicyTable, CountsSuccessUnderBothDetectorsAndTheLift) {
  const std::vector<EpisodeRow> rows = two_policies();
  EXPECT_EQ(policies(rows).tables.at(0).table.rows.size(), 2U);  // the null arm is no policy
  EXPECT_EQ(of_dstar(rows, "success").k, 3);
  EXPECT_LE(of_dstar(rows, "success").interval.low, wilson_of(1.5, 2).low);  // four draws of two clips
  EXPECT_EQ(of_dstar(rows, "paper_success").k, 1);
  EXPECT_DOUBLE_EQ(of_dstar(rows, "lift").value, 0.5);
  EXPECT_GE(of_dstar(rows, "lift").interval.high, newcombe_paired(1, 2, 0, 1).high);
  EXPECT_TRUE(std::isnan(of_dstar(rows, "dof_jerk").value));
  EXPECT_EQ(of_dstar(rows, "violations").n, 0);
}

TEST(PolicyTable, FallsJerkAndContactLimitsAreOfTheEpisodesThatHaveThem) {
  std::vector<EpisodeRow> rows = two_policies();
  rows[0].fell = true;
  rows[0].metrics["dof_jerk"] = 100.0;
  rows[1].metrics["dof_jerk"] = 300.0;
  rows[1].forces = {{"human.chest.peak_n", 200.0}, {"human.chest.worst_ratio", 1.5}};
  rows[2].forces = {{"human.chest.peak_n", 20.0}, {"human.chest.worst_ratio", 0.5}};
  EXPECT_DOUBLE_EQ(of_dstar(rows, "falls").value, 0.25);
  EXPECT_DOUBLE_EQ(of_dstar(rows, "dof_jerk").value, 200.0);
  EXPECT_EQ(of_dstar(rows, "violations").n, 2);
  EXPECT_DOUBLE_EQ(of_dstar(rows, "violations").value, 0.5);
  EXPECT_SENTENCE(text_of(rows));
  EXPECT_THAT(text_of(two_policies()), AllOf(Not(HasSubstr("Over a contact limit [%]")), Not(HasSubstr("DOF jerk"))));
}

TEST(PolicyTable, PlaybackIsInNoMeanAndTheWorstEngineIsNamed) {
  std::vector<EpisodeRow> rows = two_policies();  // mujoco: 0.75
  add_episodes({.engine = "bullet", .successes = "0010"}, rows);
  add_episodes({.engine = "playback", .successes = "0000"}, rows);
  const std::vector<std::string> header = policies(rows).tables.at(0).table.header;
  EXPECT_EQ(header, (std::vector<std::string>{"Policy", "bullet", "mujoco", "playback", "Mean", "Spread", "Worst"}));
  EXPECT_EQ(of_dstar(rows, "success_mean").n, 2);
  EXPECT_DOUBLE_EQ(of_dstar(rows, "success_mean").value, 0.5);
  EXPECT_DOUBLE_EQ(of_dstar(rows, "success_range").value, 0.5);
  EXPECT_EQ(of_dstar(rows, "success_worst").engine, "bullet");
  EXPECT_DOUBLE_EQ(of_dstar(rows, "mean_success").value, 0.5);
  EXPECT_LE(of_dstar(rows, "mean_success").interval.low, 0.5);
  EXPECT_THAT(text_of(rows), AllOf(HasSubstr("| bullet"), HasSubstr("Worst"), HasSubstr("Spread")));
  EXPECT_THAT(text_of(two_policies()), Not(HasSubstr("Worst")));
}

TEST(PolicyTable, MoreFallsAreWorse) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.engine = "bullet", .successes = "0010"}, rows);
  rows[0].fell = true;
  EXPECT_EQ(of_dstar(rows, "falls_worst").engine, "mujoco");
}

TEST(PolicyTable, EveryPolicyMeetsEveryOtherInsideOneEngineAndController) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.policy = "shown_another", .arm = "shuffled", .successes = "0000"}, rows);
  add_episodes({.controller = "wbc_sim", .policy = "dstar", .successes = "1111"}, rows);
  const auto of_pair = [&](const char* policies_of_it, const char* name) {
    return estimate(policies(rows), {.policy = policies_of_it, .name = name}).value;
  };
  EXPECT_EQ(of_pair("dstar vs shown_another", "p"), 1.0);  // three episodes of one clip are one observation
  EXPECT_DOUBLE_EQ(of_pair("dstar vs shown_another", "p_episodes"), 0.25);
  for (EpisodeRow& row : rows) row.clip = "hug-" + std::to_string(row.episode);
  const TextTable pairs = policies(rows).tables.back().table;
  ASSERT_EQ(pairs.rows.size(), 3U);  // of three; the other controller has one policy
  EXPECT_EQ(pairs.rows[0].front(), "mujoco/vmc: dp vs dstar");
  EXPECT_EQ(pairs.rows[2].front(), "mujoco/vmc: dstar vs shown_another");
  EXPECT_EQ(of_pair("dp vs dstar", "only_b"), 2.0);
  EXPECT_EQ(of_pair("dp vs dstar", "both"), 1.0);
  EXPECT_DOUBLE_EQ(of_pair("dp vs dstar", "p"), 0.5);
  EXPECT_DOUBLE_EQ(of_pair("dp vs dstar", "p_holm"), 1.0);
  EXPECT_DOUBLE_EQ(of_pair("dstar vs shown_another", "p"), 0.25);
  EXPECT_DOUBLE_EQ(of_pair("dstar vs shown_another", "p_holm"), 0.75);  // the smallest of three
  EXPECT_GT(of_pair("dstar vs shown_another", "minimum_detectable"), 0.0);
}

TEST(PolicyTable, OnlyCleanEpisodesCount) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.policy = "dstar", .perturbation = "jitter_5cm", .successes = "0000"}, rows);
  EXPECT_EQ(analysis_csv(policies(rows)), analysis_csv(policies(two_policies())));
}

TEST(PolicyTable, APolicyThatCouldNotRunIsNamedAndHasNoFigure) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.policy = "no_language", .successes = "00"}, rows);
  for (std::size_t i = rows.size() - 2; i < rows.size(); ++i) rows[i].outcome = Outcome::kUnsupported;
  EXPECT_TRUE(test::estimates_like(policies(rows), {.policy = "no_language", .name = "success"}).empty());
  EXPECT_SENTENCE(text_of(rows));
}

TEST(PolicyTable, APolicyThatDiedIsNamedBelowIt) {
  std::vector<EpisodeRow> rows;
  add_episodes({.policy = "mine", .successes = "00"}, rows);
  rows[1].policy_faults = {.late = 0, .invalid = 0, .dead = true, .message = "its process ended with signal 9"};
  rows[1].outcome = Outcome::kError;
  const std::string note =
      "Policy 'mine' lost plans (in 2 episodes: dead in 1, which are errors and count as failures). The first fault: "
      "its process ended "
      "with signal 9";
  EXPECT_THAT(text_of(rows), HasSubstr(note));
  EXPECT_THAT(analysis_json(policies(rows)).at("notes"), testing::Contains(note));
}

TEST(PolicyTable, ThePapersRowsStandUnderThePapersDetectorsAlone) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.task = "wave", .successes = "11"}, rows);
  const Analysis analysis = policies(rows);
  const std::vector<TitledTable>& tables = analysis.tables;
  ASSERT_EQ(tables.size(), 4U);
  EXPECT_EQ(tables[1].table.header, (std::vector<std::string>{"Policy", "Overall", "Hug", "Wave"}));
  EXPECT_EQ(tables[1].table.rows.size(), 2U);
  ASSERT_EQ(tables[2].table.rows.size(), 5U);
  EXPECT_EQ(tables[2].table.rows[2], (std::vector<std::string>{"D-STAR (the paper's)", "84.9", "93.3", "96.3"}));
  EXPECT_SENTENCE(text_of(rows));
  EXPECT_EQ(estimate(analysis, {.source = "paper", .policy = "D-STAR", .task = "wave", .name = "paper_success"}).value,
            96.3 / 100.0);
}

TEST(PolicyTable, ReplayAloneIsNoExperimentOnPolicies) {
  std::vector<EpisodeRow> rows;
  add_episodes({.policy = "replay"}, rows);
  EXPECT_EQ(text_of(rows), "No policy but replay ran.\n");
  EXPECT_TRUE(policies(rows).empty());
  EXPECT_TRUE(policies({}).empty());
}

// Forces are of the episodes that touch; the ground's force on a robot that stands is its weight, on average.
TEST(PolicyTable, HasContactForcesAndStamping) {
  std::vector<EpisodeRow> rows = two_policies();
  for (int i = 0; i < 3; ++i)
    rows[i].forces = {{"human.peak_n", 100.0 * i},
                      {"human.settled_n", 10.0 * i},
                      {"ground.peak_n", 600.0 + 300.0 * i},
                      {"ground.mean_n", 300.0}};
  const Analysis analysis = policies(rows);
  const auto of = [&](const char* name) {
    return estimate(analysis, {.engine = "mujoco", .policy = "dstar", .task = "all", .name = name});
  };
  EXPECT_EQ(of("contact_peak").value, 150.0);  // one of the three touches nothing
  EXPECT_EQ(of("contact_peak").unit, "N");
  EXPECT_EQ(of("contact_settled").value, 15.0);
  EXPECT_EQ(of("stamping").value, 3.0);
  EXPECT_SENTENCE(text_of(rows));
}

TEST(PolicyTable, FiguresAreOfEnginesOfAllOfThemAndOfPairs) {
  std::vector<EpisodeRow> rows = two_policies();
  for (const EpisodeRow& row : two_policies("bullet")) rows.push_back(row);
  rows[0].success = false;  // 2 of 4 in mujoco
  const Analysis analysis = policies(rows);
  const auto of = [&](const char* engine, const char* name) {
    return estimate(analysis, {.engine = engine, .policy = "dstar", .task = "all", .name = name});
  };
  EXPECT_EQ(of("bullet", "success").k, 3);
  EXPECT_EQ(of("bullet", "lift").n, 4);
  EXPECT_EQ(of("bullet", "lift").value, 0.5);
  EXPECT_EQ(of("bullet", "dof_jerk").unit, "rad/s^3");
  EXPECT_TRUE(std::isnan(of("bullet", "dof_jerk").value));
  EXPECT_EQ(of("all", "mean_success").value, 0.625);
  EXPECT_EQ(of("all", "success_range").value, 0.25);
  EXPECT_EQ(of("mujoco", "success_worst").value, 0.5);
  const Estimate pair =
      estimate(analysis, {.engine = "bullet", .policy = "dp vs dstar", .task = "all", .name = "difference"});
  EXPECT_EQ(pair.value, -0.5);
  EXPECT_EQ(pair.n, 4);
}

TEST(PolicyTable, OrderOfRowsDoesNotMatter) {
  std::vector<EpisodeRow> rows = two_policies();
  const nlohmann::json before = analysis_json(policies(rows));
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(analysis_json(policies(rows)), before);
}

TEST(PolicyTable, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = two_policies();
  rows.push_back(rows.front());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { policies(rows); }));
}

}  // namespace
}  // namespace duet
