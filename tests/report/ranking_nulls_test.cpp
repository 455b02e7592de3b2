// How often the verdict calls a policy better than its equal. DUET_NULLS: how many experiments are made.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/report/ranking/ranking.h"
#include "duet/statistics/clustered.h"
#include "tests/rows/rows.h"

namespace duet {
namespace {

struct NullExperiment {
  int clips = 1, engines = 1, roles = 1, policies = 2;
  double rate = 0.5;
};

NullExperiment drawn_experiment(Random& random) {
  constexpr double kRates[] = {0.02, 0.2, 0.5, 0.8, 0.95, 1.0};
  return {.clips = 1 + random.below(60),
          .engines = 1 + random.below(5),
          .roles = 1 + random.below(2),
          .policies = 2 + random.below(2),
          .rate = kRates[random.below(6)]};
}

// Policies of equal success on the same clips. A policy does the same on a clip in four of five engines and roles.
std::vector<EpisodeRow> rows_of(const NullExperiment& of, Random& random) {
  constexpr const char* kEngines[] = {"bullet", "dart", "mujoco", "ode", "simbody"};
  constexpr const char* kPolicies[] = {"a", "b", "c"};
  std::vector<EpisodeRow> rows;
  EpisodeRow row = test::episode("a", "hug", 0, true);
  for (int clip = 0; clip < of.clips; ++clip) {
    const double rate = std::clamp(of.rate + random.uniform(-0.3, 0.3), 0.0, 1.0);  // clips are hard or easy for all
    for (int policy = 0; policy < of.policies; ++policy) {
      const bool usual = random.chance(rate);
      for (int role = 0; role < of.roles; ++role) {
        for (int engine = 0; engine < of.engines; ++engine) {
          row.policy = kPolicies[policy];
          row.clip = "hug_" + std::to_string(clip) + (role == 0 ? "" : "-A");
          row.tags = role == 0 ? RowTags() : RowTags(Tags{{std::string(kRecordingTag), "hug_" + std::to_string(clip)}});
          row.engine = kEngines[engine];
          row.success = random.chance(0.8) ? usual : random.chance(rate);
          rows.push_back(row);
        }
      }
    }
  }
  return rows;
}

TEST(BoardVerdict, CallsAnEqualAheadInOneOfTwentyExperimentsAtMost) {
  const char* asked = std::getenv("DUET_NULLS");
  const int count = asked != nullptr ? std::atoi(asked) : 1500;
  ASSERT_GT(count, 0);
  Random random(20261126, 1);
  int ahead = 0, many = 0, significant = 0;
  for (int i = 0; i < count; ++i) {
    const NullExperiment experiment = drawn_experiment(random);
    const Ranking made = rank_policies(rows_of(experiment, random), {});
    for (const std::string& sentence : ranking_verdict(made)) {
      const bool says = sentence.find("is ahead of") != std::string::npos;
      ahead += says ? 1 : 0;
      EXPECT_TRUE(!says || experiment.clips >= kFewestClips) << sentence;
    }
    many += experiment.clips >= kFewestClips ? 1 : 0;
    significant += made.lead->p <= 0.05 ? 1 : 0;
  }
  // The bound holds for those with enough clips, too; three standard deviations of so many experiments above .05 pass.
  const auto most = [](int n) { return 0.05 * n + 3.0 * std::sqrt(0.05 * 0.95 * n); };
  EXPECT_LE(ahead, 0.05 * count);
  EXPECT_LE(ahead, most(many));
  EXPECT_LE(significant, most(count));
  RecordProperty("ahead", ahead);
  RecordProperty("enough_clips", many);
  RecordProperty("p_at_most_0.05", significant);
  std::printf("%d experiments, %d of enough clips: ahead %d, p at most .05 %d\n", count, many, ahead, significant);
}

}  // namespace
}  // namespace duet
