#include "duet/report/ranking/contact_table.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "tests/report/estimates.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::engine_episode;
using test::estimate;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct Touch {
  const char* region;
  double peak, quasi_static, transient, impulse, pressure, ratio;
};

EpisodeRow touched(const std::string& engine, const std::string& policy, int number,
                   const std::vector<Touch>& touches) {
  EpisodeRow row = engine_episode(engine, policy, number, true);
  row.forces = {{"ground.peak_n", 400.0}, {"human.peak_n", 0.0}, {"human.limits_verified", 0.0}};
  for (const Touch& touch : touches) {
    const std::string prefix = std::string("human.") + touch.region;
    row.forces[prefix + ".peak_n"] = touch.peak;
    row.forces[prefix + ".quasi_static_n"] = touch.quasi_static;
    row.forces[prefix + ".transient_n"] = touch.transient;
    row.forces[prefix + ".settled_n"] = 0.5 * touch.peak;
    row.forces[prefix + ".impulse_ns"] = touch.impulse;
    row.forces[prefix + ".pressure_n_cm2"] = touch.pressure;
    if (std::isfinite(touch.ratio)) row.forces[prefix + ".worst_ratio"] = touch.ratio;
  }
  return row;
}

constexpr double kNoLimit = std::numeric_limits<double>::quiet_NaN();

// Two engines, four episodes each; hand, chest and a shoulder that the limits do not know.
std::vector<EpisodeRow> benchmark() {
  return {touched("mujoco", "replay", 0, {{"hand", 20, 5, 20, 2, 10, 0.25}}),
          touched("mujoco", "replay", 1, {{"hand", 60, 40, 60, 8, 30, 0.5}, {"chest", 150, 90, 140, 30, 80, 1.25}}),
          touched("mujoco", "replay", 2, {{"hand", 30, 8, 25, 3, 12, 0.125}}),
          touched("mujoco", "replay", 3, {}),
          touched("ode", "replay", 0, {{"hand", 25, 6, 25, 2, 15, 0.75}}),
          touched("ode", "replay", 1, {{"shoulder", 8, 0, 8, 0.5, 4, kNoLimit}}),
          touched("ode", "replay", 2, {}),
          touched("ode", "replay", 3, {})};
}

Estimate of_region(const Analysis& analysis, const char* engine, const char* region, const char* name) {
  return estimate(analysis, {.engine = engine, .of = region, .name = name});
}

TEST(ContactTable, IsOfTheLargestOfEachEngineAndRegion) {
  const Analysis analysis = contact_analysis(benchmark());
  const auto hand = [&](const char* name) { return of_region(analysis, "mujoco", "hand", name).value; };
  EXPECT_EQ(of_region(analysis, "mujoco", "hand", "touched").n, 4);
  EXPECT_EQ(hand("touched"), 3.0);
  EXPECT_EQ(hand("over"), 0.0);
  EXPECT_EQ(hand("peak"), 60.0);
  EXPECT_EQ(hand("median_peak"), 30.0);
  EXPECT_EQ(hand("quasi_static"), 40.0);
  EXPECT_EQ(hand("transient"), 60.0);
  EXPECT_EQ(hand("impulse"), 8.0);
  EXPECT_EQ(hand("pressure"), 30.0);
  EXPECT_EQ(hand("ratio"), 0.5);
  EXPECT_EQ(of_region(analysis, "mujoco", "chest", "over").value, 1.0);
  EXPECT_EQ(of_region(analysis, "ode", "chest", "touched").value, 0.0);
  EXPECT_TRUE(std::isnan(of_region(analysis, "ode", "chest", "peak").value));
  EXPECT_TRUE(std::isnan(of_region(analysis, "ode", "shoulder", "ratio").value));
}

TEST(ContactTable, PoolsEnginesAndRegions) {
  const Analysis analysis = contact_analysis(benchmark());
  const auto all = [&](const char* region, const char* name) { return of_region(analysis, "all", region, name).value; };
  EXPECT_EQ(of_region(analysis, "all", "hand", "touched").n, 8);
  EXPECT_EQ(all("hand", "touched"), 4.0);
  EXPECT_EQ(all("hand", "median_peak"), 27.5);  // of 20, 25, 30, 60
  EXPECT_EQ(all("hand", "ratio"), 0.75);
  EXPECT_EQ(all("any", "touched"), 5.0);
  EXPECT_EQ(all("any", "over"), 1.0);
  EXPECT_EQ(all("any", "peak"), 150.0);
  EXPECT_EQ(all("any", "median_peak"), 25.0);  // of 8, 20, 25, 30, 150
  EXPECT_EQ(all("any", "impulse"), 38.0);      // of hand and chest in one episode
  EXPECT_EQ(all("any", "ratio"), 1.25);
}

std::string text_of(const std::vector<EpisodeRow>& rows) { return analysis_markdown(contact_analysis(rows)); }

nlohmann::json json_of(const std::vector<EpisodeRow>& rows) { return analysis_json(contact_analysis(rows)); }

TEST(ContactTable, ListsRegionsFromTheHeadDown) {
  const Analysis analysis = contact_analysis({touched("ode", "replay", 0,
                                                      {{"foot", 1, 0, 1, 1, 1, 0.1},
                                                       {"aura", 1, 0, 1, 1, 1, 0.1},
                                                       {"chest", 1, 0, 1, 1, 1, 0.1},
                                                       {"head", 1, 0, 1, 1, 1, 0.1}})});
  EXPECT_THAT(values_of(analysis.estimates, &Estimate::of),
              testing::ElementsAre("head", "chest", "foot", "aura", "any"));
}

TEST(ContactTable, DoesNotDependOnTheOrderOfRows) {
  std::vector<EpisodeRow> rows = benchmark();
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(json_of(rows), json_of(benchmark()));
}

TEST(ContactTable, LeavesOutPlaybackOtherArmsAndGhosts) {
  std::vector<EpisodeRow> rows = benchmark();
  rows.push_back(touched("playback", "replay", 0, {{"head", 500, 0, 500, 9, 9, 9}}));
  rows.push_back(touched("mujoco", "null", 0, {{"head", 500, 0, 500, 9, 9, 9}}));
  rows.back().arm = "null";
  rows.push_back(engine_episode("bullet", "replay", 0, true));  // ghost
  EXPECT_EQ(json_of(rows), json_of(benchmark()));
  EXPECT_THAT(values_of(contact_analysis(rows, "null").estimates, &Estimate::policy), testing::ElementsAre("null"));
}

TEST(ContactTable, HasAGroupPerControllerAndPolicy) {
  std::vector<EpisodeRow> rows = benchmark();
  rows.push_back(touched("ode", "diffuse", 0, {{"hand", 5, 0, 5, 1, 1, 0.1}}));
  rows.push_back(touched("ode", "replay", 0, {{"hand", 5, 0, 5, 1, 1, 0.1}}));
  rows.back().controller = "twist";
  rows.back().outcome = Outcome::kDiverged;
  std::vector<std::string> groups;
  for (const Estimate& diverged : test::estimates_like(contact_analysis(rows), {.name = "diverged"}))
    groups.push_back(fmt::format("{} {} {}", diverged.controller, diverged.policy, diverged.value));
  EXPECT_THAT(groups, testing::ElementsAre("twist replay 1", "vmc diffuse 0", "vmc replay 0"));
  EXPECT_SENTENCE(text_of(rows));
}

TEST(ContactTable, ALimitOfExactlyOneIsWithin) {
  const std::vector<EpisodeRow> rows = {touched("ode", "replay", 0, {{"hand", 140, 0, 140, 1, 1, 1.0}})};
  EXPECT_EQ(of_region(contact_analysis(rows), "all", "hand", "over").value, 0.0);
  EXPECT_THAT(text_of(rows), HasSubstr("140 (1.00)"));
}

TEST(ContactTable, LimitsAreVerifiedOnlyWhereEveryEpisodeSaysSo) {
  std::vector<EpisodeRow> rows = benchmark();
  const char* unverified = "Limits: unverified (nobody has yet checked the table against ISO/TS 15066)";
  for (EpisodeRow& row : rows) row.forces["human.limits_verified"] = 1.0;
  const Analysis verified = contact_analysis(rows);
  EXPECT_EQ(verified.warning, "");
  EXPECT_SENTENCE(verified.notes.at(0));
  EXPECT_EQ(estimate(verified, {.name = "limits_verified"}).value, 1.0);
  rows[5].forces["human.limits_verified"] = 0.0;
  EXPECT_EQ(contact_analysis(rows).warning, unverified);
  rows[5].forces.erase("human.limits_verified");
  EXPECT_EQ(contact_analysis(rows).warning, unverified);
}

TEST(ContactTable, RefusesTwoSuitesAndAnEpisodeTwice) {
  std::vector<EpisodeRow> rows = benchmark();
  rows.push_back(rows.front());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { contact_analysis(rows); }));
  rows.back().suite_version = "2.0.0";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { contact_analysis(rows); }));
}

TEST(ContactTableMarkdown, IsAsBlessed) {
  EXPECT_EQ(text_of(benchmark()), R"md(### Contact with people

Limits: unverified (nobody has yet checked the table against ISO/TS 15066)

The impulse adds up magnitudes of region forces, so opposite pushes do not cancel; pressure is an estimate from how deep bodies overlap, not a measurement.

Forces, pressure and impulse are the largest of any episode, the median is over the episodes that touched the region. In brackets, and as ratio: the largest of force and pressure over their limits, with an asterisk where a limit is exceeded; without brackets no limit is stated. Over limit: share of all episodes, touched or not. "any" is the whole body; regions that no episode touched are left out.

#### Peak force [N]

Controller vmc, policy replay; 4 episodes in each engine.

| Region   |      mujoco |         ode |
| :------- | ----------: | ----------: |
| chest    | 150 (1.25*) |           - |
| hand     | 60.0 (0.50) | 25.0 (0.75) |
| shoulder |           - |        8.00 |
| any      | 150 (1.25*) | 25.0 (0.75) |

#### All engines together

Controller vmc, policy replay; an episode counts once in each engine.

| Region   | Touched | Over limit [%] | Ratio | Median peak [N] | After 0.1 s [N] | Quasi-static [N] | Transient [N] | Pressure [N/cm^2] | Impulse [N s] |
| :------- | ------: | -------------: | ----: | --------------: | --------------: | ---------------: | ------------: | ----------------: | ------------: |
| chest    |  1 of 8 |           12.5 | 1.25* |             150 |            75.0 |             90.0 |           140 |              80.0 |          30.0 |
| hand     |  4 of 8 |            0.0 |  0.75 |            27.5 |            30.0 |             40.0 |          60.0 |              30.0 |          8.00 |
| shoulder |  1 of 8 |            0.0 |     - |            8.00 |            4.00 |             0.00 |          8.00 |              4.00 |          0.50 |
| any      |  5 of 8 |           12.5 | 1.25* |            25.0 |            75.0 |             90.0 |           140 |              80.0 |          38.0 |
)md");
}

TEST(ContactTableMarkdown, IsOneSentenceWithoutAnyContactForces) {
  EXPECT_EQ(text_of({}), "No episode has contact forces with a solid partner.\n");
  EXPECT_EQ(analysis_latex(contact_analysis({})), "% No episode has contact forces with a solid partner.\n");
}

TEST(ContactTableMarkdown, EpisodesThatTouchNobodyCount) {
  EXPECT_THAT(text_of({touched("ode", "replay", 0, {})}),
              AllOf(HasSubstr("Controller vmc, policy replay; 1 episode."), HasSubstr("| any    |   - |"),
                    HasSubstr("|  0 of 1 |"), Not(HasSubstr("nan"))));
}

TEST(ContactTableMarkdown, UnequalEpisodesAreCountedPerEngine) {
  std::vector<EpisodeRow> rows = benchmark();
  rows.pop_back();
  EXPECT_SENTENCE(text_of(rows));
}

TEST(ContactTableFigures, AreThereForEveryEngineAndForAllOfThem) {
  const Analysis analysis = contact_analysis(benchmark());
  const auto value = [&](const char* engine, const char* region, const char* name) {
    return estimate(analysis, {.engine = engine, .controller = "vmc", .policy = "replay", .of = region, .name = name});
  };
  EXPECT_EQ(value("mujoco", "hand", "touched").value, 3.0);
  EXPECT_EQ(value("mujoco", "hand", "touched").n, 4);
  EXPECT_EQ(value("mujoco", "hand", "median_peak").value, 30.0);
  EXPECT_EQ(value("mujoco", "hand", "median_peak").unit, "N");
  EXPECT_EQ(value("mujoco", "chest", "over").value, 1.0);
  EXPECT_EQ(value("mujoco", "chest", "ratio").value, 1.25);
  EXPECT_TRUE(std::isnan(value("ode", "shoulder", "ratio").value));
  EXPECT_EQ(value("all", "any", "impulse").value, 38.0);
  EXPECT_EQ(value("all", "any", "impulse").unit, "N s");
  EXPECT_EQ(value("all", "any", "touched").n, 8);
  EXPECT_EQ(estimate(analysis, {.name = "diverged"}).value, 0.0);
  EXPECT_EQ(estimate(analysis, {.name = "limits_verified"}).value, 0.0);
}

}  // namespace
}  // namespace duet
