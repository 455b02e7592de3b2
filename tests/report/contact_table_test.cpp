#include "duet/report/ranking/contact_table.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/report/studies/studies.h"
#include "tests/report/estimates.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::engine_episode;
using test::estimate;
using test::thrown_message;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

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

EpisodeRow controlled(const std::string& engine, const std::string& controller, int number, double hf_ratio) {
  EpisodeRow row = engine_episode(engine, "replay", number, true, controller);
  row.metrics = {{"hf_ratio", hf_ratio},        {"hf_ratio_reference", 0.125}, {"dof_jerk", 800.0},
                 {"dof_jerk_reference", 200.0}, {"root_jerk", 50.0},           {"root_jerk_reference", 25.0},
                 {"root_error", 0.25},          {"root_angle_error", 7.5},     {"dof_error", 0.0625},
                 {"dof_velocity_error", 0.5}};
  return row;
}

std::vector<EpisodeRow> two_controllers() {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 6; ++i) {
    rows.push_back(controlled("mujoco", "vmc", i, 0.25 + 0.0625 * (i % 2)));
    rows.push_back(controlled("bullet", "wbc_sim", i, 0.5));
  }
  return rows;
}

std::string controller_text_of(const std::vector<EpisodeRow>& rows) {
  return analysis_markdown(controller_analysis(rows));
}

Estimate of_controller(const std::vector<EpisodeRow>& rows, const char* controller, const char* name) {
  return estimate(controller_analysis(rows), {.controller = controller, .name = name});
}

TEST(ControllerTable, MeansAreOverEpisodesWithTheirInterval) {
  const std::vector<EpisodeRow> rows = two_controllers();
  const Estimate after = of_controller(rows, "vmc", "hf_ratio");
  EXPECT_EQ(after.engine, "mujoco");
  EXPECT_EQ(after.n, 6);
  EXPECT_DOUBLE_EQ(after.value, 0.28125);
  EXPECT_LE(after.interval.low, after.value);
  EXPECT_GE(after.interval.high, after.value);
  EXPECT_LT(after.interval.low, after.interval.high);
  EXPECT_DOUBLE_EQ(of_controller(rows, "vmc", "hf_ratio_reference").value, 0.125);
  EXPECT_DOUBLE_EQ(of_controller(rows, "wbc_sim", "hf_ratio").interval.high, 0.5);  // all the same: no width
}

TEST(ControllerTable, OneClipHasNoInterval) {
  const std::vector<EpisodeRow> rows = {controlled("mujoco", "vmc", 0, 0.25), controlled("mujoco", "vmc", 1, 0.5)};
  EXPECT_DOUBLE_EQ(of_controller(rows, "vmc", "hf_ratio").value, 0.375);
  EXPECT_TRUE(std::isnan(of_controller(rows, "vmc", "hf_ratio").interval.low));
  EXPECT_THAT(controller_text_of(rows), HasSubstr("    0.375 |"));
}

TEST(ControllerTable, SurvivalCountsEveryOtherEndAsNone) {
  std::vector<EpisodeRow> rows = two_controllers();
  rows[0].outcome = Outcome::kFell;
  rows[2].outcome = Outcome::kDiverged;
  rows[4].outcome = Outcome::kError;
  rows[6].fell = true;  // ended well but on the ground
  const Estimate survival = of_controller(rows, "vmc", "survival");
  EXPECT_EQ(survival.n, 6);
  EXPECT_EQ(survival.k, 2);
  EXPECT_DOUBLE_EQ(survival.interval.low, wilson(2, 6).low);
}

TEST(ControllerTable, FaultsAndSafeStopsAreCounted) {
  std::vector<EpisodeRow> rows = two_controllers();
  rows[0].faults.actions = 3;
  rows[2].faults = {.observations = 40, .actions = 0, .stopped = true};
  EXPECT_EQ(of_controller(rows, "vmc", "faulty").value, 2.0);
  EXPECT_EQ(of_controller(rows, "vmc", "stopped").value, 1.0);
  EXPECT_EQ(of_controller(rows, "wbc_sim", "faulty").value, 0.0);
  EXPECT_THAT(controller_text_of(rows), HasSubstr("2 (1 stopped)"));
}

TEST(ControllerTable, EpisodesThatCouldNotRunAreInNoFigure) {
  std::vector<EpisodeRow> rows = two_controllers();
  for (int i = 0; i < 3; ++i) {
    rows.push_back(engine_episode("mujoco", "replay", i, false, "homie"));
    rows.back().outcome = Outcome::kUnsupported;
  }
  EXPECT_EQ(of_controller(rows, "homie", "survival").n, 0);
  EXPECT_EQ(of_controller(rows, "homie", "unsupported").value, 3.0);
  EXPECT_TRUE(std::isnan(of_controller(rows, "homie", "hf_ratio").value));
  EXPECT_SENTENCE(controller_text_of(rows));
}

TEST(ControllerTable, PlaybackAndOtherArmsAreLeftOut) {
  std::vector<EpisodeRow> rows = {controlled("playback", "vmc", 0, 0.1), controlled("mujoco", "vmc", 0, 0.1)};
  rows.back().arm = "null";
  EXPECT_TRUE(controller_analysis(rows).empty());
  EXPECT_EQ(controller_text_of(rows), "No episode ran under a controller in a physics engine.\n");
  EXPECT_TRUE(controller_analysis({}).empty());
}

TEST(ControllerTable, CleanComesBeforePerturbationsAndTheyAreNamed) {
  std::vector<EpisodeRow> rows = two_controllers();
  EXPECT_THAT(controller_text_of(rows), AllOf(HasSubstr("Perturbation clean."), Not(HasSubstr("| Perturbation |"))));
  EpisodeRow pushed = controlled("bullet", "wbc_sim", 0, 0.75);
  pushed.perturbation = "a_push";
  rows.insert(rows.begin(), pushed);
  EXPECT_THAT(values_of(controller_analysis(rows).estimates, &Estimate::perturbation),
              testing::ElementsAre("clean", "a_push"));
  EXPECT_THAT(controller_text_of(rows), HasSubstr("| Perturbation "));
}

TEST(ControllerTable, ThePapersRowsStandBesideOursAndSaySo) {
  const Analysis analysis = controller_analysis(two_controllers());
  const std::string text = analysis_markdown(analysis);
  EXPECT_THAT(text, AllOf(HasSubstr("the paper's"), HasSubstr("D-STAR"), HasSubstr("another experiment")));
  EXPECT_THAT(text, AllOf(HasSubstr("0.614"), HasSubstr("52.6"), HasSubstr("0.446")));
  const auto printed = [&](const char* policy, const char* controller, const char* name) {
    return estimate(analysis, {.source = "paper", .controller = controller, .policy = policy, .name = name});
  };
  EXPECT_EQ(printed("D-STAR", "WBC-Sim", "hf_ratio").value, 0.614);
  EXPECT_EQ(printed("DP", "WBC-Sim", "dof_jerk_reference").value, 180.0);
  EXPECT_EQ(printed("DP", "TWIST2", "dof_velocity_error").unit, "rad/s");
}

TEST(ControllerTable, FiguresAreOfEachControllerAndEngine) {
  const Analysis analysis = controller_analysis(two_controllers());
  const Estimate ratio =
      estimate(analysis, {.engine = "mujoco", .controller = "vmc", .perturbation = "clean", .name = "hf_ratio"});
  EXPECT_EQ(ratio.n, 6);
  EXPECT_DOUBLE_EQ(ratio.value, 0.28125);
  EXPECT_LT(ratio.interval.low, ratio.interval.high);
  const Estimate survival = estimate(analysis, {.engine = "bullet", .controller = "wbc_sim", .name = "survival"});
  EXPECT_EQ(survival.k, 6);
  EXPECT_DOUBLE_EQ(survival.value, 1.0);
}

TEST(ControllerTable, OrderOfRowsDoesNotMatter) {
  std::vector<EpisodeRow> rows = two_controllers();
  const std::string before = analysis_csv(controller_analysis(rows));
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(analysis_csv(controller_analysis(rows)), before);
}

TEST(ControllerTable, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = two_controllers();
  rows.push_back(rows.front());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { controller_analysis(rows); }));
}

}  // namespace
}  // namespace duet
