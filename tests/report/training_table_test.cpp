#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/report/studies/studies.h"
#include "duet/statistics/clustered.h"
#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::estimate;
using test::estimates_like;

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
  EXPECT_TRUE(training_analysis(rows).empty());
  for (const char* seed : {"", "x", "-1", "1234567890123456789"}) {
    for (EpisodeRow& row : rows)
      row.tags = RowTags(Tags{{std::string(kMethodTag), "dp"}, {std::string(kTrainingSeedTag), seed}});
    EXPECT_TRUE(training_analysis(rows).empty()) << seed;
  }
}

TEST(TrainingTable, TwoPoliciesOfOneTrainingAreRefused) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows)
    if (row.policy == "dp-seed10")
      row.tags = RowTags(Tags{{std::string(kMethodTag), "dp"}, {std::string(kTrainingSeedTag), "2"}});
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { training_analysis(rows); }));
}

constexpr const char* kAgainst = "dstar vs dp";

Estimate of_difference(const Analysis& analysis, const char* of, const char* name) {
  return estimate(analysis, {.policy = kAgainst, .of = of, .name = name});
}

TEST(TrainingTable, ATrainingIsOneOfItsMethod) {
  const Analysis analysis = training_analysis(two_methods());
  EXPECT_THAT(analysis.tables.at(0).table.rows.at(0).at(1), "2, 10");  // seeds of dp as numbers
  EXPECT_EQ(estimate(analysis, {.policy = "dp", .of = "seed10", .name = "success"}).k, 2);
  EXPECT_DOUBLE_EQ(estimate(analysis, {.policy = "dp", .name = "mean_success"}).value, 0.1875);
  EXPECT_NEAR(estimate(analysis, {.policy = "dp", .name = "success_sd"}).value, 0.125 / std::sqrt(2.0), 1e-12);
}

TEST(TrainingTable, MethodsAreComparedWithTrainingsAndClipsAsRandomEffects) {
  const Analysis analysis = training_analysis(two_methods());
  ASSERT_EQ(analysis.tables.size(), 2U);  // one task, clean: no part of it
  const auto found = [&](const char* name) { return of_difference(analysis, "all", name); };
  EXPECT_EQ(found("clips").value, 8.0);
  const std::vector<int> clip = {0, 1, 2, 3, 4, 5, 6, 7};
  const CrossedDifference expected = crossed_difference({{1, 1, 1, 1, 1, 1, 0, 0}, {1, 1, 1, 1, 1, 1, 1, 0}},
                                                        {{1, 0, 0, 0, 0, 0, 0, 0}, {1, 1, 0, 0, 0, 0, 0, 0}}, clip);
  EXPECT_DOUBLE_EQ(found("p").value, expected.p);
  EXPECT_DOUBLE_EQ(found("difference").interval.low, expected.interval.low);
  EXPECT_DOUBLE_EQ(found("success_a").value - found("success_b").value, expected.difference);
  EXPECT_DOUBLE_EQ(found("p_holm").value, expected.p);  // one line
  EXPECT_EQ(found("verdict").text, "better");
}

TEST(TrainingTable, OnlyEpisodesThatAllHaveCount) {
  std::vector<EpisodeRow> rows = two_methods();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.policy == "dp-seed2" && row.episode == 0; });
  const Analysis analysis = training_analysis(rows);
  EXPECT_EQ(of_difference(analysis, "all", "difference").n, 7);
  EXPECT_EQ(estimate(analysis, {.policy = "dp", .of = "seed10", .name = "success"}).n, 7);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .of = "seed2", .name = "success"}).n, 8);
}

TEST(TrainingTable, PartsAreTasksAndPerturbations) {
  std::vector<EpisodeRow> rows = two_methods();
  for (const char* policy : {"dp-seed2", "dp-seed10", "dstar-seed1", "dstar-seed2"}) {
    add_training(policy, "1010", rows, "wave");
    add_training(policy, "0101", rows, "wave", "level_1_hesitates");
  }
  const Analysis analysis = training_analysis(rows);
  std::vector<std::string> parts;
  for (const Estimate& difference : analysis.estimates)
    if (difference.name == "difference") parts.push_back(difference.of);
  EXPECT_EQ(parts, (std::vector<std::string>{"all", "hug", "wave", "clean", "level_1_hesitates"}));
  EXPECT_EQ(of_difference(analysis, "hug", "difference").n, 8);
  EXPECT_EQ(of_difference(analysis, "wave", "difference").n, 8);
  EXPECT_EQ(of_difference(analysis, "wave", "clips").value, 4.0);  // one clip clean and perturbed is one clip
  EXPECT_EQ(of_difference(analysis, "level_1_hesitates", "difference").n, 4);
  // Holm over the parts alone: the smallest p of four.
  EXPECT_DOUBLE_EQ(of_difference(analysis, "hug", "p_holm").value,
                   std::min(1.0, 4 * of_difference(analysis, "hug", "p").value));
  EXPECT_DOUBLE_EQ(of_difference(analysis, "all", "p_holm").value, of_difference(analysis, "all", "p").value);
}

TEST(TrainingTable, RecordedPeopleAreApartFromSyntheticOnes) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows) {
    if (row.episode >= 4) test::set_tag(row, kPeopleTag, std::string(kSyntheticPeople));
    row.key = episode_key(row);
  }
  const Analysis analysis = training_analysis(rows);
  EXPECT_EQ(analysis.tables.at(1).table.rows.size(), 3U);
  EXPECT_DOUBLE_EQ(of_difference(analysis, "recorded", "success_a").value, 1.0);
  EXPECT_DOUBLE_EQ(of_difference(analysis, "synthetic", "success_a").value, 5.0 / 8.0);
}

TEST(TrainingTable, AClipInBothRolesIsOneClip) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows) {
    const std::string recording = "sbu-hug-" + std::to_string(row.episode / 2);
    row.clip = recording + (row.episode % 2 == 0 ? "" : "-in-the-other-role");
    if (row.clip != recording) test::set_tag(row, kRecordingTag, recording);
    row.key = episode_key(row);
  }
  const Estimate clips = of_difference(training_analysis(rows), "all", "clips");
  EXPECT_EQ(clips.n, 8);
  EXPECT_EQ(clips.value, 4.0);
}

TEST(TrainingTable, OneTrainingSaysNothingOfAMethod) {
  std::vector<EpisodeRow> rows = two_methods();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.policy == "dp-seed2"; });
  const Analysis analysis = training_analysis(rows);
  const auto found = [&](const char* name) { return of_difference(analysis, "all", name); };
  EXPECT_TRUE(std::isnan(found("p").value));
  EXPECT_TRUE(std::isnan(found("p_holm").value));
  EXPECT_EQ(found("verdict").text, "undecided");
  EXPECT_DOUBLE_EQ(found("difference").value, found("success_a").value - found("success_b").value);
  EXPECT_SENTENCE(analysis_markdown(analysis));
}

TEST(TrainingTable, OtherArmsAndOtherPoliciesAreLeftOut) {
  std::vector<EpisodeRow> rows = two_methods();
  const std::string before = analysis_csv(training_analysis(rows));
  add_training("dstar", "00000000", rows);
  test::add_episodes({.policy = "dstar-seed3", .arm = "shuffled", .successes = "0000"}, rows);
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(analysis_csv(training_analysis(rows)), before);
}

TEST(TrainingTable, ControllersAreApart) {
  std::vector<EpisodeRow> rows = two_methods();
  for (EpisodeRow& row : rows) {
    if (row.policy.starts_with("dp")) row.controller = "pd";
    row.key = episode_key(row);
  }
  EXPECT_TRUE(estimates_like(training_analysis(rows), {.of = "all", .name = "difference"}).empty());
}

}  // namespace
}  // namespace duet
