// Demonstrations for D-STAR, made small.
#include "duet/training/setup/demonstrations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "duet/metrics/detector.h"
#include "duet/metrics/interaction.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

DemonstrationOptions small_options() {
  DemonstrationOptions options;
  options.clips = {{Likeness::kScripted, 3}};
  options.retargeting = "paper";
  options.starts = 2;
  options.followed = 1;
  options.engine = "playback";  // the robot is where it is told to be: nobody falls
  options.controller = "pd";
  options.threads = 2;
  return options;
}

// The meant motions alone, one start of each clip.
DemonstrationOptions unfollowed(Likeness like, int clips) {
  DemonstrationOptions options = small_options();
  options.clips = {{like, clips}};
  options.starts = 1;
  options.engine = "";
  return options;
}

DemonstrationSet made(const DemonstrationOptions& options) {
  Progress quiet(Progress::Style::kQuiet);
  return *make_demonstrations(test::g1(), options, quiet, [] { return false; });
}

std::map<std::string, int> takes_by_clip(const DemonstrationSet& set) {
  std::map<std::string, int> takes;
  for (const Demonstration& entry : set.list) ++takes[entry.clip_id];
  return takes;
}

TEST(MakeDemonstrations, EveryStartAsItIsAndTheFirstOfSomeClipsAsItIsFollowed) {
  const std::map<std::string, int> takes = takes_by_clip(made(small_options()));
  EXPECT_EQ(takes.size(), 18U);
  for (const auto& [clip, count] : takes) EXPECT_EQ(count, clip.ends_with("0000") ? 3 : 2) << clip;
}

TEST(MakeDemonstrations, AnotherPolicyIsSeenOnlyOnTheClipsThatAreFollowed) {
  DemonstrationOptions options = small_options();
  options.policy = "replay_dense";
  const DemonstrationSet set = made(options);
  EXPECT_THAT(takes_by_clip(set), ::testing::SizeIs(6));
  const DemonstrationSet own = made(small_options());
  EXPECT_EQ(set.list.front().digest, own.list.front().digest);
  // The wanted motion stays, whoever acted.
  EXPECT_EQ(set.wanted.col(10), own.wanted.col(10));
}

TEST(MakeDemonstrations, MoreThreadsAndMoreClipsChangeNoneOfThem) {
  DemonstrationOptions options = small_options();
  const DemonstrationSet first = made(options);
  options.threads = 1;
  options.clips.front().per_task = 4;
  const DemonstrationSet second = made(options);
  ASSERT_EQ(first.list[1].clip_id, second.list[1].clip_id);
  const int frames = first.list[1].frames;
  EXPECT_EQ(first.observed.middleCols(first.list[1].begin, frames),
            second.observed.middleCols(second.list[1].begin, frames));
}

TEST(MakeDemonstrations, TheirOriginSaysHowTheyWereMade) {
  DemonstrationOptions options = small_options();
  EXPECT_EQ(made(options).origin,
            "3 clips of each task (seed 880001), retargeted by paper, 2 starts of each, 1 of a kind followed in "
            "playback under "
            "pd by replay");
  options.controller = "wbc_sim";
  EXPECT_THAT(origin_of(options), testing::EndsWith("under wbc_sim (braced) by replay"));  // its default, by name
  options.controller_network = "student";
  EXPECT_THAT(origin_of(options), testing::EndsWith("under wbc_sim (student) by replay"));
  options.starts = 1;
  options.engine = "";
  EXPECT_EQ(origin_of(options),
            "3 clips of each task (seed 880001), retargeted by paper, 1 start of each, none followed");
  options.clips.push_back({Likeness::kPeople, 40});
  options.retargeting = "best";
  EXPECT_EQ(
      origin_of(options),
      "3 clips of each task and 40 like people (seed 880001), retargeted by best, 1 start of each, none followed");
}

TEST(MakeDemonstrations, AreRetargetedByAModeAndOptionsAfterIt) {
  EXPECT_EQ(parse_retargeting("best").weights.kin, make_pair_options({{"mode", "best"}}).weights.kin);
  const PairOptions nearer = parse_retargeting("w-kin=8 best");
  EXPECT_EQ(nearer.mode, PairMode::kBest);
  EXPECT_EQ(nearer.weights.kin, 8.0);
  EXPECT_THROW(parse_retargeting("best w-kin=much"), std::invalid_argument);
  EXPECT_THROW(parse_retargeting("better"), std::invalid_argument);
}

TEST(MakeDemonstrations, ForTheRealRobotAreThoseOfAlgorithm7) {
  DemonstrationOptions options = small_options();
  options.engine = "";
  options.starts = 1;
  options.start = StartMode::kSimToReal;
  const DemonstrationSet set = made(options);
  EXPECT_EQ(
      set.origin,
      "3 clips of each task (seed 880001), retargeted by paper, 1 start of each for the real robot (Algorithm 7), none "
      "followed");
  const Demonstration& first = set.list.front();
  // Arms down, all the way up to 16 frames before the act.
  EXPECT_EQ(set.reference(0).q.tail(14), set.reference(first.phases.act_begin - 16).q.tail(14));
  EXPECT_NE(set.reference(0).q.tail(14), set.reference(first.phases.act_begin - 8).q.tail(14));
}

// The first frame in which somebody's hand is a fifth of an arm over its lowest place so far and stays there.
std::optional<int> begins(const Agent& agent) { return act_onset(ActOnset::kHandRises, agent); }

// The meant motion and the partner's joints of one demonstration.
std::pair<RobotMotion, PointTracks> tracks_of(const DemonstrationSet& set, const Demonstration& entry) {
  RobotMotion robot{kTickRate, test::g1()->joint_names(), {}, Eigen::MatrixXd(test::g1()->dof(), entry.frames)};
  PointTracks partner(entry.frames, kSmplJoints);
  for (int t = 0; t < entry.frames; ++t) {
    const Reference meant = set.reference(entry.begin + t);
    robot.root.push_back(meant.X_WB);
    robot.q.col(t) = meant.q;
    partner.frame(t) = set.partner.col(entry.begin + t).cast<double>().reshaped(3, kSmplJoints);
  }
  return {std::move(robot), std::move(partner)};
}

TEST(MakeDemonstrations, InAnswerTheRobotBeginsAfterItsPartner) {
  DemonstrationOptions options = small_options();
  options.engine = "";
  options.clips = {{Likeness::kPeople, 6}};
  options.answers = true;
  const DemonstrationSet set = made(options);
  EXPECT_THAT(set.origin, testing::HasSubstr("2 starts of each in answer to the partner, none followed"));
  int both = 0;
  for (const Demonstration& entry : set.list) {
    if (entry.task != Task::kHandshake && entry.task != Task::kHighFive && entry.task != Task::kWave) continue;
    const auto [robot, partner] = tracks_of(set, entry);
    const std::optional<int> own = begins(robot_agent(*test::g1(), robot)), other = begins(human_agent(partner));
    if (!own || !other) continue;
    ++both;
    EXPECT_GE(*own - *other, 6) << entry.clip_id;  // 0.15 s, less what single precision moves an onset by
    // It is there before the act and waits.
    const int act = entry.phases.act_begin;
    EXPECT_EQ(set.reference(entry.begin + act).X_WB.p, set.reference(entry.begin + act - 5).X_WB.p) << entry.clip_id;
  }
  EXPECT_GE(both, 18);  // of 36; hands are half up in the first frame of some recordings
}

TEST(MakeDemonstrations, WhereItLeadsThePartnerWaitsOnAndTheRobotActsAtOnceAndAgain) {
  DemonstrationOptions options = unfollowed(Likeness::kPeople, 8);
  options.answers = options.leads = true;
  const DemonstrationSet set = made(options);
  EXPECT_THAT(set.origin, testing::HasSubstr("in answer to the partner or to begin"));
  int leads = 0, gestures = 0;
  for (const Demonstration& entry : set.list) {
    const bool gesture = entry.task == Task::kWave || entry.task == Task::kBend || entry.task == Task::kFlyKiss;
    gestures += gesture ? 1 : 0;
    if (!entry.leads) continue;
    EXPECT_TRUE(gesture) << entry.clip_id;
    ++leads;
    const auto [robot, partner] = tracks_of(set, entry);
    EXPECT_TRUE(!partner_begins(entry.task, partner)) << entry.clip_id;
    EXPECT_LE((robot.root[entry.phases.act_begin].p - robot.root[entry.phases.act_begin - 20].p).norm(), 1e-6);
    for (int t = 1; t < entry.frames; ++t)
      ASSERT_LE((robot.q.col(t) - robot.q.col(t - 1)).cwiseAbs().maxCoeff(), 0.5) << entry.clip_id << " " << t;
  }
  EXPECT_GE(leads, 4);
  EXPECT_LT(leads, gestures);
}

// All joints ramp from 0 to 1 within the act.

AdaptedMotion ramp() {
  constexpr int kFrames = 300, kBegin = 100, kEnd = 200;
  AdaptedMotion meant{{kTickRate, test::g1()->joint_names(), {}, Eigen::MatrixXd::Zero(test::g1()->dof(), kFrames)},
                      {kBegin, kEnd}};
  for (int t = 0; t < kFrames; ++t) {
    meant.motion.root.push_back({Eigen::Quaterniond::Identity(), Eigen::Vector3d(t, 0.0, 0.8)});
    meant.motion.q.col(t).setConstant(std::clamp((t - kBegin) / 100.0, 0.0, 1.0));
  }
  return meant;
}

TEST(LateAct, IsPutOffByWhatTheRobotWasLate) {
  const AdaptedMotion meant = ramp(), late = put_off(meant, 20);
  EXPECT_EQ(act_lag(meant, states_of(meant.motion), *test::g1()), 0);
  EXPECT_EQ(act_lag(meant, states_of(late.motion), *test::g1()), 20);
  EXPECT_EQ(late.phases.act_begin, 120);
  EXPECT_EQ(late.phases.act_end, 220);
  EXPECT_EQ(late.motion.root[90].p.x(), 90.0);    // comes as before,
  EXPECT_EQ(late.motion.root[119].p.x(), 100.0);  // waits
  EXPECT_EQ(late.motion.root[299].p.x(), 279.0);  // and does the rest
  EXPECT_EQ(put_off(meant, 0).motion.q, meant.motion.q);
}

TEST(BegunAtOnce, RepeatsTheActUntilTheEnd) {
  AdaptedMotion waits = ramp();
  for (int t = 40; t < 100; ++t) waits.motion.root[t] = waits.motion.root[100];  // there after 40 frames
  const AdaptedMotion made = begun_at_once(waits);
  EXPECT_EQ(made.phases.act_begin, 65);
  EXPECT_EQ(made.motion.q.col(64), waits.motion.q.col(64));
  for (const int t : {0, 50, 149}) EXPECT_EQ(made.motion.q.col(65 + t), waits.motion.q.col(100 + t)) << t;
  EXPECT_EQ(made.motion.q.col(65 + 150 + 24), waits.motion.q.col(99));  // back where the act begins
  EXPECT_EQ(made.motion.q.col(65 + 175), waits.motion.q.col(100));      // and again
  EXPECT_EQ(made.phases.act_end, 300);
  EXPECT_EQ(begun_at_once(ramp()).motion.q, ramp().motion.q);  // never waits
}

TEST(MakeDemonstrations, BeforeAStillPartnerNobodyBeginsUntilHeHasLookedForFiveSeconds) {
  const DemonstrationSet set = made(unfollowed(Likeness::kVaried, 8));
  int still = 0;
  for (const Demonstration& entry : set.list) {
    const auto partner = set.partner.middleCols(entry.begin, entry.frames);
    const float moved = (partner.colwise() - partner.col(0)).cwiseAbs().maxCoeff();
    if (moved > 0.15F) continue;  // he breathes and shifts his weight
    ++still;
    EXPECT_GE(entry.phases.act_begin, 240) << entry.clip_id;
  }
  EXPECT_GE(still, 6);  // half of 24 gestures
  EXPECT_LE(still, 18);
}

TEST(MakeDemonstrations, PeopleWaitForNoLengthThatCouldBeCounted) {
  const DemonstrationSet set = made(unfollowed(Likeness::kPeople, 6));
  std::vector<int> begins;
  for (const Demonstration& entry : set.list) begins.push_back(entry.phases.act_begin);
  const auto [shortest, longest] = std::ranges::minmax(begins);
  EXPECT_GE(shortest, 125);  // 2.5 s, in which the robot comes; then without memory
  EXPECT_GT(longest, 300);
}

TEST(MakeDemonstrations, BothKindsOfClipsAreInOneSet) {
  DemonstrationOptions options = small_options();
  options.engine = "";
  options.starts = 1;
  options.clips = {{Likeness::kScripted, 1}, {Likeness::kPeople, 2}};
  EXPECT_THAT(made(options).list, ::testing::SizeIs(18));
}

TEST(MakeDemonstrations, StoppedTheyAreNone) {
  Progress quiet(Progress::Style::kQuiet);
  EXPECT_FALSE(make_demonstrations(test::g1(), small_options(), quiet, [] { return true; }).has_value());
}

}  // namespace
}  // namespace duet
