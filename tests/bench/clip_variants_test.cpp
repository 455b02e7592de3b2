// Variants of synthesised clips: the same people, another hand or height.
#include <gmock/gmock.h>

#include "duet/bench/clips.h"
#include "duet/bench/progress.h"
#include "tests/bench/fixtures.h"

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

}  // namespace
}  // namespace duet
