// Variants of synthesised clips: the same people, another hand or height.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/experiment/plan/clips.h"
#include "duet/experiment/work/run_work.h"
#include "duet/metrics/interaction.h"
#include "tests/experiment/fixtures.h"

namespace duet {
namespace {

TEST(ClipVariants, EveryClipIsMadeInEachAndSaysSo) {
  const Suite suite = parse_suite(
      "schema: duet.suite/1\nname: v\nversion: 1.0.0\ntasks: [handshake]\nengines: [playback]\ncontrollers: [pd]\n"
      "policies: [replay]\nclips:\n  synth:\n    per_task: 1\n"
      "    variants: [{name: left_low, side: left, target_height: 0.9}, {name: right_high, side: right, "
      "target_height: 1.15}]\n",
      "v.yaml");
  Progress quiet(Progress::Style::kQuiet);
  const std::vector<PairedMotion> clips = prepare_clips(suite, *test::g1(), 1, quiet);
  ASSERT_EQ(clips.size(), 2U);
  EXPECT_EQ(clips[0].clip_id, "synth-handshake-s42-0000-left_low");
  EXPECT_EQ(clips[1].clip_id, "synth-handshake-s42-0000-right_high");
  EXPECT_EQ(clips[0].tags, (Tags{{"clip.people", "synthetic"}, {"clip.side", "left"}, {"clip.target_height", "0.9"}}));
  EXPECT_EQ(clips[1].tags.at("clip.side"), "right");
  const auto highest = [](const PairedMotion& clip, int joint) {
    double z = 0.0;
    for (int t = clip.phases.act_begin; t < clip.phases.act_end; ++t)
      z = std::max(z, clip.source_partner.joints.at(t, joint).z());
    return z;
  };
  EXPECT_GT(highest(clips[0], kLeftWrist), highest(clips[0], kRightWrist));
  EXPECT_GT(highest(clips[1], kRightWrist), highest(clips[1], kLeftWrist));
  EXPECT_GT(highest(clips[1], kRightWrist), highest(clips[0], kLeftWrist) + 0.15);
  EXPECT_EQ(clips[0].source_partner.joints.at(0, kPelvis).z(), clips[1].source_partner.joints.at(0, kPelvis).z());
  constexpr double kPlace = 0.05;  // the place to meet at moves with the reach [m]
  EXPECT_LT((clips[0].source_partner.joints.at(0, kPelvis) - clips[1].source_partner.joints.at(0, kPelvis)).norm(),
            kPlace);
}

// People who stand close, who walk up, who hesitate and who break off: the same person and act in each.
TEST(ClipVariants, PeopleMayStandCloseWalkUpHesitateAndBreakOff) {
  const Suite suite = parse_suite(
      "schema: duet.suite/1\nname: v\nversion: 1.0.0\ntasks: [handshake]\nengines: [playback]\ncontrollers: [pd]\n"
      "policies: [replay]\nretarget: {stage1-iterations: 1, stage2-iterations: 0}\nclips:\n  synth:\n    per_task: 1\n"
      "    like: people\n    variants: [{name: close, distance: 1.3, outcome: complete}, {name: far, distance: 3},\n"
      "      {name: waits, distance: 1.3, outcome: hesitant}, {name: breaks_off, distance: 1.3, outcome: aborted}]\n",
      "v.yaml");
  Progress quiet(Progress::Style::kQuiet);
  const std::vector<PairedMotion> clips = prepare_clips(suite, *test::g1(), 1, quiet);
  ASSERT_EQ(clips.size(), 4U);
  const auto apart = [](const PairedMotion& clip, int t) {
    return (clip.source_partner.joints.at(t, kPelvis) - clip.source_reactor.joints.at(t, kPelvis)).head<2>().norm();
  };
  constexpr double kSway = 0.1;  // of two pelvises over their feet [m]
  EXPECT_NEAR(apart(clips[0], 0), 1.3, kSway);
  EXPECT_NEAR(apart(clips[1], 0), 3.0, kSway);
  const auto nearest_hands = [](const PairedMotion& clip) {
    double nearest = HUGE_VAL;
    for (int t = 0; t < clip.frames(); ++t)
      for (const int joint : {kLeftHand, kRightHand})
        nearest = std::min(nearest,
                           (clip.source_partner.joints.at(t, joint) - clip.source_reactor.joints.at(t, joint)).norm());
    return nearest;
  };
  EXPECT_LT(nearest_hands(clips[0]), 0.1);
  EXPECT_LT(nearest_hands(clips[2]), 0.1);
  EXPECT_GT(nearest_hands(clips[3]), 0.15);
  EXPECT_EQ(clips[3].clip_id, "people-handshake-s42-0000-breaks_off");
}

TEST(ClipVariants, AWaveMayBeTheRobotsToBegin) {
  const Suite suite = parse_suite(
      "schema: duet.suite/1\nname: v\nversion: 1.0.0\ntasks: [wave]\nengines: [playback]\ncontrollers: [pd]\n"
      "policies: [replay]\nretarget: {stage1-iterations: 1, stage2-iterations: 0}\nclips:\n  synth: {per_task: 1,\n"
      "    like: varied, variants: [{name: first, still: true}, {name: second, still: false}]}\n",
      "v.yaml");
  Progress quiet(Progress::Style::kQuiet);
  const std::vector<PairedMotion> clips = prepare_clips(suite, *test::g1(), 1, quiet);
  ASSERT_EQ(clips.size(), 2U);
  EXPECT_EQ(clips[0].clip_id, "varied-wave-s42-0000-first");
  EXPECT_FALSE(partner_begins(clips[0].task, clips[0].source_partner.joints));
  EXPECT_TRUE(partner_begins(clips[1].task, clips[1].source_partner.joints));
}

}  // namespace
}  // namespace duet
