#include "duet/report/ranking/ranking.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/report/page/html_report.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/statistics/clustered.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

using Rows = std::vector<EpisodeRow>;

const PolicyRoles kRoles = {{"replay", {ArmRole::kOracle, "knows the motion"}},
                            {"omni", {ArmRole::kControl, "does not read the task"}}};

struct Arm {
  std::string policy;
  std::string successes;  // a digit a clip
  std::string arm = "main", engine = "mujoco", controller = "vmc";
};

void add(const Arm& of, Rows& rows) {
  for (std::size_t i = 0; i < of.successes.size(); ++i) {
    EpisodeRow row = test::episode(of.policy, "hug", 0, of.successes[i] == '1', of.arm);
    row.clip = "hug_" + std::to_string(i);
    row.engine = of.engine;
    row.controller = of.controller;
    row.key = episode_key(row);
    rows.push_back(row);
  }
}

Ranking board_of(const std::vector<Arm>& arms) {
  Rows rows;
  for (const Arm& arm : arms) add(arm, rows);
  return rank_policies(rows, {}, {.roles = kRoles});
}

std::string times(int count, char digit) { return std::string(static_cast<std::size_t>(count), digit); }

std::string verdict_of(const Ranking& board) {
  std::string text;
  for (const std::string& sentence : ranking_verdict(board)) text += sentence + "\n";
  return text;
}

std::vector<std::string> policies_of(const std::vector<RankingRow>& rows) {
  std::vector<std::string> names;
  for (const RankingRow& row : rows) names.push_back(row.policy);
  return names;
}

TEST(Ranking, RanksCompetitorsAlone) {
  const Ranking made = board_of({{"replay", times(40, '1')},
                                 {"a", times(20, '1') + times(20, '0')},
                                 {"b", times(30, '1') + times(10, '0')},
                                 {"omni", times(38, '1') + times(2, '0')},
                                 {"null", times(40, '0'), "null"},
                                 {"b_shuffled", times(40, '0'), "shuffled"}});
  EXPECT_THAT(policies_of(made.rows), ElementsAre("b", "a"));
  EXPECT_THAT(policies_of(made.references), ElementsAre("replay", "omni", "b_shuffled", "null"));
  EXPECT_EQ(made.rows[1].rank, 2U);
  EXPECT_EQ(made.references[0].rank, 0U);
  const std::string verdict = verdict_of(made);
  EXPECT_SENTENCE(verdict);
  // The lift is that over the best control, which wins here.
  EXPECT_SENTENCE(verdict);
}

TEST(Ranking, TheLiftIsOverTheNullArmWhereNoOtherControlIs) {
  const Ranking made = board_of({{"a", times(36, '1') + times(4, '0')}, {"null", times(40, '0'), "null"}});
  EXPECT_SENTENCE(verdict_of(made));
  EXPECT_SENTENCE(verdict_of(board_of({{"a", times(40, '1')}})));
}

TEST(Ranking, TheControllersAreRankedWhereNoPolicyCompetes) {
  const Ranking made = board_of({{.policy = "replay", .successes = times(40, '1'), .controller = "wbc"},
                                 {.policy = "replay", .successes = times(20, '1') + times(20, '0')}});
  EXPECT_TRUE(made.of_oracles);
  EXPECT_SENTENCE(verdict_of(made));
}

TEST(Ranking, OnlyControlsAreNoCompetition) {
  const Ranking made = board_of({{"null", times(40, '0'), "null"}});
  EXPECT_TRUE(made.rows.empty());
  EXPECT_SENTENCE(ranking_verdict(made));
  EXPECT_FALSE(ranking_analysis(made).empty());
}

TEST(BoardVerdict, FewClipsSayNothingHoweverTheyFall) {
  for (int clips = 1; clips < kFewestClips; ++clips) {
    const std::string verdict = verdict_of(board_of({{"a", times(clips, '1')}, {"b", times(clips, '0')}}));
    EXPECT_THAT(verdict, AllOf(StartsWith("Too few clips to rank 2 competitors: vmc with a has 100.0 ["),
                               Not(HasSubstr("ahead")), Not(HasSubstr("best of"))));
  }
  EXPECT_SENTENCE(verdict_of(board_of({{"a", times(30, '1')}, {"b", times(30, '0')}})));
}

TEST(BoardVerdict, OneIsOne) {
  const std::string verdict = verdict_of(board_of({{"a", "1"}, {"b", "0"}}));
  EXPECT_SENTENCE(verdict);
}

TEST(BoardVerdict, ATieIsATie) {
  const Ranking made = board_of({{"a", times(40, '1')}, {"b", times(40, '1')}, {"c", times(40, '0')}});
  EXPECT_EQ(made.rows[0].rank, 1U);
  EXPECT_EQ(made.rows[1].rank, 1U);
  EXPECT_EQ(made.rows[2].rank, 3U);
  EXPECT_SENTENCE(verdict_of(made));
}

TEST(BoardVerdict, ALeadThatTheExactTestDoesNotSeeIsNone) {
  // 36 of 40 against 33: six to three clips, p = .51.
  const std::string a = times(36, '1') + times(4, '0'), b = times(30, '1') + times(6, '0') + "1110";
  const Ranking made = board_of({{"a", a}, {"b", b}});
  EXPECT_NEAR(made.lead->p, mcnemar_exact(6, 3), 1e-12);
  EXPECT_SENTENCE(verdict_of(made));
}

// The test and the interval are two approximations of one truth: where they differ, nobody reads "p = .03" beside "not
// decided" without the reason.
TEST(BoardVerdict, WhereTestAndIntervalDifferASentenceSaysWhich) {
  RankingDifference of{.other = "b", .difference = 0.1, .interval = {0.02, 0.2}, .clips = 40, .p = 0.03};
  EXPECT_EQ(told(of, 0.95), Told::kAhead);
  of.interval.low = -0.01;
  EXPECT_EQ(told(of, 0.95), Told::kTestAlone);
  Ranking made = board_of({{"a", times(36, '1') + times(4, '0')}, {"b", times(30, '1') + times(6, '0') + "1110"}});
  made.lead = of;
  made.lift = of;
  EXPECT_SENTENCE(verdict_of(made));
  of.interval.low = 0.02;
  of.p = 0.06;
  made.lead = of;
  EXPECT_EQ(told(of, 0.95), Told::kIntervalAlone);
  EXPECT_SENTENCE(verdict_of(made));
  of.interval.low = -0.01;
  made.lead = made.lift = of;
  EXPECT_THAT(verdict_of(made), Not(HasSubstr("alone would")));
  of.clips = 29;
  of.p = 0.001;
  EXPECT_EQ(told(of, 0.95), Told::kTooFewClips);
}

TEST(BoardVerdict, EnginesAndRolesOfAClipAreOneClip) {
  Rows rows;
  for (const char* engine : {"bullet", "dart", "mujoco", "ode", "simbody"}) {
    for (const char* role : {"", "-A"}) {
      for (const bool first : {true, false}) {
        Rows some;
        add({.policy = first ? "a" : "b",
             .successes = (first ? "111111" : "000111") + times(29, '1'),
             .engine = engine},
            some);
        for (EpisodeRow& row : some) {
          test::set_tag(row, kRecordingTag, row.clip);
          row.clip += role;
        }
        rows.insert(rows.end(), some.begin(), some.end());
      }
    }
  }
  const Ranking made = rank_policies(rows, {});
  EXPECT_EQ(made.lead->clips, 35);
  EXPECT_NEAR(made.lead->p, 0.25, 1e-12);  // three clips, not thirty episodes
  // Ten episodes a clip, all good: no surer than 35 clips.
  EXPECT_NEAR(made.rows[0].interval.low, wilson(35, 35).low, 1e-12);
}

TEST(BoardVerdict, AnEngineMattersWhereTheTestSaysSo) {
  const auto with = [](const std::string& ode) {
    return verdict_of(board_of({{.policy = "a", .successes = times(40, '1')},
                                {.policy = "a", .successes = ode, .engine = "ode"},
                                {.policy = "b", .successes = times(40, '0')},
                                {.policy = "b", .successes = times(40, '0'), .engine = "ode"}}));
  };
  EXPECT_SENTENCE(with(times(38, '1') + "00"));
  EXPECT_SENTENCE(with(times(20, '1') + times(20, '0')));
  EXPECT_SENTENCE(with(times(40, '1')));
}

TEST(BoardVerdict, NamesTheEnginesThatAnotherWins) {
  const std::string verdict =
      verdict_of(board_of({{.policy = "a", .successes = times(40, '1')},
                           {.policy = "a", .successes = times(30, '1') + times(10, '0'), .engine = "ode"},
                           {.policy = "b", .successes = times(20, '1') + times(20, '0')},
                           {.policy = "b", .successes = times(35, '1') + times(5, '0'), .engine = "ode"}}));
  EXPECT_SENTENCE(verdict);
}

TEST(BoardVerdict, EpisodesThatFellAreNoSuccessInAnyColumn) {
  Rows rows;
  add({"a", times(40, '1')}, rows);
  for (EpisodeRow& row : rows) {
    row.verdicts.resize(1);
    row.verdicts[0].version = row.verdicts[0].thresholds = "paper";
    row.verdicts[0].success = true;
    row.outcome = Outcome::kFell;
    row.fell = true;
  }
  EXPECT_EQ(rank_policies(rows, {}).rows[0].mean, 0.0);
  for (const LeaderboardEntry& entry : leaderboard(rows)) {
    EXPECT_EQ(entry.success, 0.0);
    EXPECT_EQ(entry.other_success.at("paper/paper"), 0.0);
  }
}

TEST(BoardVerdict, EndsWithASuiteThatOnlyBearsTheName) {
  Rows rows;
  add({"a", times(40, '1')}, rows);
  const Ranking made =
      rank_policies(rows, {}, {.label = "tiny 1.0.0, NOT it", .warning = "tiny 1.0.0 is NOT it.", .roles = {}});
  EXPECT_EQ(ranking_verdict(made).back(), "tiny 1.0.0 is NOT it.");
  const Analysis analysis = ranking_analysis(made);
  EXPECT_EQ(analysis.title, "Board: tiny 1.0.0, NOT it");
  ReportContent page;
  page.analyses = {analysis};
  for (const std::string& text : {analysis_markdown(analysis), analysis_csv(analysis), analysis_latex(analysis),
                                  analysis_json(analysis).dump(), html_report(page, {}), ranking_screen(made, {})})
    EXPECT_THAT(text, HasSubstr("tiny 1.0.0 is NOT it."));
}

TEST(BoardScreen, FitsATerminalWhateverIsRun) {
  std::vector<Arm> arms;
  for (int i = 0; i < 40; ++i)
    for (const char* engine : {"bullet", "mujoco"})
      arms.push_back({.policy = "policy_of_a_rather_long_name_" + std::to_string(i),
                      .successes = times(i, '1') + times(40 - i, '0'),
                      .engine = engine,
                      .controller = "a_controller_of_a_long_name"});
  for (const char* policy : {"replay", "omni"})
    for (const char* engine : {"bullet", "mujoco"})
      arms.push_back({policy, times(40, '1'), "main", engine, "a_controller_of_a_long_name"});
  Ranking made = board_of(arms);
  made.suite.warning = times(300, 'x');
  const std::string text = ranking_screen(made, {times(500, 'n'), "a note\nof two lines", "another", "and one more"});
  std::istringstream lines(text);
  std::size_t count = 0;
  for (std::string line; std::getline(lines, line); ++count) EXPECT_LE(line.size(), kScreenColumns) << line;
  EXPECT_LE(count, kScreenLines);
  EXPECT_THAT(text, AllOf(HasSubstr("replay (knows the motion)"), HasSubstr("more (--tables)"), HasSubstr("39")));
}

TEST(BoardScreen, ShowsEveryRowWhereThereIsRoom) {
  const std::string text =
      ranking_screen(board_of({{"a", times(40, '1')}, {"b", times(40, '0')}, {"null", times(40, '0'), "null"}}), {});
  EXPECT_THAT(text, AllOf(HasSubstr("\n  1  a "), HasSubstr("\n  2  b "), HasSubstr("\n  -  null (stands still) "),
                          Not(HasSubstr("more (--tables)"))));
}

// How often the verdict calls a policy better than its equal. DUET_NULLS: how many experiments are made.

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
