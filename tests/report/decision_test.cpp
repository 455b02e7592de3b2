#include "duet/report/ranking/decision.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::thrown_message;

using Rounds = std::vector<std::vector<TaskClip>>;

EpisodeRow hug(const std::string& policy, int clip, bool success, const std::string& engine = "mujoco") {
  EpisodeRow row = episode(policy, "hug", 0, success);
  row.clip = fmt::format("hug-{:03}", clip);
  row.engine = engine;
  row.key = episode_key(row);
  return row;
}

Rounds one_by_one(int clips) {
  Rounds rounds;
  for (int i = 0; i < clips; ++i) rounds.push_back({{"hug", fmt::format("hug-{:03}", i)}});
  return rounds;
}

std::vector<long> every_ten(long rounds) {
  std::vector<long> looks;
  for (long look = 10; look <= rounds; look += 10) looks.push_back(look);
  return looks;
}

// dstar succeeds always, dp in none of every `period` clips but the first.
std::vector<EpisodeRow> two_policies(int clips, int period) {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < clips; ++i) {
    rows.push_back(hug("dstar", i, true));
    rows.push_back(hug("dp", i, i % period == 0));
  }
  return rows;
}

const DecisionOptions kTwo{.policies = {"dstar", "dp"}};

TEST(Decision, StopsAtTheFirstLookThatDecidesAndKeepsItsFigures) {
  const std::vector<EpisodeRow> rows = two_policies(200, 2);
  const Decision decision = decide(rows, one_by_one(200), every_ten(200), kTwo);
  const PairDecision& pair = decision.pairs.at(0);
  EXPECT_EQ(pair.verdict, SequentialDecision::kBetter);
  EXPECT_LT(pair.rounds, 60);
  EXPECT_EQ(pair.clips, pair.rounds);
  EXPECT_EQ(pair.difference, 0.5);
  EXPECT_EQ(pair.better, pair.clips / 2);
  EXPECT_EQ(pair.worse, 0);
  EXPECT_GT(pair.interval.low, 0.0);
  EXPECT_LE(pair.p, 0.05);
  EXPECT_TRUE(decision.is_decided());
  EXPECT_FALSE(decision.is_open("dp"));
  // The rows after the look that decided change nothing.
  std::vector<EpisodeRow> fewer = rows;
  std::erase_if(fewer, [&](const EpisodeRow& row) { return std::stol(row.clip.substr(4)) >= pair.rounds; });
  EXPECT_EQ(decision_json(decide(fewer, one_by_one(200), every_ten(200), kTwo)), decision_json(decision));
  const Decision before = decide(rows, one_by_one(200), every_ten(pair.rounds - 10), kTwo);
  EXPECT_FALSE(before.is_decided());
  EXPECT_TRUE(before.is_open("dp") && before.is_open("dstar"));
  EXPECT_FALSE(before.is_open("null"));
}

TEST(Decision, TheOrderOfRowsIsOfNoMatter) {
  std::vector<EpisodeRow> rows = two_policies(100, 3);
  const nlohmann::json once = decision_json(decide(rows, one_by_one(100), every_ten(100), kTwo));
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(decision_json(decide(rows, one_by_one(100), every_ten(100), kTwo)), once);
  EXPECT_EQ(once.at("schema"), "duet.decision/1");
}

TEST(Decision, SaysWorseAndTheSame) {
  DecisionOptions turned = kTwo;
  std::swap(turned.policies[0], turned.policies[1]);
  EXPECT_EQ(decide(two_policies(100, 2), one_by_one(100), every_ten(100), turned).pairs[0].verdict,
            SequentialDecision::kWorse);
  EXPECT_EQ(decide(two_policies(400, 1), one_by_one(400), every_ten(400), kTwo).pairs[0].verdict,
            SequentialDecision::kSame);
  EXPECT_EQ(decide(two_policies(20, 1), one_by_one(20), every_ten(20), kTwo).pairs[0].verdict,
            SequentialDecision::kUndecided);
}

TEST(Decision, IsSaidInASentence) {
  const auto text = [](const std::vector<EpisodeRow>& rows, int clips) {
    return decision_text(decide(rows, one_by_one(clips), every_ten(clips), kTwo));
  };
  EXPECT_SENTENCE(text(two_policies(100, 2), 100));
  EXPECT_SENTENCE(text(two_policies(400, 1), 400));
  EXPECT_SENTENCE(text(two_policies(20, 1), 20));
}

TEST(Decision, OneClipIsOneObservationHoweverManyEnginesRunIt) {
  std::vector<EpisodeRow> rows;
  for (const char* engine : {"mujoco", "ode", "bullet"}) {
    rows.push_back(hug("dstar", 0, true, engine));
    rows.push_back(hug("dp", 0, engine == std::string("ode"), engine));
  }
  const PairDecision pair = decide(rows, one_by_one(1), {1}, kTwo).pairs.at(0);
  EXPECT_EQ(pair.clips, 1);
  EXPECT_DOUBLE_EQ(pair.difference, 2.0 / 3.0);
}

TEST(Decision, LeavesOutWhatCouldNotRunAndPlaybackBesidePhysics) {
  std::vector<EpisodeRow> rows = {hug("dstar", 0, true), hug("dp", 0, false)};
  for (const char* engine : {"ode", "playback"}) {
    rows.push_back(hug("dstar", 0, false, engine));
    rows.push_back(hug("dp", 0, false, engine));
    if (rows.back().engine == "ode") rows[2].outcome = rows[3].outcome = Outcome::kUnsupported;
  }
  EXPECT_EQ(decide(rows, one_by_one(1), {1}, kTwo).pairs.at(0).difference, 1.0);
  rows.erase(rows.begin(), rows.begin() + 4);
  EXPECT_EQ(decide(rows, one_by_one(1), {1}, kTwo).pairs.at(0).clips, 1);  // playback alone is an engine like others
  EXPECT_EQ(decide({}, one_by_one(1), {1}, kTwo).pairs.at(0).clips, 0);
  EXPECT_SENTENCE(decision_text(decide({}, one_by_one(1), {1}, kTwo)));
}

TEST(Decision, SeveralPairsShareTheError) {
  std::vector<EpisodeRow> rows = two_policies(60, 2);
  const Interval alone = decide(rows, one_by_one(60), {20}, kTwo).pairs.at(0).interval;
  for (int i = 0; i < 60; ++i) rows.push_back(hug("replay", i, true));
  const DecisionOptions three{.policies = {"dstar", "dp", "replay"}};
  const Decision decision = decide(rows, one_by_one(60), {20, 60}, three);
  ASSERT_EQ(decision.pairs.size(), 2U);
  EXPECT_LT(decide(rows, one_by_one(60), {20}, three).pairs[0].interval.low, alone.low);
  EXPECT_EQ(decision.pairs[0].verdict, SequentialDecision::kBetter);
  EXPECT_EQ(decision.pairs[1].verdict, SequentialDecision::kUndecided);
  EXPECT_FALSE(decision.is_open("dp"));  // its pair is decided; the first goes on against replay
  EXPECT_TRUE(decision.is_open("dstar") && decision.is_open("replay"));
}

TEST(DecisionRounds, DealAllClipsWithEveryTaskInEveryRound) {
  std::vector<TaskClip> clips;
  for (int i = 0; i < 7; ++i) clips.emplace_back("hug", fmt::format("hug-{}", i));
  for (int i = 0; i < 3; ++i) clips.emplace_back("wave", fmt::format("wave-{}", i));
  const Rounds rounds = decision_rounds(clips, 1);
  ASSERT_EQ(rounds.size(), 3U);
  std::set<TaskClip> seen;
  for (const auto& round : rounds) {
    seen.insert(round.begin(), round.end());
    EXPECT_EQ(std::count_if(round.begin(), round.end(), [](const TaskClip& clip) { return clip.first == "wave"; }), 1);
  }
  EXPECT_EQ(seen.size(), clips.size());
  EXPECT_EQ(decision_rounds(clips, 1), rounds);
  EXPECT_NE(decision_rounds(clips, 2), rounds);
  std::reverse(clips.begin(), clips.end());
  EXPECT_EQ(decision_rounds(clips, 1), rounds);
  EXPECT_TRUE(decision_rounds({}, 1).empty());
}

TEST(Decision, RefusesWhatNoDecisionCanBeOf) {
  const auto refusal = [](const DecisionOptions& options) {
    return thrown_message<std::invalid_argument>([&] { check_decision(options); });
  };
  EXPECT_SENTENCE(refusal({.policies = {"dstar"}}));
  EXPECT_SENTENCE(refusal({.policies = {"dp", "dp"}}));
  EXPECT_SENTENCE(refusal({.policies = {"a", "b"}, .alpha = 0.0}));
  EXPECT_SENTENCE(refusal({.policies = {"a", "b"}, .min_effect = 1.0}));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { decide({}, one_by_one(1), {2}, kTwo); }));
}

}  // namespace
}  // namespace duet
