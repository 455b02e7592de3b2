
#include <algorithm>
#include <numbers>

#include "duet/core/require.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/motion/people.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::moving_person;
using test::thrown_message;

constexpr double kRate = 50.0;

// Two people 1 m apart with hanging arms.
struct Pair {
  HumanMotion a, b;
  explicit Pair(int frames)
      : a(moving_person(frames, kRate, {-0.5, 0, 0})),
        b(moving_person(frames, kRate, {0.5, 0, 0}, {0, 0, 0}, std::numbers::pi)) {
    for (int t = 0; t < frames; ++t)
      for (HumanMotion* who : {&a, &b})
        for (const auto& [hand, shoulder] : {std::pair{kLeftHand, kLeftShoulder}, {kRightHand, kRightShoulder}})
          who->joints.at(t, hand) = who->joints.at(t, shoulder) - Eigen::Vector3d(0, 0, 0.65);
  }
};

// 0 outside (begin - ramp, end + ramp), 1 inside [begin, end), linear in between.
double plateau(int t, int begin, int end, int ramp) {
  const double up = (t - (begin - ramp)) / static_cast<double>(ramp);
  const double down = (end + ramp - t) / static_cast<double>(ramp);
  return std::clamp(std::min(up, down), 0.0, 1.0);
}

TEST(PhaseProposal, AWaveIsFromTheHandHalfUpUntilItIsLowered) {
  Pair pair(300);
  for (int t = 0; t < 300; ++t) pair.a.joints.at(t, kRightHand).z() += 0.8 * plateau(t, 120, 180, 30);
  const Phases phases = propose_phases(pair.a, pair.b, Task::kWave);
  EXPECT_EQ(phases.act_begin, 101);  // 0.35 of the way up: 90 + 10.5
  EXPECT_EQ(phases.act_end, 188);    // a quarter of the way down: 180 + 7.5
}

TEST(PhaseProposal, AReplyWithinFiveSecondsBelongsToTheGesture) {
  Pair pair(900);
  for (int t = 0; t < 900; ++t) {
    pair.a.joints.at(t, kRightHand).z() += 0.8 * plateau(t, 120, 180, 30);
    pair.b.joints.at(t, kLeftHand).z() += 0.5 * plateau(t, 400, 450, 30);
  }
  EXPECT_EQ(propose_phases(pair.a, pair.b, Task::kFlyKiss), (Phases{.act_begin = 101, .act_end = 458}));
}

TEST(PhaseProposal, ABowIsFromUprightToUpright) {
  Pair pair(200);
  for (int t = 0; t < 200; ++t) {
    const Eigen::Vector3d pelvis = pair.b.joints.at(t, kPelvis);
    const Eigen::AngleAxisd bow(-0.8 * plateau(t, 80, 120, 40), Eigen::Vector3d::UnitY());
    pair.b.joints.at(t, kNeck) = pelvis + bow * (Eigen::Vector3d(pair.b.joints.at(t, kNeck)) - pelvis);
  }
  const Phases phases = propose_phases(pair.a, pair.b, Task::kBend);
  EXPECT_NEAR(phases.act_begin, 46, 2);
  EXPECT_NEAR(phases.act_end, 155, 2);
}

TEST(PhaseProposal, AHandshakeIsWhileTheHandsAreTogether) {
  Pair pair(200);
  for (int t = 0; t < 200; ++t) {  // B's right hand is on A's left: both reach for the middle
    const double s = plateau(t, 80, 120, 30);
    for (HumanMotion* who : {&pair.a, &pair.b}) {
      const Eigen::Vector3d rest = who->joints.at(t, kRightHand);
      const Eigen::Vector3d meet(who == &pair.a ? -0.03 : 0.03, 0.0, 1.0);
      who->joints.at(t, kRightHand) = rest + s * (meet - rest);
    }
  }
  const Phases phases = propose_phases(pair.a, pair.b, Task::kHandshake);
  EXPECT_LE(phases.act_begin, 76);
  EXPECT_GE(phases.act_begin, 55);
  EXPECT_GE(phases.act_end, 120);
  EXPECT_LE(phases.act_end, 135);
}

TEST(PhaseProposal, WithoutAGestureItIsTheMiddleThird) {
  const Pair pair(90);
  EXPECT_EQ(propose_phases(pair.a, pair.b, Task::kWave), (Phases{.act_begin = 30, .act_end = 60}));
}

TEST(PhaseProposal, AlwaysHoldsAnActInsideTheMotion) {
  for (const Task task : all_tasks())
    for (const int frames : {1, 2, 3, 10}) {
      const Pair pair(frames);
      const Phases phases = propose_phases(pair.a, pair.b, task);
      EXPECT_LE(0, phases.act_begin);
      EXPECT_LT(phases.act_begin, phases.act_end);
      EXPECT_LE(phases.act_end, frames);
    }
}

TEST(PhaseProposal, MotionsOfDifferentLengthAreRefused) {
  const Pair pair(10);
  EXPECT_SENTENCE(
      thrown_message<std::invalid_argument>([&] { (void)propose_phases(pair.a, slice(pair.b, 0, 9), Task::kHug); }));
}

// Synthetic clips know their phases. Agreement: frames in both acts over frames in either.
TEST(PhaseProposal, AgreesWithSyntheticClips) {
  for (const Task task : all_tasks())
    for (int index = 0; index < 4; ++index) {
      SynthesisOptions options;
      options.index = index;
      const InteractionClip clip = synthesize(task, options);
      const Phases proposed = propose_phases(clip.a, clip.b, task);
      const int both =
          std::min(proposed.act_end, clip.phases.act_end) - std::max(proposed.act_begin, clip.phases.act_begin);
      const int any =
          std::max(proposed.act_end, clip.phases.act_end) - std::min(proposed.act_begin, clip.phases.act_begin);
      EXPECT_GE(both, 0.7 * any) << to_string(task) << " " << index;
    }
}

}  // namespace
}  // namespace duet
