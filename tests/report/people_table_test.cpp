#include <gmock/gmock.h>

#include <cmath>

#include "duet/report/studies/studies.h"
#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::estimate;
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
  const Analysis analysis = people_analysis(both_kinds());
  const auto of_hugs = [&](const char* people, const char* name) {
    return estimate(analysis, {.task = "hug", .of = people, .name = name});
  };
  EXPECT_EQ(of_hugs("recorded", "success").k, 1);
  EXPECT_EQ(of_hugs("recorded", "falls").k, 3);
  EXPECT_EQ(of_hugs("synthetic", "success").k, 3);
  EXPECT_EQ(of_hugs("synthetic", "falls").k, 0);
  EXPECT_DOUBLE_EQ(of_hugs("", "recorded_minus_synthetic").value, -0.5);
  EXPECT_EQ(of_hugs("", "recorded_minus_synthetic").n, 8);
  EXPECT_THAT(values_of(analysis.estimates, &Estimate::task), testing::ElementsAre("hug", "handshake", "all"));
}

TEST(PeopleTable, OverallIsOfTheTasksThatBothKindsHave) {
  const Analysis analysis = people_analysis(both_kinds());
  EXPECT_EQ(estimate(analysis, {.task = "all", .of = "recorded", .name = "success"}).n, 6);
  const Estimate synthetic = estimate(analysis, {.task = "all", .of = "synthetic", .name = "success"});
  EXPECT_EQ(synthetic.n, 6);  // without the waves
  EXPECT_EQ(synthetic.k, 5);
}

// Newcombe (1998), method 10: 56 of 70 against 48 of 80 is .2 [.0524, .3339].
TEST(PeopleTable, TheIntervalIsNewcombes) {
  std::vector<EpisodeRow> rows;
  add_people("recorded", "hug", std::string(56, '1') + std::string(14, '0'), rows);
  add_people("synthetic", "hug", std::string(48, '1') + std::string(32, '0'), rows);
  const Estimate difference = estimate(people_analysis(rows), {.task = "hug", .name = "recorded_minus_synthetic"});
  constexpr double kPrinted = 5e-5;
  EXPECT_NEAR(difference.value, 0.2, 1e-12);
  EXPECT_NEAR(difference.interval.low, 0.0524, kPrinted);
  EXPECT_NEAR(difference.interval.high, 0.3339, kPrinted);
}

// Four draws of the same clips that all end alike tell no more than one.
TEST(PeopleTable, DrawsOfAClipAreNoOtherClips) {
  std::vector<EpisodeRow> rows = both_kinds();
  const Estimate once = estimate(people_analysis(rows), {.task = "hug", .of = "recorded", .name = "success"});
  const std::size_t one_draw = rows.size();
  for (int draw = 1; draw < 4; ++draw)
    for (std::size_t i = 0; i < one_draw; ++i) {
      EpisodeRow row = rows[i];
      row.episode += 10 * draw;
      row.key = episode_key(row);
      rows.push_back(row);
    }
  const Estimate often = estimate(people_analysis(rows), {.task = "hug", .of = "recorded", .name = "success"});
  EXPECT_EQ(often.n, 16);
  EXPECT_DOUBLE_EQ(often.value, once.value);
  EXPECT_NEAR(often.interval.low, once.interval.low, 1e-12);
  EXPECT_NEAR(often.interval.high, once.interval.high, 1e-12);
}

TEST(PeopleTable, PerturbedAndUnsupportedEpisodesAreLeftOut) {
  std::vector<EpisodeRow> rows = both_kinds();
  rows[0].perturbation = "push";
  rows[1].outcome = Outcome::kUnsupported;
  EXPECT_EQ(estimate(people_analysis(rows), {.task = "hug", .of = "recorded", .name = "success"}).n, 2);
}

TEST(PeopleTable, OneKindAloneIsNoTable) {
  std::vector<EpisodeRow> rows;
  add_people("recorded", "hug", "1000", rows);
  EXPECT_EQ(analysis_markdown(people_analysis(rows)), "No run with recorded and synthetic people.\n");
  EXPECT_TRUE(people_analysis(rows).empty());
  EXPECT_TRUE(people_analysis({}).empty());
}

TEST(PeopleTable, ShowsBothKindsAndTheirDifference) {
  EXPECT_THAT(analysis_markdown(people_analysis(both_kinds())),
              AllOf(HasSubstr("### Recorded and synthetic people"), HasSubstr("| dstar  | Hug "),
                    HasSubstr("25.0 [4.6, 69.9]"), HasSubstr("The leaderboard counts both kinds together")));
}

}  // namespace
}  // namespace duet
