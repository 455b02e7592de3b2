// Clips like people: what was drawn, what is shown, and what a tracker makes of it.
#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "duet/motion/people/tracked_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/tasks/task_definition.h"
#include "tests/support.h"

namespace duet {
namespace {

InteractionClip people(Task task, SynthesisOptions options = {}) {
  options.like = Likeness::kPeople;
  return synthesize(task, options);
}

bool same(const InteractionClip& one, const InteractionClip& other) {
  return one.a.joints == other.a.joints && one.b.joints == other.b.joints && one.source == other.source &&
         one.phases == other.phases && one.contacts == other.contacts;
}

std::string refused(Task task, const SynthesisOptions& options) {
  return test::thrown_message<std::invalid_argument>([&] { (void)synthesize(task, options); });
}

TEST(PeopleSynthesis, SeedAndIndexDecide) {
  for (const Task task : all_tasks()) {
    EXPECT_TRUE(same(people(task, {.seed = 3, .index = 2}), people(task, {.seed = 3, .index = 2}))) << to_string(task);
    EXPECT_FALSE(same(people(task, {.seed = 3, .index = 2}), people(task, {.seed = 4, .index = 2})));
    EXPECT_FALSE(same(people(task, {.seed = 3, .index = 2}), people(task, {.seed = 3, .index = 3})));
  }
}

TEST(PeopleSynthesis, ClipsAreNamedAndLabelled) {
  const InteractionClip clip = people(Task::kHug, {.seed = 9, .index = 1, .outcome = ActOutcome::kHesitant});
  EXPECT_EQ(clip.id, "people-hug-s9-0001");
  EXPECT_EQ(clip.source.at("like"), "people");
  EXPECT_EQ(clip.source.at("outcome"), "hesitant");
  for (const char* key : {"tempo", "act.apart", "touch", "way", "overlap", "b.reaction", "before", "after", "a.height"})
    EXPECT_TRUE(clip.source.contains(key)) << key;
}

TEST(PeopleSynthesis, AllTasksAreValidAndTheirContactsHold) {
  for (const Task task : all_tasks()) {
    const double within = definition_of(task).act.touch_distance;
    for (int index = 0; index < 12; ++index) {
      const InteractionClip clip = people(task, {.seed = 5, .index = index});
      ASSERT_NO_THROW(validate(clip)) << clip.id;
      EXPECT_LT(clip.frames() / clip.rate_hz(), 12.0) << clip.id;
      if (task == Task::kHug) continue;  // hands that the body stops may stay farther from the spine
      for (const ContactWindow& window : clip.contacts)
        for (int t = window.begin; t < window.end; ++t)
          ASSERT_LT((clip.a.joints.at(t, window.joint_a) - clip.b.joints.at(t, window.joint_b)).norm(), within + 0.03)
              << clip.id << " frame " << t;
    }
  }
}

TEST(PeopleSynthesis, OutcomesAreDrawnAndCanBeAskedFor) {
  std::set<std::string> drawn;
  for (int index = 0; index < 60; ++index)
    drawn.insert(people(Task::kHandshake, {.index = index, .rate_hz = 20.0}).source.at("outcome"));
  EXPECT_EQ(drawn, (std::set<std::string>{"aborted", "complete", "hesitant"}));
  const InteractionClip aborted = people(Task::kHandshake, {.outcome = ActOutcome::kAborted});
  EXPECT_TRUE(aborted.contacts.empty());
  double nearest = 1.0;
  for (int t = 0; t < aborted.frames(); ++t)
    nearest = std::min(nearest, (aborted.a.joints.at(t, kRightHand) - aborted.b.joints.at(t, kRightHand)).norm());
  EXPECT_GT(nearest, 0.05);
  EXPECT_FALSE(people(Task::kHandshake, {.outcome = ActOutcome::kComplete}).contacts.empty());
}

TEST(PeopleSynthesis, BeforeAndAfterShowPeopleWhoStand) {
  const SynthesisOptions shown{.before = 4.0, .after = 2.0, .outcome = ActOutcome::kComplete};
  for (const Task task : {Task::kHandshake, Task::kHug, Task::kWave}) {
    const InteractionClip clip = people(task, shown), cropped = people(task, {.outcome = ActOutcome::kComplete});
    EXPECT_GT(clip.frames(), cropped.frames() + 200) << to_string(task);
    for (const HumanMotion* person : {&clip.a, &clip.b}) {
      const Eigen::Vector3d begin = person->joints.at(0, kPelvis), later = person->joints.at(150, kPelvis);
      EXPECT_LT((begin - later).head<2>().norm(), 0.03) << to_string(task);
      const int n = clip.frames();
      const Eigen::Vector3d before = person->joints.at(n - 80, kPelvis), end = person->joints.at(n - 1, kPelvis);
      EXPECT_LT((before - end).head<2>().norm(), 0.03) << to_string(task);
    }
  }
}

TEST(PeopleSynthesis, AClipThatIsCroppedToTheActShowsTheTouchBeginAndEnd) {
  for (const Task task : {Task::kHandshake, Task::kHighFive}) {
    for (int index = 0; index < 8; ++index) {
      const InteractionClip clip = people(task, {.seed = 7, .index = index, .outcome = ActOutcome::kComplete});
      ASSERT_FALSE(clip.contacts.empty()) << clip.id;
      EXPECT_GT(clip.contacts[0].begin, 0) << clip.id;
      EXPECT_LT(clip.contacts[0].end, clip.frames()) << clip.id;
    }
  }
}

TEST(PeopleSynthesis, OptionsChangeTheirQuantity) {
  EXPECT_EQ(people(Task::kHandshake, {.side = Side::kLeft}).source.at("side"), "left");
  EXPECT_EQ(people(Task::kHandshake, {.height_a = 1.9}).source.at("a.height"), "1.9");
  EXPECT_EQ(people(Task::kHandshake, {.angle = 0.1}).source.at("angle"), "0.1");
  const auto farthest = [](double distance) {
    const InteractionClip clip =
        people(Task::kHandshake, {.distance = distance, .before = 0.0, .outcome = ActOutcome::kComplete});
    return (clip.a.joints.at(0, kPelvis) - clip.b.joints.at(0, kPelvis)).head<2>().norm();
  };
  EXPECT_NEAR(farthest(2.5), 2.5, 0.1);
  EXPECT_NEAR(farthest(3.5), 3.5, 0.1);
}

TEST(PeopleSynthesis, OptionsOfTheOtherGeneratorAreRefused) {
  EXPECT_SENTENCE(refused(Task::kHug, {.duration = 12.0, .like = Likeness::kPeople}));
  const std::string message =
      "synthesize: before, after and outcome are of clips like people; expected like=people or like=varied";
  EXPECT_EQ(refused(Task::kHug, {.before = 1.0}), message);
  EXPECT_EQ(refused(Task::kHug, {.after = 1.0}), message);
  EXPECT_EQ(refused(Task::kHug, {.outcome = ActOutcome::kComplete}), message);
  EXPECT_SENTENCE(refused(Task::kHug, {.like = Likeness::kPeople, .before = 31.0}));
}

// Level, from where the hips face towards the left. [rad]
double bearing_of_other(const HumanMotion& person, const HumanMotion& other, int t) {
  const Eigen::Vector3d hips = person.joints.at(t, kLeftHip) - person.joints.at(t, kRightHip);
  const Eigen::Vector3d way = other.joints.at(t, kPelvis) - person.joints.at(t, kPelvis);
  return std::remainder(std::atan2(way.y(), way.x()) - std::atan2(-hips.x(), hips.y()), 2.0 * std::numbers::pi);
}

// In the middle of the touch; before, by as much less as they turn meanwhile, the acting hand forward.
TEST(PeopleSynthesis, WhoShakesHandsTurnsUntilTheOtherIsBeforeThatHand) {
  for (const Side side : {Side::kLeft, Side::kRight}) {
    for (int index = 0; index < 12; ++index) {
      const InteractionClip clip = people(
          Task::kHandshake,
          {.seed = 12, .index = index, .side = side, .before = 1.0, .after = 1.0, .outcome = ActOutcome::kComplete});
      const int middle = (clip.contacts.at(0).begin + clip.contacts.at(0).end) / 2;
      const double towards_hand = side == Side::kLeft ? 1.0 : -1.0;
      const HumanMotion* const both[] = {&clip.a, &clip.b};
      for (const int k : {0, 1}) {
        const std::string who = k == 0 ? "a." : "b.";
        const double bearing = std::stod(clip.source.at(who + "bearing")),
                     turn = std::stod(clip.source.at(who + "turn"));
        const auto measured = [&](int t) { return towards_hand * bearing_of_other(*both[k], *both[1 - k], t); };
        // The hips shift onto the front foot and sway; before, some are on their way.
        EXPECT_NEAR(measured(middle), bearing, 0.15) << clip.id << ' ' << k;
        EXPECT_NEAR(measured(0), bearing - turn, 0.25) << clip.id << ' ' << k;
      }
    }
  }
}

double largest_difference(const PointTracks& one, const PointTracks& other, int joint) {
  double largest = 0.0;
  for (int t = 0; t < std::min(one.frames(), other.frames()); ++t)
    largest = std::max(largest, (one.at(t, joint) - other.at(t, joint)).norm());
  return largest;
}

TEST(TrackedClip, HidesTheMotionByCentimetresAndKeepsWhatIsKnown) {
  const InteractionClip clip = people(Task::kHandshake, {.seed = 6, .outcome = ActOutcome::kComplete});
  const InteractionClip seen = add_tracker_noise(clip, {}, 1);
  EXPECT_EQ(seen.id, clip.id + "-tracked");
  EXPECT_EQ(seen.task, clip.task);
  EXPECT_EQ(seen.reactor, clip.reactor);
  EXPECT_EQ(seen.phases.act_begin, clip.phases.act_begin);
  EXPECT_EQ(seen.contacts.size(), clip.contacts.size());
  EXPECT_EQ(seen.source.at("source_rate_hz"), "15");
  EXPECT_EQ(seen.source.at("tracked"), "1");
  EXPECT_EQ(seen.source.at("outcome"), "complete");
  EXPECT_GT(largest_difference(clip.a.joints, seen.a.joints, kLeftShoulder), 0.002);
  EXPECT_LT(largest_difference(clip.a.joints, seen.a.joints, kLeftShoulder), 0.13);
}

TEST(TrackedClip, SeedDecides) {
  const InteractionClip clip = people(Task::kHug, {.seed = 6});
  EXPECT_EQ(add_tracker_noise(clip, {}, 1).a.joints, add_tracker_noise(clip, {}, 1).a.joints);
  EXPECT_NE(add_tracker_noise(clip, {}, 1).a.joints, add_tracker_noise(clip, {}, 2).a.joints);
}

TEST(TrackedClip, EachFigureHasItsEffect) {
  const InteractionClip clip = people(Task::kHandshake, {.seed = 8, .outcome = ActOutcome::kComplete});
  const TrackerModel none{.rate_hz = 50.0,
                          .noise = 0.0,
                          .drift = 0.0,
                          .limb_noise = 0.0,
                          .feet = 0.0,
                          .low_neck = 0.0,
                          .low_shoulders = 0.0,
                          .hidden_within = 0.0,
                          .lost_noise = 0.0};
  const auto change = [&](const TrackerModel& tracker, int joint) {
    return largest_difference(add_tracker_noise(clip, none, 1).a.joints, add_tracker_noise(clip, tracker, 1).a.joints,
                              joint);
  };
  TrackerModel noisy = none, drifting = none, limbs = none, lost = none, slow = none, feet = none, low = none;
  noisy.noise = 0.02;
  drifting.drift = 0.02;
  limbs.limb_noise = 0.02;
  lost.hidden_within = 10.0, lost.lost_share = 1.0, lost.lost_noise = 0.05;
  slow.rate_hz = 10.0;
  feet.feet = 0.1;
  low.low_neck = 0.1, low.low_shoulders = 0.05;
  EXPECT_GT(change(noisy, kLeftHip), 0.01);
  EXPECT_GT(change(drifting, kLeftHip), 0.01);
  EXPECT_GT(change(limbs, kRightElbow), 0.01);
  EXPECT_EQ(change(limbs, kLeftHip), 0.0);
  EXPECT_GT(change(lost, kRightElbow), 0.05);
  EXPECT_EQ(change(lost, kLeftHip), 0.0);
  EXPECT_GT(change(slow, kRightElbow), 0.002);
  EXPECT_GT(change(feet, kLeftAnkle), 0.01);
  EXPECT_NEAR(change(feet, kLeftKnee), 0.5 * change(feet, kLeftAnkle), 1e-9);
  EXPECT_EQ(change(feet, kLeftHip), 0.0);
  EXPECT_NEAR(change(low, kNeck), 0.1, 1e-9);
  EXPECT_NEAR(change(low, kRightShoulder), 0.05, 1e-9);
  EXPECT_EQ(change(low, kRightElbow), 0.0);
}

TEST(TrackedClip, ImpossibleTrackersAreRefused) {
  const InteractionClip clip = people(Task::kWave);
  const auto message = [&](const TrackerModel& tracker) {
    return test::thrown_message<std::invalid_argument>([&] { (void)add_tracker_noise(clip, tracker, 1); });
  };
  EXPECT_SENTENCE(message({.rate_hz = 4.0}));
  EXPECT_SENTENCE(message({.noise = -1.0}));
  EXPECT_SENTENCE(message({.drift_time = 0.0}));
}

}  // namespace
}  // namespace duet
