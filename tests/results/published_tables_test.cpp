// The tables of the published rows, figure by figure: results/tables. Where a figure changes on purpose,
// `duet report results/published/policies --format csv -o results/tables/policies` writes them anew.
#include <gtest/gtest.h>

#include <sstream>

#include "duet/core/file.h"
#include "duet/results/analyses/controller_table.h"
#include "duet/results/analyses/cross_engine.h"
#include "duet/results/analyses/leaderboard.h"
#include "duet/results/report/policy_report.h"
#include "duet/results/rows/run_directory.h"

namespace duet {
namespace {

std::string in(const std::string& path) { return std::string(DUET_SOURCE_DIR) + "/results/" + path; }

// Line by line, so that what differs can be read; the file may begin with a note on the run.
void expect_same_lines(const std::string& file, const std::string& text) {
  std::istringstream expected(read_file(in("tables/policies/" + file))), found(text);
  int number = 0;
  for (std::string a, b; std::getline(expected, a);) {
    ++number;
    if (a.starts_with('#')) continue;
    ASSERT_TRUE(std::getline(found, b)) << file << " ends before line " << number;
    ASSERT_EQ(a, b) << file << ", line " << number;
  }
  std::string more;
  EXPECT_FALSE(std::getline(found, more)) << file << ", line " << number << ": " << more;
}

TEST(PublishedTables, AreWhatTheRowsSay) {
  const std::vector<EpisodeRow> rows = load_run(in("published/policies")).rows;
  expect_same_lines("leaderboard.csv", leaderboard_csv(leaderboard(rows)));
  expect_same_lines("engines.csv", cross_engine_csv(cross_engine(rows, {})));
  expect_same_lines("controllers.csv", controller_table_csv(controller_table(rows)));
  const PolicyReport report = policy_report(rows);
  for (const auto& [file, text] : analysis_files(policy_analyses(report), "csv")) expect_same_lines(file, text);
}

}  // namespace
}  // namespace duet
