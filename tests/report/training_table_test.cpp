#include "duet/report/studies/training_table.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "tests/report/figures.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::figure;
using testing::HasSubstr;

// Each episode is of a clip of its own.
void add_training(const std::string& policy, const std::string& successes, std::vector<EpisodeRow>& rows,
                  const std::string& task = "hug", const std::string& perturbation = "clean") {
  const std::size_t before = rows.size();
  const std::size_t cut = policy.find("-seed");  // the names of these trainings say the same
  Tags tags = {{std::string(kPeopleTag), std::string(kRecordedPeople)}};
  if (cut != std::string::npos)
    tags.insert(
        {{std::string(kMethodTag), policy.substr(0, cut)}, {std::string(kTrainingSeedTag), policy.substr(cut + 5)}});
  test::add_episodes({.policy = policy, .perturbation = perturbation, .task = task, .successes = successes}, rows);
  for (std::size_t i = before; i < rows.size(); ++i) {
    rows[i].clip = "sbu-" + task + "-" + std::to_string(rows[i].episode);
    rows[i].tags = RowTags(tags);
    rows[i].key = episode_key(rows[i]);
  }
}

std::vector<EpisodeRow> two_methods() {
  std::vector<EpisodeRow> rows;
  add_training("dp-seed2", "10000000", rows);
  add_training("dp-seed10", "11000000", rows);
  add_training("dstar-seed1", "11111100", rows);
  add_training("dstar-seed2", "11111110", rows);
  return rows;
}

TEST(TrainingTable, NamesMakeNoTraining) {
  std::vector<EpisodeRow> rows;
  add_training("dp-seed2", "10000000", rows);
  for (EpisodeRow& row : rows) row.tags = {};
  EXPECT_TRUE(training_table(rows).methods.empty());
  for (const char* seed : {"", "x", "-1", "1234567890123456789"}) {
    for (EpisodeRow& row : rows)
      row.tags = RowTags(Tags{{std::string(kMethodTag), "dp"}, {std::string(kTrainingSeedTag), seed}});
    EXPECT_TRUE(training_table(rows).methods.empty()) << seed;
  }
}

TEST(TrainingTable, TwoPoliciesOfOneTrainingAreRefused) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows)
    if (row.policy == "dp-seed10")
      row.tags = RowTags(Tags{{std::string(kMethodTag), "dp"}, {std::string(kTrainingSeedTag), "2"}});
  EXPECT_THAT(test::thrown_message<InputError>([&] { training_table(rows); }),
              testing::AllOf(HasSubstr("'dp' with seed 2"), HasSubstr("'dp-seed10'"), HasSubstr("'dp-seed2'")));
}

TEST(TrainingTable, ATrainingIsOneOfItsMethod) {
  const TrainingTable table = training_table(two_methods());
  ASSERT_EQ(table.methods.size(), 2U);
  const MethodTrainings& dp = table.methods[0];
  EXPECT_EQ(dp.key.policy, "dp");
  EXPECT_EQ(dp.seeds, (std::vector<std::string>{"2", "10"}));  // as numbers
  EXPECT_EQ(dp.success[1].k, 2);
  EXPECT_DOUBLE_EQ(dp.mean, 0.1875);
  EXPECT_NEAR(dp.deviation, 0.125 / std::sqrt(2.0), 1e-12);
}

TEST(TrainingTable, MethodsAreComparedWithTrainingsAndClipsAsRandomEffects) {
  const TrainingTable table = training_table(two_methods());
  ASSERT_EQ(table.differences.size(), 1U);
  const MethodDifference& found = table.differences.front();
  EXPECT_EQ(found.key.policy, "dstar vs dp");
  EXPECT_EQ(found.clips, 8);
  const std::vector<int> clip = {0, 1, 2, 3, 4, 5, 6, 7};
  const CrossedDifference expected = crossed_difference({{1, 1, 1, 1, 1, 1, 0, 0}, {1, 1, 1, 1, 1, 1, 1, 0}},
                                                        {{1, 0, 0, 0, 0, 0, 0, 0}, {1, 1, 0, 0, 0, 0, 0, 0}}, clip);
  EXPECT_DOUBLE_EQ(found.crossed.p, expected.p);
  EXPECT_DOUBLE_EQ(found.crossed.interval.low, expected.interval.low);
  EXPECT_DOUBLE_EQ(found.success_a - found.success_b, expected.difference);
  EXPECT_DOUBLE_EQ(found.p_holm, found.crossed.p);  // one line
  EXPECT_EQ(found.verdict, PairVerdict::kBetter);
  EXPECT_TRUE(table.parts.empty());  // one task, clean: no part of it
}

TEST(TrainingTable, OnlyEpisodesThatAllHaveCount) {
  std::vector<EpisodeRow> rows = two_methods();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.policy == "dp-seed2" && row.episode == 0; });
  const TrainingTable table = training_table(rows);
  EXPECT_EQ(table.differences.front().episodes, 7);
  EXPECT_EQ(table.methods[0].success[1].n, 7);  // of dp; the trainings of dstar have eight
  EXPECT_EQ(table.methods[1].success[1].n, 8);
}

TEST(TrainingTable, PartsAreTasksAndPerturbations) {
  std::vector<EpisodeRow> rows = two_methods();
  for (const char* policy : {"dp-seed2", "dp-seed10", "dstar-seed1", "dstar-seed2"}) {
    add_training(policy, "1010", rows, "wave");
    add_training(policy, "0101", rows, "wave", "level_1_hesitates");
  }
  const TrainingTable table = training_table(rows);
  std::vector<std::string> parts;
  for (const MethodDifference& part : table.parts) parts.push_back(part.of);
  EXPECT_EQ(parts, (std::vector<std::string>{"hug", "wave", "clean", "level_1_hesitates"}));
  EXPECT_EQ(table.parts[0].episodes, 8);
  EXPECT_EQ(table.parts[1].episodes, 8);
  EXPECT_EQ(table.parts[1].clips, 4);  // one clip clean and perturbed is one clip
  EXPECT_EQ(table.parts[3].episodes, 4);
  // Holm over the parts alone: the smallest p of four.
  EXPECT_DOUBLE_EQ(table.parts[0].p_holm, std::min(1.0, 4 * table.parts[0].crossed.p));
  EXPECT_DOUBLE_EQ(table.differences.front().p_holm, table.differences.front().crossed.p);
}

TEST(TrainingTable, RecordedPeopleAreApartFromSyntheticOnes) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows) {
    if (row.episode >= 4) test::set_tag(row, kPeopleTag, std::string(kSyntheticPeople));
    row.key = episode_key(row);
  }
  const TrainingTable table = training_table(rows);
  ASSERT_EQ(table.differences.size(), 3U);
  EXPECT_EQ(table.differences[1].of, "recorded");
  EXPECT_EQ(table.differences[2].of, "synthetic");
  EXPECT_DOUBLE_EQ(table.differences[1].success_a, 1.0);
  EXPECT_DOUBLE_EQ(table.differences[2].success_a, 5.0 / 8.0);
}

TEST(TrainingTable, AClipInBothRolesIsOneClip) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows) {
    const std::string recording = "sbu-hug-" + std::to_string(row.episode / 2);
    row.clip = recording + (row.episode % 2 == 0 ? "" : "-in-the-other-role");
    if (row.clip != recording) test::set_tag(row, kRecordingTag, recording);
    row.key = episode_key(row);
  }
  const MethodDifference found = training_table(rows).differences.front();
  EXPECT_EQ(found.episodes, 8);
  EXPECT_EQ(found.clips, 4);
}

TEST(TrainingTable, OneTrainingSaysNothingOfAMethod) {
  std::vector<EpisodeRow> rows = two_methods();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.policy == "dp-seed2"; });
  const MethodDifference found = training_table(rows).differences.front();
  EXPECT_TRUE(std::isnan(found.crossed.p));
  EXPECT_EQ(found.verdict, PairVerdict::kUndecided);
  EXPECT_DOUBLE_EQ(found.crossed.difference, found.success_a - found.success_b);
  const Analysis analysis = training_analysis(training_table(rows));
  EXPECT_THAT(analysis_markdown(analysis), HasSubstr("Without two trainings of each method nothing is said"));
}

TEST(TrainingTable, OtherArmsAndOtherPoliciesAreLeftOut) {
  std::vector<EpisodeRow> rows = two_methods();
  const TrainingTable before = training_table(rows);
  add_training("dstar", "00000000", rows);
  test::add_episodes({.policy = "dstar-seed3", .arm = "shuffled", .successes = "0000"}, rows);
  std::reverse(rows.begin(), rows.end());
  const TrainingTable after = training_table(rows);
  ASSERT_EQ(after.methods.size(), 2U);
  EXPECT_EQ(after.differences.front().crossed.p, before.differences.front().crossed.p);
}

TEST(TrainingTable, ControllersAreApart) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows) {
    if (row.policy.starts_with("dp")) row.controller = "pd";
    row.key = episode_key(row);
  }
  EXPECT_TRUE(training_table(rows).differences.empty());
}

TEST(TrainingAnalysis, FiguresAreThoseOfTheTable) {
  const TrainingTable table = training_table(two_methods());
  const Analysis analysis = training_analysis(table);
  EXPECT_DOUBLE_EQ(figure(analysis, {.policy = "dp", .name = "mean_success"}).value, 0.1875);
  EXPECT_EQ(figure(analysis, {.policy = "dp", .of = "seed10", .name = "success"}).k, 2);
  EXPECT_DOUBLE_EQ(figure(analysis, {.policy = "dstar vs dp", .of = "all", .name = "p"}).value,
                   table.differences.front().crossed.p);
  EXPECT_EQ(figure(analysis, {.policy = "dstar vs dp", .of = "all", .name = "verdict"}).text, "better");
  EXPECT_TRUE(training_analysis(training_table({})).empty());
}

}  // namespace
}  // namespace duet
