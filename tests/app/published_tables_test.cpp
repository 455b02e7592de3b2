// The tables of the published rows, figure by figure: results/tables. Where a figure changes on purpose,
// `duet report results/published/NAME --format csv -o results/tables/NAME` writes them anew; `arena` is of two runs,
// `arena` and `arena_engines`.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <regex>
#include <set>
#include <sstream>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/execution/missing_tags.h"
#include "duet/report/page/run_analyses.h"
#include "duet/report/studies/studies.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {
namespace {

std::string in(const std::string& path) { return fmt::format("{}/results/{}", DUET_SOURCE_DIR, path); }

// Without the note on the run with which the file may begin.
std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);)
    if (!line.starts_with('#')) lines.push_back(line);
  return lines;
}

// The units of metrics are the catalogue's, which this room does not know: they are as the file has them.
std::vector<MetricColumn> units_in(const std::string& file) {
  std::vector<MetricColumn> columns;
  for (const std::string& line : lines_of(read_file(file))) {
    const auto cells = split(line, ',');
    columns.push_back({.name = std::string(cells[9]), .title = "", .unit = std::string(cells[10]), .direction = ""});
  }
  return columns;
}

// The suite of a published table: what this room does not know of it is as the file has it; the roles are those of the
// registry.
RankingSuite suite_in(const std::string& file) {
  const PolicyRole knows{ArmRole::kOracle, "knows the motion"};
  const PolicyRole scripted{ArmRole::kControl, "scripted"};
  RankingSuite suite{.roles = {{"replay", knows},
                               {"replay+servo", knows},
                               {"replay+servo_wide", knows},
                               {"waiting", scripted},
                               {"waiting+servo_wide", scripted},
                               {"patient+servo_wide", scripted},
                               {"vendor", scripted}}};
  for (const std::string& line : lines_of(read_file(file))) {
    if (line.find(",suite,") == std::string::npos) continue;
    suite.label = line.find('"') != std::string::npos ? line.substr(line.find('"')) : line.substr(line.rfind(',') + 1);
    std::erase_if(suite.label, [](char c) { return c == '"' || c == '\r'; });
  }
  return suite;
}

class PublishedTables : public testing::TestWithParam<const char*> {};

TEST_P(PublishedTables, AreWhatTheRowsSay) {
  const std::string folder = in(std::string("tables/") + GetParam() + "/");
  duet::Run run = load_run(in(std::string("published/") + GetParam()));
  add_missing_tags(run);
  const RunTables tables = run_tables(run.rows, {.all = units_in(folder + "leaderboard.csv"), .drifting = {}}, nullptr,
                                      {}, suite_in(folder + "board.csv"));
  std::set<std::string> written;
  for (const auto& [file, text] : analysis_files(run_analyses(tables), "csv")) {
    written.insert(file);
    const std::vector<std::string> expected = lines_of(read_file(folder + file)), found = lines_of(text);
    ASSERT_EQ(expected.size(), found.size()) << file;
    for (std::size_t i = 0; i < found.size(); ++i) ASSERT_EQ(expected[i], found[i]) << file << ", figure " << i;
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    EXPECT_TRUE(written.contains(entry.path().filename().string())) << entry.path();
}
INSTANTIATE_TEST_SUITE_P(OfRows, PublishedTables,
                         testing::Values("policies", "sealed", "sealed_varied", "interaction", "lead", "real",
                                         "jitter"),
                         [](const auto& info) { return std::string(info.param); });

TEST(PublishedPerception, ItsTableIsWhatTheRowsSay) {
  duet::Run run = load_run(in("published/perception"));
  add_missing_tags(run);
  EXPECT_EQ(lines_of(read_file(in("tables/perception/degradation.csv"))),
            lines_of(analysis_csv(degradation_analysis(run.rows))));
}

// The others of its tables are long, and nothing is quoted from them.
TEST(PublishedArena, ItsBoardsAreWhatTheRowsSay) {
  for (const auto& [table, runs] :
       {std::pair<std::string, std::vector<std::string>>{"arena", {"arena", "arena_engines"}},
        {"arena_arms", {"arena_arms"}}}) {
    std::vector<EpisodeRow> rows;
    for (const std::string& run : runs)
      std::ranges::move(load_run(in("published/" + run)).rows, std::back_inserter(rows));
    EXPECT_EQ(lines_of(read_file(in("tables/" + table + "/arena.csv"))), lines_of(analysis_csv(arena_analysis(rows))))
        << table;
  }
}

// Anybody with the networks can verify and merge the rows from anywhere.
TEST(PublishedSuites, NameNoDescriptorOutOfTheirFolder) {
  const std::regex descriptor("use: \"?([^\",}]+\\.yaml)");
  int found = 0;
  for (const auto& entry : std::filesystem::directory_iterator(in("published"))) {
    if (!entry.is_directory()) continue;
    const std::string suite = read_file((entry.path() / "suite.yaml").string());
    for (std::sregex_iterator at(suite.begin(), suite.end(), descriptor), end; at != end; ++at, ++found)
      EXPECT_TRUE((*at)[1].str().starts_with("inputs/") && std::filesystem::exists(entry.path() / (*at)[1].str()))
          << entry.path() << ": " << (*at)[1];
  }
  EXPECT_GE(found, 5);
}

}  // namespace
}  // namespace duet
