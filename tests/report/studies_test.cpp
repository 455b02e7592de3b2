#include "duet/report/studies/studies.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>

#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::estimate;
using test::estimates_like;
using ::testing::_;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

TEST(PeopleTable, ANoteCountsTheRecordedClipsOfWhichSomethingIsMadeUp) {
  std::vector<EpisodeRow> rows = both_kinds();
  EXPECT_EQ(people_analysis(rows).tables.front().notes.size(), 1U);
  for (const std::size_t i : {0U, 1U}) test::set_tag(rows[i], kMadeUpTag, i == 0 ? "gaps+legs" : "legs");
  EXPECT_THAT(people_analysis(rows).tables.front().notes,
              ElementsAre(_, "Made up in 1 of 6 recorded clips: gaps.", "Made up in 2 of 6 recorded clips: legs."));
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

// The table of the rule interaction: who succeeds beside the detectors of before, and what failed episodes lack.

Verdict ruled(bool success, const NamedFlags& parts, const NamedNumbers& values = {}) {
  Verdict verdict;
  verdict.version = "interaction";
  verdict.thresholds = "act";
  verdict.success = success;
  verdict.parts = parts;
  verdict.values = values;
  return verdict;
}

// Adds episodes of one task whose verdicts of the rule are these.
void add_judged(const std::string& policy, const std::string& task, const std::string& arm, int first,
                const std::vector<Verdict>& verdicts, std::vector<EpisodeRow>& rows) {
  std::string successes;
  for (const Verdict& verdict : verdicts) successes += verdict.success ? '1' : '0';
  const std::size_t begin = rows.size();
  add_episodes({.policy = policy, .arm = arm, .task = task, .successes = successes, .first = first}, rows);
  for (std::size_t i = 0; i < verdicts.size(); ++i) {
    rows[begin + i].verdicts.push_back(verdicts[i]);
    Verdict& before = rows[begin + i].verdicts.emplace_back();
    before.version = "robot";
    before.thresholds = "paper";
    before.success = true;
  }
}

std::vector<EpisodeRow> judged_rows() {
  const Verdict right = ruled(true, {{"act", true}, {"touch", true}, {"reply", true}}, {{"lead_s", -0.2}});
  const Verdict hasty = ruled(false, {{"act", true}, {"touch", false}, {"reply", false}}, {{"lead_s", 0.8}});
  const Verdict idle = ruled(false, {{"act", false}, {"touch", false}, {"reply", true}});
  const Verdict unknown = ruled(false, {{"judged", false}});
  std::vector<EpisodeRow> rows;
  add_judged("omni", "wave", "control", 0, {hasty, hasty, idle, unknown}, rows);
  add_judged("dstar", "wave", "main", 0, {right, right, hasty, idle}, rows);
  add_judged("dstar", "hug", "main", 4, {right, idle}, rows);
  add_judged("null", "wave", "null", 0, {idle, idle, idle, idle}, rows);
  return rows;
}

TEST(InteractionTable, SaysWhichConditionFailedEpisodesLack) {
  const Analysis analysis = interaction_analysis(judged_rows());
  EXPECT_EQ(analysis.estimates.front().policy, "dstar") << "the best arm first";
  EXPECT_EQ(analysis.estimates.front().task, "all");
  EXPECT_EQ(analysis.tables.at(0).table.rows.size(), 3U);
  EXPECT_EQ(analysis.tables.at(1).table.rows.size(), 7U);  // three arms, of each all tasks and every one
  const auto of = [&](const char* policy, const char* part, const char* name) {
    return estimate(analysis, {.policy = policy, .task = "all", .of = part, .name = name});
  };
  EXPECT_EQ(of("dstar", "", "success").k, 3);
  EXPECT_EQ(of("dstar", "", "success").n, 6);
  EXPECT_EQ(of("dstar", "robot/paper", "success").k, 6);
  for (const auto& [part, failed] : {std::pair("act", 2.0), {"touch", 3.0}, {"reply", 1.0}})
    EXPECT_EQ(of("dstar", part, "failed").value, failed) << part;
  EXPECT_EQ(of("dstar", "", "false_starts").n, 4);
  EXPECT_EQ(of("dstar", "", "false_starts").value, 1.0);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .task = "hug", .name = "success"}).k, 1);
  EXPECT_EQ(of("omni", "", "not_judged").value, 1.0);
  EXPECT_EQ(of("omni", "touch", "failed").value, 3.0);
}

TEST(InteractionTable, PrintsAndListsThem) {
  const Analysis analysis = interaction_analysis(judged_rows());
  const std::string text = analysis_markdown(analysis);
  EXPECT_SENTENCE(text);
  EXPECT_EQ(estimate(analysis, {.policy = "omni", .task = "wave", .of = "reply", .name = "failed"}).value, 2.0);
  EXPECT_EQ(estimate(analysis, {.policy = "omni", .task = "wave", .name = "not_judged"}).value, 1.0);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .task = "all", .name = "success"}).k, 3);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .task = "all", .of = "robot/paper", .name = "success"}).k, 6);
}

TEST(InteractionTable, IsOfRunsThatTheRuleJudged) {
  std::vector<EpisodeRow> rows;
  add_episodes({}, rows);
  EXPECT_TRUE(interaction_analysis(rows).empty());
}

struct RungRows {
  std::string controller, successes;
  int rung = 1;
  std::string name = "stands", actuation = "implicit";
  Tags more = {};
};

// Adds the rows and gives the place of the first.
std::size_t add(const RungRows& of, std::vector<EpisodeRow>& rows) {
  const std::size_t first = rows.size();
  Tags tags = {
      {"clip.rung", std::to_string(of.rung)}, {"clip.rung_name", of.name}, {"perturbation.actuation", of.actuation}};
  tags.merge(Tags(of.more));
  add_episodes({.policy = "velocity", .perturbation = "calm_" + of.actuation, .successes = of.successes, .tags = tags},
               rows);
  for (std::size_t i = first; i < rows.size(); ++i) {
    rows[i].controller = of.controller;
    rows[i].clip = of.name;
    rows[i].key = episode_key(rows[i]);
  }
  return first;
}

const std::string kAll(12, '1');  // a lower end of 76 %

TEST(Arena, RanksByTheRungThatALowerBoundSupports) {
  std::vector<EpisodeRow> rows;
  add({.controller = "a", .successes = kAll}, rows);
  add({.controller = "a", .successes = "111111111110", .rung = 2, .name = "walks"}, rows);  // 11 of 12: from 65 %
  add({.controller = "a", .successes = kAll, .rung = 3, .name = "pushed"}, rows);
  add({.controller = "b", .successes = kAll}, rows);
  add({.controller = "b", .successes = kAll, .rung = 2, .name = "walks"}, rows);
  add({.controller = "b", .successes = "0000", .rung = 3, .name = "pushed"}, rows);
  add({.controller = "c", .successes = "0"}, rows);
  const Analysis analysis = arena_analysis(rows);
  ASSERT_EQ(analysis.tables.size(), 1U);
  const TextTable& table = analysis.tables[0].table;
  EXPECT_THAT(table.header, ElementsAre("Engine", "Actuation", "Controller", "Reached", "Fails first at", "1 stands",
                                        "2 walks", "3 pushed", "Mean [%]"));
  ASSERT_EQ(table.rows.size(), 3U);
  EXPECT_THAT(table.rows[0],
              ElementsAre("mujoco", "implicit", "b", "2", HasSubstr("3 pushed: "), "12/12", "12/12", "0/4", "66.7"));
  EXPECT_THAT(table.rows[1],
              ElementsAre("mujoco", "implicit", "a", "1", HasSubstr("2 walks: "), "12/12", "11/12", "12/12", "97.2"));
  EXPECT_THAT(table.rows[2],
              ElementsAre("mujoco", "implicit", "c", "none", HasSubstr("1 stands: "), "0/1", "-", "-", "0.0"));
  EXPECT_EQ(estimate(analysis, {.controller = "a", .of = "rung", .name = "passed"}).value, 2.0);
  EXPECT_TRUE(estimates_like(analysis, {.controller = "c", .of = "rung", .name = "reached"}).empty());
}

TEST(Arena, SaysHowAControllerFailsFirst) {
  const Tags arms = {{"clip.arms", "followed"}};
  std::vector<EpisodeRow> rows;
  for (std::size_t i = add({.controller = "falls", .successes = "000"}, rows); i < rows.size(); ++i)
    rows[i].fell = true;
  for (std::size_t i = add({.controller = "stands", .successes = "111"}, rows); i < rows.size(); ++i)
    rows[i].metrics = {{"command_forward", 0.5}, {"speed_forward", 0.24}, {"upper_body_error", 0.0}};
  for (std::size_t i = add({.controller = "waves", .successes = "111", .more = arms}, rows); i < rows.size(); ++i)
    rows[i].metrics = {{"command_forward", 0.5}, {"speed_forward", 0.26}, {"upper_body_error", 0.21}};
  for (std::size_t i = add({.controller = "free", .successes = kAll}, rows); i < rows.size(); ++i)
    rows[i].metrics = {{"upper_body_error", 0.21}};  // nobody asks for its arms
  add({.controller = "few", .successes = "111"}, rows);
  add({.controller = "armless", .successes = kAll, .more = arms}, rows);
  const Analysis analysis = arena_analysis(rows);
  const auto fails = [&](const char* controller) {
    return estimate(analysis, {.controller = controller, .of = "rung", .name = "fails_at"}).text;
  };
  EXPECT_EQ(fails("falls"), "1 stands: falls");
  EXPECT_EQ(fails("stands"), "1 stands: too slow");
  EXPECT_EQ(fails("waves"), "1 stands: arms elsewhere");
  EXPECT_EQ(fails("few"), "1 stands: too few episodes");
  for (const char* controller : {"free", "armless"})
    EXPECT_TRUE(estimates_like(analysis, {.controller = controller, .of = "rung", .name = "fails_at"}).empty());
  EXPECT_THAT(analysis_markdown(analysis), HasSubstr("nowhere"));
}

TEST(Arena, APushOutranksItsCommandAndActuationsStandApart) {
  const Tags pushed = {{"perturbation.rung", "2"}, {"perturbation.rung_name", "pushed"}};
  std::vector<EpisodeRow> rows;
  add({.controller = "a", .successes = kAll}, rows);
  add({.controller = "a", .successes = "0011", .actuation = "explicit", .more = pushed}, rows);
  const Analysis analysis = arena_analysis(rows);
  EXPECT_THAT(values_of(analysis.estimates, &Estimate::perturbation), ElementsAre("explicit", "implicit"));
  EXPECT_EQ(estimate(analysis, {.perturbation = "explicit", .of = "rung_2_pushed", .name = "passes"}).k, 2);
  EXPECT_EQ(estimate(analysis, {.perturbation = "implicit", .of = "rung_1_stands", .name = "passes"}).k, 12);
}

TEST(Arena, NamesWhatCouldNotRunAndIsNoTableWithoutRungs) {
  std::vector<EpisodeRow> rows;
  add({.controller = "a", .successes = kAll}, rows);
  for (std::size_t i = add({.controller = "absent", .successes = "000"}, rows); i < rows.size(); ++i)
    rows[i].outcome = Outcome::kUnsupported;
  for (std::size_t i = add({.controller = "broken", .successes = "000"}, rows); i < rows.size(); ++i) {
    rows[i].outcome = Outcome::kError;
    rows[i].message = fmt::format("no {}", i);
  }
  const Analysis analysis = arena_analysis(rows);
  EXPECT_EQ(analysis.tables.at(0).table.rows.size(), 2U);
  EXPECT_EQ(estimate(analysis, {.controller = "broken", .of = "rung", .name = "fails_at"}).text, "1 stands: error");
  EXPECT_THAT(analysis_markdown(analysis),
              AllOf(HasSubstr("Not run on this machine, as their rows say: absent."),
                    HasSubstr("broken: 3 episodes ended with an error, the first: no 15")));
  std::vector<EpisodeRow> plain;
  add_episodes({.successes = "11"}, plain);
  EXPECT_TRUE(arena_analysis(plain).empty());
  EXPECT_TRUE(arena_analysis({}).tables.empty());
}

// Episodes of the networks that a public benchmark ran, each passing the first so many of three rungs.
std::vector<EpisodeRow> ranked(const std::vector<std::pair<std::string, int>>& rungs_passed) {
  std::vector<EpisodeRow> rows;
  for (const auto& [controller, passed] : rungs_passed)
    for (int rung = 1; rung <= 3; ++rung)
      add({.controller = controller,
           .successes = rung <= passed ? kAll : "0000",
           .rung = rung,
           .name = fmt::format("r{}", rung)},
          rows);
  return rows;
}

TEST(Arena, HoldsItsOrderAgainstThatOfAPublicBenchmark) {
  const auto tau_b = [](const Analysis& analysis) {
    return estimate(analysis, {.of = "public_order", .name = "tau_b"});
  };
  const Analysis same = arena_analysis(ranked({{"homie", 3}, {"rl_gym", 0}, {"unitree_rl_lab", 1}, {"vmc", 2}}));
  EXPECT_EQ(tau_b(same).value, 1.0);
  EXPECT_EQ(tau_b(same).n, 3);  // nobody else ran vmc
  EXPECT_EQ(estimate(same, {.of = "public_order", .name = "swapped"}).value, 0.0);
  ASSERT_EQ(same.tables.size(), 2U);
  EXPECT_THAT(same.tables[1].table.rows.at(0), ElementsAre("mujoco", "implicit", "3", HasSubstr("1.00"), "0/3"));
  const Analysis reversed = arena_analysis(ranked({{"homie", 0}, {"rl_gym", 3}, {"unitree_rl_lab", 1}}));
  EXPECT_EQ(tau_b(reversed).value, -1.0);
  EXPECT_EQ(tau_b(reversed).interval.low, -1.0);
  const Analysis tied =
      arena_analysis(ranked({{"homie", 1}, {"rl_gym", 2}, {"falcon_dec_loco", 3}, {"unitree_rl_lab", 1}}));
  EXPECT_NEAR(tau_b(tied).value, -1.0 / std::sqrt(5.0 * 6.0), 1e-12);  // 2 pairs agree, 3 do not, 1 is tied
  EXPECT_LT(tau_b(tied).interval.low, tau_b(tied).value);
  EXPECT_GT(tau_b(tied).interval.high, tau_b(tied).value);
}

// The same rows in another engine.
void add_engine(std::vector<EpisodeRow> rows, const std::string& engine, std::vector<EpisodeRow>& into) {
  for (EpisodeRow& row : rows) {
    row.engine = engine;
    row.key = episode_key(row);
  }
  into.insert(into.end(), rows.begin(), rows.end());
}

TEST(Arena, SaysWhetherEnginesRankTheUnsaturatedAlike) {
  std::vector<EpisodeRow> rows = ranked({{"a", 1}, {"b", 2}, {"c", 1}, {"top", 3}, {"none", 0}, {"here", 1}});
  add_engine(ranked({{"a", 1}, {"b", 2}, {"c", 3}, {"top", 3}, {"none", 0}}), "bullet", rows);
  const Analysis analysis = arena_analysis(rows);
  const auto figure = [&](const char* name) { return estimate(analysis, {.of = "engines", .name = name}); };
  EXPECT_EQ(figure("controllers").value, 3.0);  // "here" ran in one engine
  EXPECT_EQ(figure("saturated").value, 2.0);
  EXPECT_NEAR(figure("mean_tau_b").value, 0.0, 1e-12);  // a-b as before, b-c turned round, a-c tied in one
  EXPECT_EQ(figure("lowest_tau_b").value, figure("mean_tau_b").value);
  EXPECT_NEAR(figure("rank_violation").value, 1.0 / 3.0, 1e-12);  // 2/9 with mujoco as the reference, else 4/9
  EXPECT_LE(figure("mean_tau_b").interval.low, 0.0);
  EXPECT_THAT(analysis.tables.back().table.rows.at(0), ElementsAre("implicit", "3", "1", HasSubstr("0.00"), _, _, "2"));
}

TEST(Arena, OneEngineAloneHasNoAgreement) {
  const Analysis one = arena_analysis(ranked({{"a", 1}, {"b", 2}, {"c", 1}}));
  EXPECT_TRUE(estimates_like(one, {.of = "engines", .name = "mean_tau_b"}).empty());
}

TEST(Arena, AnOrderOfTwoNetworksSaysNothing) {
  const Analysis two = arena_analysis(ranked({{"homie", 3}, {"rl_gym", 0}, {"vmc", 2}, {"falcon", 1}}));
  EXPECT_EQ(two.tables.size(), 1U);
  EXPECT_TRUE(estimates_like(two, {.of = "public_order", .name = "tau_b"}).empty());
}

}  // namespace
}  // namespace duet
