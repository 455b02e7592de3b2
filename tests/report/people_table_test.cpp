#include "duet/report/studies/people_table.h"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/report/figures.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::figure;
using testing::AllOf;
using testing::HasSubstr;

// One episode a clip, a digit each.
void add_people(const std::string& kind, const std::string& task, const std::string& successes,
                std::vector<EpisodeRow>& rows, const std::string& policy = "dstar") {
  for (std::size_t i = 0; i < successes.size(); ++i) {
    EpisodeRow row = test::episode(policy, task, static_cast<int>(i), successes[i] == '1');
    // Each is called as the other kind is.
    row.clip = kind == "synthetic" ? "sbu-" + task + "-" + std::to_string(i)
                                   : "people-" + task + "-s20000-000" + std::to_string(i) + "-tracked";
    test::set_tag(row, kPeopleTag, kind);
    row.fell = successes[i] == '0' && kind == "recorded";
    row.key = episode_key(row);
    rows.push_back(row);
  }
}

std::vector<EpisodeRow> both_kinds() {
  std::vector<EpisodeRow> rows;
  add_people("recorded", "hug", "1000", rows);
  add_people("synthetic", "hug", "1110", rows);
  add_people("recorded", "handshake", "11", rows);
  add_people("synthetic", "handshake", "11", rows);
  add_people("synthetic", "wave", "00", rows);  // no recording of it
  return rows;
}

TEST(PeopleTable, RecordedStandBesideSynthetic) {
  const PeopleTable table = people_table(both_kinds());
  ASSERT_EQ(table.entries.size(), 3U);
  const PeopleEntry& hug = table.entries[0];
  EXPECT_EQ(hug.task, "hug");
  EXPECT_EQ(hug.recorded.success.k, 1);
  EXPECT_EQ(hug.recorded.falls.k, 3);
  EXPECT_EQ(hug.synthetic.success.k, 3);
  EXPECT_EQ(hug.synthetic.falls.k, 0);
  EXPECT_DOUBLE_EQ(hug.difference, -0.5);
  EXPECT_EQ(table.entries[1].task, "handshake");
}

TEST(PeopleTable, OverallIsOfTheTasksThatBothKindsHave) {
  const PeopleTable table = people_table(both_kinds());
  const PeopleEntry& all = table.entries.back();
  EXPECT_EQ(all.task, "all");
  EXPECT_EQ(all.recorded.success.n, 6);
  EXPECT_EQ(all.synthetic.success.n, 6);  // without the waves
  EXPECT_EQ(all.synthetic.success.k, 5);
}

// Newcombe (1998), method 10: 56 of 70 against 48 of 80 is .2 [.0524, .3339].
TEST(PeopleTable, TheIntervalIsNewcombes) {
  std::vector<EpisodeRow> rows;
  add_people("recorded", "hug", std::string(56, '1') + std::string(14, '0'), rows);
  add_people("synthetic", "hug", std::string(48, '1') + std::string(32, '0'), rows);
  const PeopleEntry entry = people_table(rows).entries.at(0);
  constexpr double kPrinted = 5e-5;
  EXPECT_NEAR(entry.difference, 0.2, 1e-12);
  EXPECT_NEAR(entry.interval.low, 0.0524, kPrinted);
  EXPECT_NEAR(entry.interval.high, 0.3339, kPrinted);
}

TEST(PeopleTable, PerturbedAndUnsupportedEpisodesAreLeftOut) {
  std::vector<EpisodeRow> rows = both_kinds();
  rows[0].perturbation = "push";
  rows[1].outcome = Outcome::kUnsupported;
  EXPECT_EQ(people_table(rows).entries.at(0).recorded.success.n, 2);
}

TEST(PeopleTable, OneKindAloneIsNoTable) {
  std::vector<EpisodeRow> rows;
  add_people("recorded", "hug", "1000", rows);
  EXPECT_TRUE(people_table(rows).entries.empty());
  EXPECT_EQ(analysis_markdown(people_analysis(people_table(rows))), "No run with recorded and synthetic people.\n");
  EXPECT_TRUE(people_analysis({}).empty());
}

TEST(PeopleTable, FiguresAreOfBothKindsAndOfTheirDifference) {
  const Analysis analysis = people_analysis(people_table(both_kinds()));
  EXPECT_THAT(analysis_markdown(analysis),
              AllOf(HasSubstr("### Recorded and synthetic people"), HasSubstr("| dstar  | Hug "),
                    HasSubstr("25.0 [4.6, 69.9]"), HasSubstr("The leaderboard counts both kinds together")));
  const Figure difference = figure(analysis, {.policy = "dstar", .task = "hug", .name = "recorded_minus_synthetic"});
  EXPECT_EQ(difference.n, 8);
  EXPECT_EQ(difference.value, -0.5);
  EXPECT_EQ(figure(analysis, {.policy = "dstar", .task = "hug", .of = "recorded", .name = "success"}).k, 1);
}

}  // namespace
}  // namespace duet
