// The seventh task from end to end: what is drawn, what the detector says of it and of its neighbours, which policies
// refuse it.
#include <fmt/format.h>

#include "duet/core/require.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/policies/dstar/dstar_policy.h"
#include "tests/metrics/acting.h"
#include "tests/policies/dstar_fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

Task fist_bump() { return parse_task("fist_bump"); }

// ---- what is drawn

double hand_distance(const InteractionClip& clip, int joint, int frame) {
  return (clip.a.joints.at(frame, joint) - clip.b.joints.at(frame, joint)).norm();
}

TEST(FistBump, TouchesForAFifthOfASecondToASecondAtItsHeight) {
  for (int index = 0; index < 40; ++index) {
    const InteractionClip clip = synthesize(fist_bump(), {.seed = 3, .index = index});
    ASSERT_EQ(clip.contacts.size(), 1u) << clip.id;
    const ContactWindow& touch = clip.contacts.front();
    EXPECT_GE(touch.end - touch.begin, 10) << clip.id;
    EXPECT_LE(touch.end - touch.begin, 50) << clip.id;
    EXPECT_EQ(touch.joint_a, touch.joint_b);
    EXPECT_GT(touch.joint_a, kRightWrist);
    for (int t = touch.begin; t < touch.end; ++t) {
      EXPECT_GT(clip.a.joints.at(t, touch.joint_a).z(), 0.8) << clip.id;
      EXPECT_LT(clip.a.joints.at(t, touch.joint_a).z(), 1.3) << clip.id;
      EXPECT_GT(hand_distance(clip, touch.joint_a, t), 0.04) << clip.id << ": the fists are in one another";
    }
    EXPECT_GT(hand_distance(clip, touch.joint_a, clip.frames() - 1), 0.5) << clip.id << ": they part";
  }
}

TEST(FistBump, HasVariety) {
  double least = 2.0, most = 0.0;
  int exploding = 0, left = 0;
  for (int index = 0; index < 60; ++index) {
    const InteractionClip clip = synthesize(fist_bump(), {.seed = 4, .index = index});
    const double z = std::stod(clip.source.at("target_height"));
    least = std::min(least, z);
    most = std::max(most, z);
    exploding += clip.source.at("explodes") == "yes" ? 1 : 0;
    left += clip.source.at("side") == "left" ? 1 : 0;
  }
  EXPECT_LT(least, 0.95);
  EXPECT_GT(most, 1.15);
  EXPECT_GT(exploding, 8);
  EXPECT_LT(exploding, 30);
  EXPECT_GT(left, 2);
  EXPECT_LT(left, 20);
}

TEST(FistBump, MeetsAtTheHeightAskedForOnEitherSide) {
  const synthesis::Act& act = definition_of(fist_bump()).act;
  for (int corner = 0; corner < 16; ++corner) {
    SynthesisOptions options;
    options.height_a = corner & 1 ? 1.55 : 1.9;
    options.height_b = corner & 2 ? 1.55 : 1.9;
    options.side = corner & 4 ? Side::kLeft : Side::kRight;
    options.target_height = corner & 8 ? act.lowest : act.highest;
    const InteractionClip clip = synthesize(fist_bump(), options);
    const int hand = *options.side == Side::kLeft ? kLeftHand : kRightHand;
    for (const ContactWindow& touch : clip.contacts) {
      EXPECT_EQ(touch.joint_a, hand);
      for (int t = touch.begin; t < touch.end; ++t) {
        EXPECT_NEAR(clip.a.joints.at(t, hand).z(), *options.target_height, 0.03) << corner;
        EXPECT_LT(hand_distance(clip, hand, t), act.touch_distance) << corner;
      }
    }
  }
}

// ---- what the detector says

constexpr int kFrames = 60;

// Right hands, 1 m apart, meet from frame 10 on for `frames` at height `z`, `gap` apart, and part again.
test::Scene meet(int frames, double z, double gap = 0.08, double after = 1.0) {
  test::Scene s{test::standing({0.0, 0.0, 0.9}, 1.0, kFrames), test::standing({1.4, 0.0, 0.9}, -1.0, kFrames)};
  s.performer.rhand.middleCols(10, frames) = test::still({0.6, 0.0, z}, frames);
  s.partner.rhand.middleCols(10, frames) = test::still({0.6 + gap, 0.0, z}, frames);
  for (int t = 10 + frames; t < kFrames; ++t) {
    s.performer.lhand.col(t) = s.performer.rhand.col(t) = Eigen::Vector3d(0.0, 0.0, z);
    s.partner.lhand.col(t) = s.partner.rhand.col(t) = Eigen::Vector3d(after, 0.0, z);
  }
  return s;
}

DetectorResult judge(const test::Scene& s, const Thresholds& tau = {}) {
  return detect_performer(fist_bump(), s.performer, s.partner, tau);
}

TEST(FistBumpDetector, WantsABriefTouchAtItsHeight) {
  EXPECT_TRUE(judge(meet(20, 1.0)).success);
  EXPECT_FALSE(judge(meet(20, 1.0, 0.25)).success);  // too far apart
  EXPECT_FALSE(judge(meet(20, 0.7)).success);        // too low
  EXPECT_FALSE(judge(meet(20, 1.4)).success);        // a high-five
  EXPECT_FALSE(judge(meet(9, 1.0)).success);         // too short
  test::Scene close = meet(20, 1.0);                 // the arms of a hug
  close.partner.root.row(0).setConstant(0.9);
  EXPECT_FALSE(judge(close).success);
  EXPECT_FALSE(judge(meet(40, 1.0), {{"max_touch", 39}}).success);
}

TEST(FistBumpDetector, BoundariesBelong) {
  EXPECT_TRUE(judge(meet(10, 1.0)).success);
  EXPECT_TRUE(judge(meet(20, 0.8)).success);
  EXPECT_TRUE(judge(meet(20, 1.3)).success);
  const double from_root = judge(meet(20, 1.0)).values.at("root_distance");
  EXPECT_TRUE(judge(meet(20, 1.0), {{"min_dist", from_root}}).success);
  EXPECT_FALSE(judge(meet(20, 1.0), {{"min_dist", from_root + 1e-9}}).success);
  EXPECT_FALSE(judge(meet(20, 1.0, 0.25), {{"contact", 0.25}}).parts.at("touch"));  // d < contact
  EXPECT_TRUE(judge(meet(40, 1.0), {{"max_touch", 40}}).success);
  EXPECT_TRUE(judge(meet(20, 1.0, 0.08, 0.4), {{"part", 0.4}}).success);
  EXPECT_FALSE(judge(meet(20, 1.0, 0.08, 0.4), {{"part", 0.4001}}).success);
}

TEST(FistBumpDetector, AHandshakeThatDriftsOutOfTheBandIsNone) {
  test::Scene s = meet(45, 1.0);
  for (Agent* agent : {&s.performer, &s.partner}) agent->rhand.block(2, 30, 1, 25).setConstant(0.75);
  const DetectorResult result = judge(s, {{"max_touch", 40}});
  EXPECT_TRUE(result.parts.at("touch"));
  EXPECT_FALSE(result.parts.at("brief"));
  EXPECT_EQ(result.values.at("touch_run"), 20.0);
  EXPECT_EQ(result.values.at("together_run"), 45.0);
}

TEST(FistBumpDetector, HandsThatStayTogetherHaveNotParted) {
  const DetectorResult result = judge(meet(20, 1.0, 0.08, 0.25));
  EXPECT_TRUE(result.parts.at("touch"));
  EXPECT_FALSE(result.parts.at("parted"));
  EXPECT_NEAR(result.values.at("parted_distance"), 0.25, 1e-12);
}

TEST(FistBumpDetector, TheSmallestMarginHasTheSignOfTheVerdict) {
  int successes = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const test::Scene s = test::acting(Task::kHandshake, seed);
    const DetectorResult result = judge(s, {{"max_touch", 30}, {"highest", 1.2}});
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [name, margin] : result.margins) least = std::min(least, margin);
    EXPECT_EQ(result.success, least >= 0.0) << seed << ": " << least;
    successes += result.success ? 1 : 0;
  }
  EXPECT_GT(successes, 10);
  EXPECT_LT(successes, 190);
}

TEST(FistBumpDetector, LooksAtHandsAndRootsAlone) {
  test::Scene s = meet(20, 1.0);
  for (Agent* agent : {&s.performer, &s.partner})
    for (Eigen::Matrix3Xd* track : {&agent->head, &agent->torso, &agent->lshoulder, &agent->rshoulder})
      track->resize(3, 0);
  EXPECT_TRUE(judge(s).success);
  EXPECT_EQ(detect(fist_bump(), s.partner, s.performer, DetectorVersion::kRobot).margins,
            detect(fist_bump(), s.performer, s.partner, DetectorVersion::kPaper).margins);
  s.partner.rhand.resize(3, 0);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)judge(s); }));
}

// ---- beside its neighbours

constexpr int kClips = 20;

// Share of synthetic clips of `clips` that the detector of `detector` accepts, person against person.
double accepted(Task clips, Task detector, ThresholdSet set) {
  int count = 0;
  for (int index = 0; index < kClips; ++index) {
    const InteractionClip clip = synthesize(clips, {.index = index});
    const Agent partner = human_agent(clip.actor_motion().joints),
                performer = human_agent(clip.reactor_motion().joints);
    count += detect(detector, partner, performer, DetectorVersion::kRobot, set).success ? 1 : 0;
  }
  return static_cast<double>(count) / kClips;
}

TEST(FistBumpDetector, AcceptsEveryFistBumpAndNoNeighbour) {
  for (const ThresholdSet set : {ThresholdSet::kPaper, ThresholdSet::kStrict}) {
    EXPECT_EQ(accepted(fist_bump(), fist_bump(), set), 1.0) << to_string(set);
    for (const Task other : kPaperTasks) {
      const double taken = accepted(other, fist_bump(), set), given = accepted(fist_bump(), other, set);
      fmt::print("{}: fist bump's detector accepts {:.0f} % of {}, {}'s accepts {:.0f} % of fist bumps\n",
                 to_string(set), 100.0 * taken, to_string(other), to_string(other), 100.0 * given);
      EXPECT_LE(taken, 0.05) << to_string(set) << " " << to_string(other);
    }
  }
}

// ---- networks that were made before it

TEST(FistBump, IsRefusedByNameByDstarUnlessAPromptSaysWhatToDo) {
  DstarConfig config = test::small_config();
  config.language = kLanguageSize;
  const auto policy = make_dstar_policy("dstar", test::g1(), test::random_network(config), built_in_language());
  EpisodeContext context;
  context.task = fist_bump();
  context.start = test::g1()->standing_state();
  for (const std::string_view prompt : {std::string_view(), task_prompt(fist_bump())}) {
    context.prompt = prompt;
    EXPECT_SENTENCE(test::thrown_message<MissingError>([&] { policy->reset(context); }));
  }
  context.prompt = "give the person a high five";
  EXPECT_NO_THROW(policy->reset(context));
}

}  // namespace
}  // namespace duet
