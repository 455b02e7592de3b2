// Every table says of which level its intervals are.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "duet/report/ranking/comparison.h"
#include "duet/report/ranking/policy_table.h"
#include "duet/report/studies/studies.h"
#include "tests/report/policy_rows.h"

namespace duet {
namespace {

using test::add_episodes;
using ::testing::HasSubstr;

// Two policies under two controllers in two engines, clean and perturbed, with the null arm beside them.
std::vector<EpisodeRow> rows() {
  std::vector<EpisodeRow> all;
  for (const char* engine : {"mujoco", "ode"})
    for (const char* controller : {"vmc", "pd"})
      for (const char* perturbation : {"clean", "jitter_1cm", "jitter_5cm"}) {
        for (const char* policy : {"dstar", "replay"})
          add_episodes({.engine = engine,
                        .controller = controller,
                        .policy = policy,
                        .perturbation = perturbation,
                        .successes = policy[0] == 'd' ? "1101" : "1001"},
                       all);
        add_episodes({.engine = engine,
                      .controller = controller,
                      .policy = "null",
                      .perturbation = perturbation,
                      .arm = "null",
                      .successes = "0001"},
                     all);
      }
  for (EpisodeRow& row : all)
    row.metrics = {
        {"hf_ratio", 0.25},    {"hf_ratio_reference", 0.125}, {"dof_jerk", 800.0},  {"dof_jerk_reference", 200.0},
        {"root_jerk", 50.0},   {"root_jerk_reference", 25.0}, {"root_error", 0.25}, {"root_angle_error", 7.5},
        {"dof_error", 0.0625}, {"dof_velocity_error", 0.5}};
  return all;
}

TEST(Notes, EveryTableNamesTheLevelOfItsIntervals) {
  const std::vector<EpisodeRow> all = rows();
  for (const Analysis& analysis : {leaderboard_analysis(leaderboard(all)), controller_analysis(all),
                                   policy_analysis(all, leaderboard(all)), degradation_analysis(all)}) {
    const std::string text = analysis_markdown(analysis);
    EXPECT_THAT(text, HasSubstr("95 %"));
    EXPECT_THAT(text, ::testing::Not(HasSubstr("195 %"))) << text;
  }
}

TEST(Notes, AComparisonNamesTheLevelOfItsIntervals) {
  std::vector<EpisodeRow> a, b;
  add_episodes({.policy = "dstar", .successes = "110111011101"}, a);
  add_episodes({.policy = "replay", .successes = "100110001101"}, b);
  const std::string text = analysis_markdown(comparison_analysis(a, b));
  EXPECT_THAT(text, HasSubstr("95 %"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("195 %")));
}

}  // namespace
}  // namespace duet
