#include "duet/report/ranking/policy_table.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "tests/report/figures.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::figure;
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

std::string text_of(const PolicyTable& table) { return analysis_markdown(policy_analysis(table)); }

const PolicyLine& line_of(const PolicyTable& table, const std::string& policy) {
  for (const PolicyLine& line : table.lines)
    if (line.policy == policy) return line;
  throw std::runtime_error("no line of " + policy);
}

TEST(PolicyTable, CountsSuccessUnderBothDetectorsAndTheLift) {
  const PolicyTable table = policy_table(two_policies());
  ASSERT_EQ(table.lines.size(), 2U);  // the null arm is no policy
  const PolicyFigures& dstar = line_of(table, "dstar").engines.at(0);
  EXPECT_EQ(dstar.success.k, 3);
  EXPECT_LE(dstar.success.interval.low, wilson_of(1.5, 2).low);  // four draws of two clips
  EXPECT_EQ(dstar.paper.k, 1);
  EXPECT_DOUBLE_EQ(dstar.lift.difference, 0.5);
  EXPECT_GE(dstar.lift.interval.high, newcombe_paired(1, 2, 0, 1).high);
  EXPECT_TRUE(std::isnan(dstar.dof_jerk));
  EXPECT_EQ(dstar.violations.n, 0);
}

TEST(PolicyTable, FallsJerkAndContactLimitsAreOfTheEpisodesThatHaveThem) {
  std::vector<EpisodeRow> rows = two_policies();
  rows[0].fell = true;
  rows[0].metrics["dof_jerk"] = 100.0;
  rows[1].metrics["dof_jerk"] = 300.0;
  rows[1].forces = {{"human.chest.peak_n", 200.0}, {"human.chest.worst_ratio", 1.5}};
  rows[2].forces = {{"human.chest.peak_n", 20.0}, {"human.chest.worst_ratio", 0.5}};
  const PolicyTable table = policy_table(rows);
  const PolicyFigures& dstar = line_of(table, "dstar").engines.at(0);
  EXPECT_DOUBLE_EQ(dstar.falls.rate, 0.25);
  EXPECT_DOUBLE_EQ(dstar.dof_jerk, 200.0);
  EXPECT_EQ(dstar.violations.n, 2);
  EXPECT_DOUBLE_EQ(dstar.violations.rate, 0.5);
  EXPECT_THAT(text_of(table), AllOf(HasSubstr("Over a contact limit"), HasSubstr("DOF jerk")));
  EXPECT_THAT(text_of(policy_table(two_policies())),
              AllOf(Not(HasSubstr("Over a contact limit [%]")), Not(HasSubstr("DOF jerk"))));
}

TEST(PolicyTable, PlaybackIsInNoMeanAndTheWorstEngineIsNamed) {
  std::vector<EpisodeRow> rows = two_policies();  // mujoco: 0.75
  add_episodes({.engine = "bullet", .successes = "0010"}, rows);
  add_episodes({.engine = "playback", .successes = "0000"}, rows);
  const PolicyTable table = policy_table(rows);
  const PolicyLine& dstar = line_of(table, "dstar");
  ASSERT_EQ(dstar.engines.size(), 3U);
  EXPECT_EQ(dstar.engines[2].key.engine, "playback");
  const OverEngines over = over_engines(dstar, kPolicyFigures[0]);
  EXPECT_EQ(over.engines, 2);
  EXPECT_DOUBLE_EQ(over.mean, 0.5);
  EXPECT_DOUBLE_EQ(over.range, 0.5);
  EXPECT_EQ(over.worst, "bullet");
  EXPECT_DOUBLE_EQ(dstar.mean_success, 0.5);
  EXPECT_LE(dstar.mean_interval.low, 0.5);
  EXPECT_THAT(text_of(table), AllOf(HasSubstr("| bullet"), HasSubstr("Worst"), HasSubstr("Spread")));
  EXPECT_THAT(text_of(policy_table(two_policies())), Not(HasSubstr("Worst")));
}

TEST(PolicyTable, MoreFallsAreWorse) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.engine = "bullet", .successes = "0010"}, rows);
  rows[0].fell = true;
  const PolicyTable table = policy_table(rows);
  EXPECT_EQ(over_engines(line_of(table, "dstar"), kPolicyFigures[3]).worst, "mujoco");
}

TEST(PolicyTable, EveryPolicyMeetsEveryOtherInsideOneEngineAndController) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.policy = "shown_another", .arm = "shuffled", .successes = "0000"}, rows);
  add_episodes({.controller = "wbc_sim", .policy = "dstar", .successes = "1111"}, rows);
  EXPECT_EQ(policy_table(rows).pairs.at(2).p, 1.0);  // three episodes of one clip are one observation
  EXPECT_DOUBLE_EQ(policy_table(rows).pairs.at(2).p_episodes, 0.25);
  for (EpisodeRow& row : rows) row.clip = "hug-" + std::to_string(row.episode);
  const PolicyTable table = policy_table(rows);
  ASSERT_EQ(table.pairs.size(), 3U);  // of three; the other controller has one policy
  const Comparison& first = table.pairs[0];
  EXPECT_EQ(first.group, "mujoco/vmc: dp vs dstar");
  EXPECT_EQ(first.only_b, 2);
  EXPECT_EQ(first.both, 1);
  EXPECT_DOUBLE_EQ(first.p, 0.5);
  EXPECT_DOUBLE_EQ(first.p_holm, 1.0);
  const Comparison& last = table.pairs[2];
  EXPECT_EQ(last.group, "mujoco/vmc: dstar vs shown_another");
  EXPECT_DOUBLE_EQ(last.p, 0.25);
  EXPECT_DOUBLE_EQ(last.p_holm, 0.75);  // the smallest of three
  EXPECT_GT(last.minimum_detectable, 0.0);
}

TEST(PolicyTable, OnlyCleanEpisodesCount) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.policy = "dstar", .perturbation = "jitter_5cm", .successes = "0000"}, rows);
  EXPECT_EQ(analysis_csv(policy_analysis(policy_table(rows))),
            analysis_csv(policy_analysis(policy_table(two_policies()))));
}

TEST(PolicyTable, APolicyThatCouldNotRunIsNamedAndHasNoFigure) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.policy = "no_language", .successes = "00"}, rows);
  for (std::size_t i = rows.size() - 2; i < rows.size(); ++i) rows[i].outcome = Outcome::kUnsupported;
  const PolicyTable table = policy_table(rows);
  EXPECT_EQ(table.lines.size(), 2U);
  EXPECT_THAT(text_of(table), HasSubstr("no_language could not run (2 episodes)"));
}

TEST(PolicyTable, APolicyThatDiedIsNamedBelowIt) {
  std::vector<EpisodeRow> rows;
  add_episodes({.policy = "mine", .successes = "00"}, rows);
  rows[1].policy_faults = {.late = 0, .invalid = 0, .dead = true, .message = "its process ended with signal 9"};
  rows[1].outcome = Outcome::kError;
  const PolicyTable table = policy_table(rows);
  const std::string note =
      "Policy 'mine' lost plans (in 2 episodes: dead in 1, which are errors and count as failures). The first fault: "
      "its process ended "
      "with signal 9";
  EXPECT_THAT(text_of(table), HasSubstr(note));
  EXPECT_THAT(analysis_json(policy_analysis(table)).at("notes"), testing::Contains(note));
}

TEST(PolicyTable, ThePapersRowsStandUnderThePapersDetectorsAlone) {
  std::vector<EpisodeRow> rows = two_policies();
  add_episodes({.task = "wave", .successes = "11"}, rows);
  const PolicyTable table = policy_table(rows);
  const Analysis analysis = policy_analysis(table);
  const std::vector<TitledTable>& tables = analysis.tables;
  ASSERT_EQ(tables.size(), 4U);
  EXPECT_EQ(tables[1].table.header, (std::vector<std::string>{"Policy", "Overall", "Hug", "Wave"}));
  EXPECT_EQ(tables[1].table.rows.size(), 2U);
  ASSERT_EQ(tables[2].table.rows.size(), 5U);
  EXPECT_EQ(tables[2].table.rows[2], (std::vector<std::string>{"D-STAR (the paper's)", "84.9", "93.3", "96.3"}));
  EXPECT_THAT(text_of(table), HasSubstr("can be held against the paper's figures"));
  EXPECT_EQ(figure(analysis, {.source = "paper", .policy = "D-STAR", .task = "wave", .name = "paper_success"}).value,
            96.3 / 100.0);
}

TEST(PolicyTable, ReplayAloneIsNoExperimentOnPolicies) {
  std::vector<EpisodeRow> rows;
  add_episodes({.policy = "replay"}, rows);
  const PolicyTable table = policy_table(rows);
  EXPECT_TRUE(table.lines.empty());
  EXPECT_EQ(text_of(table), "No policy but replay ran.\n");
  EXPECT_TRUE(policy_analysis(table).empty());
  EXPECT_TRUE(policy_table({}).lines.empty());
}

// Forces are of the episodes that touch; the ground's force on a robot that stands is its weight, on average.
TEST(PolicyTable, HasContactForcesAndStamping) {
  std::vector<EpisodeRow> rows = two_policies();
  for (int i = 0; i < 3; ++i)
    rows[i].forces = {{"human.peak_n", 100.0 * i},
                      {"human.settled_n", 10.0 * i},
                      {"ground.peak_n", 600.0 + 300.0 * i},
                      {"ground.mean_n", 300.0}};
  const Analysis analysis = policy_analysis(policy_table(rows));
  const auto of = [&](const char* name) {
    return figure(analysis, {.engine = "mujoco", .policy = "dstar", .task = "all", .name = name});
  };
  EXPECT_EQ(of("contact_peak").value, 150.0);  // one of the three touches nothing
  EXPECT_EQ(of("contact_peak").unit, "N");
  EXPECT_EQ(of("contact_settled").value, 15.0);
  EXPECT_EQ(of("stamping").value, 3.0);
  EXPECT_THAT(text_of(policy_table(rows)), HasSubstr("Ground force [weight]"));
}

TEST(PolicyTable, FiguresAreOfEnginesOfAllOfThemAndOfPairs) {
  std::vector<EpisodeRow> rows = two_policies();
  for (const EpisodeRow& row : two_policies("bullet")) rows.push_back(row);
  rows[0].success = false;  // 2 of 4 in mujoco
  const Analysis analysis = policy_analysis(policy_table(rows));
  const auto of = [&](const char* engine, const char* name) {
    return figure(analysis, {.engine = engine, .policy = "dstar", .task = "all", .name = name});
  };
  EXPECT_EQ(of("bullet", "success").k, 3);
  EXPECT_EQ(of("bullet", "lift").n, 4);
  EXPECT_EQ(of("bullet", "lift").value, 0.5);
  EXPECT_EQ(of("bullet", "dof_jerk").unit, "rad/s^3");
  EXPECT_TRUE(std::isnan(of("bullet", "dof_jerk").value));
  EXPECT_EQ(of("all", "mean_success").value, 0.625);
  EXPECT_EQ(of("all", "success_range").value, 0.25);
  EXPECT_EQ(of("mujoco", "success_worst").value, 0.5);
  const Figure pair =
      figure(analysis, {.engine = "bullet", .policy = "dp vs dstar", .task = "all", .name = "difference"});
  EXPECT_EQ(pair.value, -0.5);
  EXPECT_EQ(pair.n, 4);
}

TEST(PolicyTable, OrderOfRowsDoesNotMatter) {
  std::vector<EpisodeRow> rows = two_policies();
  const nlohmann::json before = analysis_json(policy_analysis(policy_table(rows)));
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(analysis_json(policy_analysis(policy_table(rows))), before);
}

TEST(PolicyTable, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = two_policies();
  rows.push_back(rows.front());
  EXPECT_THAT(thrown_message<InputError>([&] { policy_table(rows); }), HasSubstr("is there twice"));
}

}  // namespace
}  // namespace duet
