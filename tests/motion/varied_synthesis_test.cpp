// Clips that vary: what is drawn covers what people do, and what nobody may count or foresee.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/motion/people/tracked_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/tasks/task_definition.h"
#include "tests/support.h"

namespace duet {
namespace {

InteractionClip varied(Task task, SynthesisOptions options = {}) {
  options.like = Likeness::kVaried;
  return synthesize(task, options);
}

// The values drawn of a quantity, over clips of a task.
std::vector<double> drawn(Task task, const std::string& quantity, int clips, SynthesisOptions options = {}) {
  std::vector<double> values;
  options.rate_hz = 20.0;
  for (options.index = 0; options.index < clips; ++options.index)
    values.push_back(std::stod(varied(task, options).source.at(quantity)));
  return values;
}

double moved(const HumanMotion& person, SmplJoint joint) {
  double farthest = 0.0;
  for (int t = 1; t < person.frames(); ++t)
    farthest = std::max(farthest, (person.joints.at(t, joint) - person.joints.at(0, joint)).norm());
  return farthest;
}

std::string refused(Task task, const SynthesisOptions& options) {
  return test::thrown_message<std::invalid_argument>([&] { (void)synthesize(task, options); });
}

TEST(VariedSynthesis, SeedAndIndexDecide) {
  for (const Task task : all_tasks()) {
    const InteractionClip clip = varied(task, {.seed = 3, .index = 2, .rate_hz = 20.0});
    EXPECT_EQ(clip.a.joints, varied(task, {.seed = 3, .index = 2, .rate_hz = 20.0}).a.joints) << to_string(task);
    EXPECT_NE(clip.a.joints, varied(task, {.seed = 4, .index = 2, .rate_hz = 20.0}).a.joints) << to_string(task);
    EXPECT_EQ(clip.id, "varied-" + std::string(to_string(task)) + "-s3-0002");
    EXPECT_EQ(clip.source.at("like"), "varied");
  }
}

TEST(VariedSynthesis, AllTasksAreValidAndTheirContactsHold) {
  for (const Task task : all_tasks()) {
    const double within = definition_of(task).act.touch_distance;
    for (int index = 0; index < 40; ++index) {
      const InteractionClip clip = varied(task, {.seed = 5, .index = index, .rate_hz = 20.0});
      ASSERT_NO_THROW(validate(clip)) << clip.id;
      if (task == Task::kHug) continue;  // hands that the body stops may stay farther from the spine
      for (const ContactWindow& window : clip.contacts)
        for (int t = window.begin; t < window.end; ++t)
          ASSERT_LT((clip.a.joints.at(t, window.joint_a) - clip.b.joints.at(t, window.joint_b)).norm(), within + 0.05)
              << clip.id << " frame " << t;
    }
  }
}

// Level, from where the hips face. [deg]
double deviation(const HumanMotion& person, const HumanMotion& other, int t) {
  const Eigen::Vector3d hips = person.joints.at(t, kLeftHip) - person.joints.at(t, kRightHip);
  const Eigen::Vector3d way = other.joints.at(t, kPelvis) - person.joints.at(t, kPelvis);
  const double angle = std::atan2(way.y(), way.x()) - std::atan2(-hips.x(), hips.y());
  return std::remainder(angle, 2.0 * std::numbers::pi) * 180.0 / std::numbers::pi;
}

// Measured on 22 handshakes of K3HI and 18 of SBU: 34 % left hands in K3HI, 3 % in SBU; hips from -50 to 59 degrees
// (10 and 90 %); roots .94 to 1.26 m apart (K3HI), source Q .88, CMU .74 m; hands together 1.2 to 2.1 s.
TEST(VariedSynthesis, HandshakesCoverThoseOfPeople) {
  std::vector<double> hips, distance, touch;
  int left = 0, clips = 0;
  for (int index = 0; index < 120; ++index) {
    const InteractionClip clip =
        varied(Task::kHandshake, {.seed = 9, .index = index, .rate_hz = 20.0, .outcome = ActOutcome::kComplete});
    ASSERT_FALSE(clip.contacts.empty());
    const ContactWindow& window = clip.contacts[0];
    const int middle = (window.begin + window.end) / 2;
    hips.push_back(deviation(clip.a, clip.b, middle));
    hips.push_back(deviation(clip.b, clip.a, middle));
    distance.push_back((clip.a.joints.at(middle, kPelvis) - clip.b.joints.at(middle, kPelvis)).head<2>().norm());
    touch.push_back((window.end - window.begin) / clip.rate_hz());
    left += clip.source.at("side") == "left";
    ++clips;
  }
  EXPECT_NEAR(left, 0.5 * clips, 3.5 * std::sqrt(0.25 * clips));
  EXPECT_LT(quantile(hips, 0.1), -50.0);
  EXPECT_GT(quantile(hips, 0.9), 50.0);
  EXPECT_LT(quantile(distance, 0.05), 0.88);
  EXPECT_GT(quantile(distance, 0.95), 1.26);
  EXPECT_LT(quantile(touch, 0.1), 1.17);
  EXPECT_GT(quantile(touch, 0.9), 2.10);
}

// Heads of Kinder's ten people are from 1.51 to 1.74 m over the floor, and their bows, 35 to 60 degrees.
TEST(VariedSynthesis, BodiesAreSmallAndTall) {
  const std::vector<double> heights = drawn(Task::kBend, "a.height", 100);
  EXPECT_LT(quantile(heights, 0.1), 1.62);
  EXPECT_GT(quantile(heights, 0.9), 1.86);
  EXPECT_GE(*std::ranges::min_element(heights), 1.5);
  EXPECT_LE(*std::ranges::max_element(heights), 1.95);
}

// The mirror image of a clip is made of it: the same draws without the mirror give the clip itself.
TEST(VariedSynthesis, HalfOfTheClipsAreMirroredAndTheSideIsThatOfTheHandThatActs) {
  int turned = 0;
  for (int index = 0; index < 100; ++index) {
    const InteractionClip clip =
        varied(Task::kHandshake, {.seed = 2, .index = index, .rate_hz = 20.0, .outcome = ActOutcome::kComplete});
    turned += clip.source.at("mirrored") == "yes";
    const int hand = clip.source.at("side") == "left" ? kLeftHand : kRightHand;
    EXPECT_EQ(clip.contacts.at(0).joint_a, hand) << clip.id;
    EXPECT_EQ(clip.contacts.at(0).joint_b, hand) << clip.id;
  }
  EXPECT_NEAR(turned, 50, 17);
}

TEST(VariedSynthesis, ASideThatIsAskedForIsGivenMirroredOrNot) {
  std::set<std::string> mirrors;
  for (int index = 0; index < 12; ++index) {
    const InteractionClip clip =
        varied(Task::kHighFive,
               {.seed = 2, .index = index, .side = Side::kLeft, .rate_hz = 20.0, .outcome = ActOutcome::kComplete});
    mirrors.insert(clip.source.at("mirrored"));
    EXPECT_EQ(clip.source.at("side"), "left");
    EXPECT_EQ(clip.contacts.at(0).joint_a, kLeftHand) << clip.id;
  }
  EXPECT_EQ(mirrors.size(), 2U);
}

// As many of those who have waited for the mean wait that long again as did in the first place.
TEST(VariedSynthesis, WaitsHaveNoMemory) {
  constexpr int kClips = 400;
  const std::vector<double> waits = drawn(Task::kHandshake, "wait", kClips, {.wait = 3.0});
  const auto longer = [&](double than) {
    return static_cast<double>(std::ranges::count_if(waits, [&](double wait) { return wait > than; }));
  };
  const double share = std::exp(-1.0), tolerance = 3.5 * std::sqrt(share * (1.0 - share));
  EXPECT_NEAR(longer(3.0) / kClips, share, tolerance / std::sqrt(kClips));
  EXPECT_NEAR(longer(6.0) / longer(3.0), share, tolerance / std::sqrt(longer(3.0)));
  const InteractionClip quiet = varied(Task::kHandshake, {.index = 1, .wait = 0.0});
  const InteractionClip waiting = varied(Task::kHandshake, {.index = 1, .wait = 8.0});
  EXPECT_NEAR((waiting.frames() - quiet.frames()) / 50.0, std::stod(waiting.source.at("wait")), 0.05);
}

TEST(VariedSynthesis, HalfOfTheGesturesAreMadeBeforeSomebodyWhoStandsStill) {
  for (const Task task : {Task::kWave, Task::kBend, Task::kFlyKiss}) {
    int still = 0;
    for (int index = 0; index < 60; ++index) {
      const InteractionClip clip =
          varied(task, {.seed = 4, .index = index, .rate_hz = 20.0, .outcome = ActOutcome::kComplete});
      const bool alone = clip.source.at("still") == "yes";
      still += alone;
      // The robot takes the place of the one who acts.
      EXPECT_EQ(clip.reactor, alone ? Person::kA : Person::kB) << clip.id;
      const SmplJoint sign = task == Task::kBend ? kHead : clip.source.at("side") == "left" ? kLeftHand : kRightHand;
      EXPECT_GT(moved(clip.a, sign), 0.2) << clip.id;
      if (alone) {
        for (const SmplJoint joint : {kHead, kLeftHand, kRightHand}) EXPECT_LT(moved(clip.b, joint), 0.15) << clip.id;
      } else {
        EXPECT_GT(moved(clip.b, sign), 0.2) << clip.id;
      }
    }
    EXPECT_NEAR(still, 30, 14) << to_string(task);
    EXPECT_EQ(varied(task, {.still = true}).source.at("still"), "yes");
    EXPECT_EQ(varied(task, {.still = false}).source.at("still"), "no");
  }
}

TEST(VariedSynthesis, SomeUseBothHands) {
  int both = 0;
  for (int index = 0; index < 40; ++index) {
    const InteractionClip clip =
        varied(Task::kFlyKiss, {.seed = 4, .index = index, .rate_hz = 20.0, .outcome = ActOutcome::kComplete});
    if (clip.source.at("a.both_hands") == "no") continue;
    ++both;
    EXPECT_GT(moved(clip.a, kLeftHand), 0.25) << clip.id;
    EXPECT_GT(moved(clip.a, kRightHand), 0.25) << clip.id;
  }
  EXPECT_GT(both, 2);
  EXPECT_LT(both, 20);
}

TEST(VariedSynthesis, OptionsThatAreNotItsOwnAreRefused) {
  const std::string message = "synthesize: wait and still are of clips that vary; expected like=varied";
  EXPECT_EQ(refused(Task::kWave, {.like = Likeness::kPeople, .wait = 2.0}), message);
  EXPECT_EQ(refused(Task::kWave, {.still = true}), message);
  EXPECT_EQ(refused(Task::kHug, {.like = Likeness::kVaried, .still = true}),
            "synthesize: hug needs both people; expected no value of still, found true");
  EXPECT_EQ(refused(Task::kHug, {.like = Likeness::kVaried, .before = 1.0, .wait = 2.0}),
            "synthesize: wait draws what before gives; expected one of them");
  EXPECT_SENTENCE(refused(Task::kHug, {.like = Likeness::kVaried, .wait = 31.0}));
  EXPECT_SENTENCE(refused(Task::kHug, {.duration = 12.0, .like = Likeness::kVaried}));
}

// One tracker is not like another: their rates and the places of feet and head differ.
TEST(VariedSynthesis, TrackersVaryToo) {
  std::set<double> rates, feet;
  for (int index = 0; index < 12; ++index) {
    const TrackerModel tracker = tracker_of(varied(Task::kWave, {.index = index, .rate_hz = 20.0}), 1);
    rates.insert(tracker.rate_hz);
    feet.insert(tracker.feet);
  }
  EXPECT_EQ(rates, (std::set<double>{15.0, 30.0}));
  EXPECT_EQ(feet.size(), 12U);
  EXPECT_EQ(tracker_of(synthesize(Task::kWave, {.like = Likeness::kPeople}), 1).feet, TrackerModel{}.feet);
}

}  // namespace
}  // namespace duet
