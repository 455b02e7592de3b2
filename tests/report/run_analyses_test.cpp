// The list of analyses: what of it a run has, what a terminal shows.
#include "duet/report/page/run_analyses.h"

#include <gmock/gmock.h>

#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

RunTables tables_of(std::vector<EpisodeRow> rows) { return run_tables(std::move(rows), {}, nullptr); }

std::vector<std::string> names_of(const std::vector<Analysis>& analyses) {
  std::vector<std::string> names;
  for (const Analysis& analysis : analyses) names.push_back(analysis.name);
  return names;
}

std::vector<EpisodeRow> two_engines() {
  std::vector<EpisodeRow> rows;
  for (const char* engine : {"mujoco", "ode"})
    for (const char* perturbation : {"clean", "jitter_1cm"})
      add_episodes({.engine = engine, .policy = "dstar", .perturbation = perturbation, .successes = "1101"}, rows);
  for (EpisodeRow& row : rows) row.metrics = {{"hf_ratio", 0.25}};
  return rows;
}

TEST(RunAnalyses, AreThoseThatTheRowsHaveFiguresOf) {
  EXPECT_THAT(names_of(run_analyses(tables_of(two_engines()))),
              ElementsAre("board", "leaderboard", "engines", "controllers", "policies", "degradation"));
  EXPECT_THAT(names_of(run_analyses(tables_of(two_engines()), Extent::kRun)),
              ElementsAre("board", "leaderboard", "engines", "controllers"));
}

TEST(RunAnalyses, ARunWithoutEpisodesSaysSo) {
  const RunTables nothing = tables_of({});
  const std::vector<Analysis> analyses = run_analyses(nothing);
  EXPECT_THAT(names_of(analyses), ElementsAre("leaderboard"));
  EXPECT_EQ(run_text(analyses), "No episodes.\n");
  EXPECT_EQ(run_screen(nothing, analyses, {"a note"}), "> a note\n\nNo episodes.\n");
}

TEST(RunAnalyses, ATerminalBeginsWithTheBoard) {
  const RunTables tables = tables_of(two_engines());
  const std::string text = run_text(run_analyses(tables));
  EXPECT_THAT(text, testing::StartsWith("### Board\n\nvmc with dstar"));
  EXPECT_LT(text.find("By engine"), text.find("### Success per engine"));
  EXPECT_LT(text.find("### Success per engine"), text.find("### Controllers"));
  EXPECT_THAT(text, Not(HasSubstr("Mean over the episodes that have the metric")));  // of several engines
}

TEST(RunAnalyses, RobotsThatWalkByCommandAreJudgedByNoAct) {
  std::vector<EpisodeRow> rows = two_engines();
  for (EpisodeRow& row : rows) row.task = "walk";
  const RunTables tables = tables_of(rows);
  const std::vector<Analysis> analyses = run_analyses(tables);
  EXPECT_THAT(names_of(analyses), ElementsAre("leaderboard", "engines", "controllers", "walking"));
  const std::string text = run_text(analyses);
  EXPECT_EQ(run_screen(tables, analyses, {}), text);
  EXPECT_THAT(text, AllOf(testing::StartsWith("### Walking by command"), Not(HasSubstr("### Success per engine"))));
}

TEST(RunAnalyses, EachIsFoundByItsName) {
  const RunTables tables = tables_of(two_engines());
  for (const Analysis& analysis : run_analyses(tables))
    EXPECT_EQ(run_analysis(tables, analysis.name).name, analysis.name);
  EXPECT_TRUE(run_analysis(tables, "contacts").empty());
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { run_analysis(tables, "contact"); }),
              HasSubstr("unknown table 'contact': did you mean 'contacts'?"));
}

}  // namespace
}  // namespace duet
