// The table of the rule interaction: who succeeds beside the detectors of before, and what failed episodes lack.
#include "duet/report/studies/studies.h"
#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::estimate;

Verdict ruled(bool success, const NamedFlags& parts, const NamedNumbers& values = {}) {
  Verdict verdict;
  verdict.version = "interaction";
  verdict.thresholds = "act";
  verdict.success = success;
  verdict.parts = parts;
  verdict.values = values;
  return verdict;
}

// Adds episodes of one task whose verdicts of the rule are these.
void add_judged(const std::string& policy, const std::string& task, const std::string& arm, int first,
                const std::vector<Verdict>& verdicts, std::vector<EpisodeRow>& rows) {
  std::string successes;
  for (const Verdict& verdict : verdicts) successes += verdict.success ? '1' : '0';
  const std::size_t begin = rows.size();
  add_episodes({.policy = policy, .arm = arm, .task = task, .successes = successes, .first = first}, rows);
  for (std::size_t i = 0; i < verdicts.size(); ++i) {
    rows[begin + i].verdicts.push_back(verdicts[i]);
    Verdict& before = rows[begin + i].verdicts.emplace_back();
    before.version = "robot";
    before.thresholds = "paper";
    before.success = true;
  }
}

std::vector<EpisodeRow> judged_rows() {
  const Verdict right = ruled(true, {{"act", true}, {"touch", true}, {"reply", true}}, {{"lead_s", -0.2}});
  const Verdict hasty = ruled(false, {{"act", true}, {"touch", false}, {"reply", false}}, {{"lead_s", 0.8}});
  const Verdict idle = ruled(false, {{"act", false}, {"touch", false}, {"reply", true}});
  const Verdict unknown = ruled(false, {{"judged", false}});
  std::vector<EpisodeRow> rows;
  add_judged("omni", "wave", "control", 0, {hasty, hasty, idle, unknown}, rows);
  add_judged("dstar", "wave", "main", 0, {right, right, hasty, idle}, rows);
  add_judged("dstar", "hug", "main", 4, {right, idle}, rows);
  add_judged("null", "wave", "null", 0, {idle, idle, idle, idle}, rows);
  return rows;
}

TEST(InteractionTable, SaysWhichConditionFailedEpisodesLack) {
  const Analysis analysis = interaction_analysis(judged_rows());
  EXPECT_EQ(analysis.estimates.front().policy, "dstar") << "the best arm first";
  EXPECT_EQ(analysis.estimates.front().task, "all");
  EXPECT_EQ(analysis.tables.at(0).table.rows.size(), 3U);
  EXPECT_EQ(analysis.tables.at(1).table.rows.size(), 7U);  // three arms, of each all tasks and every one
  const auto of = [&](const char* policy, const char* part, const char* name) {
    return estimate(analysis, {.policy = policy, .task = "all", .of = part, .name = name});
  };
  EXPECT_EQ(of("dstar", "", "success").k, 3);
  EXPECT_EQ(of("dstar", "", "success").n, 6);
  EXPECT_EQ(of("dstar", "robot/paper", "success").k, 6);
  for (const auto& [part, failed] : {std::pair("act", 2.0), {"touch", 3.0}, {"reply", 1.0}})
    EXPECT_EQ(of("dstar", part, "failed").value, failed) << part;
  EXPECT_EQ(of("dstar", "", "false_starts").n, 4);
  EXPECT_EQ(of("dstar", "", "false_starts").value, 1.0);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .task = "hug", .name = "success"}).k, 1);
  EXPECT_EQ(of("omni", "", "not_judged").value, 1.0);
  EXPECT_EQ(of("omni", "touch", "failed").value, 3.0);
}

TEST(InteractionTable, PrintsAndListsThem) {
  const Analysis analysis = interaction_analysis(judged_rows());
  const std::string text = analysis_markdown(analysis);
  EXPECT_SENTENCE(text);
  EXPECT_EQ(estimate(analysis, {.policy = "omni", .task = "wave", .of = "reply", .name = "failed"}).value, 2.0);
  EXPECT_EQ(estimate(analysis, {.policy = "omni", .task = "wave", .name = "not_judged"}).value, 1.0);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .task = "all", .name = "success"}).k, 3);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .task = "all", .of = "robot/paper", .name = "success"}).k, 6);
}

TEST(InteractionTable, IsOfRunsThatTheRuleJudged) {
  std::vector<EpisodeRow> rows;
  add_episodes({}, rows);
  EXPECT_TRUE(interaction_analysis(rows).empty());
}

}  // namespace
}  // namespace duet
