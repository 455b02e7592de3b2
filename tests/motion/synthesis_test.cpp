#include "duet/motion/synthesis/synthesis.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <span>

#include "duet/core/digest.h"
#include "duet/motion/synthesis/stage.h"
#include "duet/tasks/task_definition.h"
#include "tests/support.h"

namespace duet {
namespace {

std::string digest(const InteractionClip& clip) {
  Sha256 hash;
  for (const HumanMotion* motion : {&clip.a, &clip.b}) {
    hash.update(motion->joints.data());
    for (const Eigen::Quaterniond& q : motion->rotations) hash.update(std::span<const double>(q.coeffs().data(), 4));
  }
  return hash.hex();
}

std::string refused(Task task, const SynthesisOptions& options) {
  return test::thrown_message<std::invalid_argument>([&] { (void)synthesize(task, options); });
}

// Keys of `source` whose values differ between two clips.
std::set<std::string> changed(const InteractionClip& a, const InteractionClip& b) {
  std::set<std::string> keys;
  for (const auto& [key, value] : a.source)
    if (!b.source.contains(key) || b.source.at(key) != value) keys.insert(key);
  for (const auto& [key, value] : b.source)
    if (!a.source.contains(key)) keys.insert(key);
  return keys;
}

double root_distance(const InteractionClip& clip, int frame) {
  return (clip.a.joints.at(frame, kPelvis) - clip.b.joints.at(frame, kPelvis)).head<2>().norm();
}

double path_length(const PointTracks& joints, int joint, int begin, int end) {
  double length = 0.0;
  for (int t = begin + 1; t < end; ++t) length += (joints.at(t, joint) - joints.at(t - 1, joint)).norm();
  return length;
}

TEST(Synthesis, SameArgumentsGiveTheSameBytes) {
  for (const Task task : all_tasks()) {
    SynthesisOptions options;
    options.index = 4;
    const InteractionClip first = synthesize(task, options), second = synthesize(task, options);
    EXPECT_EQ(digest(first), digest(second)) << to_string(task);
    EXPECT_EQ(first.source, second.source);
    EXPECT_EQ(first.phases, second.phases);
    EXPECT_EQ(first.contacts, second.contacts);
  }
}

TEST(Synthesis, SeedIndexAndTaskChangeTheMotion) {
  std::set<std::string> digests;
  for (const Task task : {Task::kWave, Task::kBend})
    for (const std::uint64_t seed : {42u, 43u})
      for (const int index : {0, 1}) digests.insert(digest(synthesize(task, {.seed = seed, .index = index})));
  EXPECT_EQ(digests.size(), 8u);
}

TEST(Synthesis, NamesTheClipAndRecordsWhatWasDrawn) {
  const InteractionClip clip = synthesize(Task::kHighFive, {.seed = 42, .index = 7});
  EXPECT_EQ(clip.id, "synth-high_five-s42-0007");
  EXPECT_EQ(clip.task, Task::kHighFive);
  EXPECT_EQ(clip.reactor, Person::kB);
  for (const char* key : {"generator", "seed", "index", "a.height", "b.height", "distance", "angle", "side", "speed",
                          "style", "duration", "target_height", "act.distance", "b.reaction"})
    EXPECT_TRUE(clip.source.contains(key)) << key;
}

void expect_contacts_hold(const InteractionClip& clip) {
  const double within = definition_of(clip.task).act.touch_distance;
  EXPECT_EQ(clip.contacts.empty(), within == 0.0) << clip.id;
  for (const ContactWindow& window : clip.contacts) {
    EXPECT_GE(window.begin, clip.phases.act_begin);
    EXPECT_LE(window.end, clip.phases.act_end + 1);
    for (int t = window.begin; t < window.end; ++t)
      ASSERT_LT((clip.a.joints.at(t, window.joint_a) - clip.b.joints.at(t, window.joint_b)).norm(), within)
          << clip.id << " frame " << t;
  }
}

TEST(Synthesis, TwentyClipsOfEachTaskAreValidAndTheirContactsHold) {
  for (const Task task : all_tasks())
    for (int index = 0; index < 20; ++index) {
      const InteractionClip clip = synthesize(task, {.seed = 5, .index = index});
      ASSERT_NO_THROW(validate(clip)) << clip.id;
      EXPECT_EQ(clip.rate_hz(), 50.0);
      EXPECT_GT(clip.phases.act_begin, 0);
      EXPECT_LT(clip.phases.act_begin, clip.phases.act_end);
      EXPECT_LT(clip.phases.act_end, clip.frames());
      EXPECT_EQ(clip.a.rotations.size(), static_cast<size_t>(clip.frames()) * kSmplJoints);
      for (const ContactWindow& window : clip.contacts) EXPECT_GE(window.end - window.begin, 5) << clip.id;
      expect_contacts_hold(clip);
    }
}

TEST(Synthesis, ContactsHoldForAllBodiesSidesAndTargetHeights) {
  for (const Task task : {Task::kHug, Task::kHandshake, Task::kHighFive}) {
    const synthesis::Act& act = definition_of(task).act;
    for (int corner = 0; corner < 32; ++corner) {
      SynthesisOptions options;
      options.height_a = corner & 1 ? 1.5 : 1.95;
      options.height_b = corner & 2 ? 1.5 : 1.95;
      options.side = corner & 4 ? Side::kLeft : Side::kRight;
      options.target_height = corner & 8 ? act.lowest : act.highest;
      options.distance = corner & 16 ? 2.0 : 5.0;
      options.rate_hz = 25.0;  // only to save time
      expect_contacts_hold(synthesize(task, options));
    }
  }
}

TEST(Synthesis, MeanDurationsAreThoseOfTableS6) {
  const std::map<Task, double> mean = {{Task::kHug, 25.9},  {Task::kHandshake, 22.9}, {Task::kHighFive, 16.1},
                                       {Task::kBend, 17.6}, {Task::kFlyKiss, 17.9},   {Task::kWave, 18.6}};
  constexpr int kClips = 200;
  for (const Task task : kPaperTasks) {
    double sum = 0.0;
    for (int index = 0; index < kClips; ++index) {
      synthesis::Draws draws(42, task, index);
      const double seconds = synthesis::set_stage(task, {.index = index}, draws).frames / 50.0;
      EXPECT_GE(seconds, 0.79 * mean.at(task));
      EXPECT_LE(seconds, 1.21 * mean.at(task));
      sum += seconds;
    }
    // Uniform within +-20 %: three standard errors of the mean are 3 * 0.2 / sqrt(3 n) = 2.5 %.
    EXPECT_NEAR(sum / kClips, mean.at(task), 0.025 * mean.at(task)) << to_string(task);
  }
}

TEST(Synthesis, HonoursHeightsDistanceAngleAndSpeed) {
  SynthesisOptions options;
  options.height_a = 1.55;
  options.height_b = 1.90;
  options.distance = 4.5;
  options.angle = 0.4;
  options.speed = 0.8;
  const InteractionClip clip = synthesize(Task::kHandshake, options);
  // Thighs are 0.245 of the height, give or take the legs' share of 2.5 %.
  EXPECT_NEAR(bone_lengths(clip.a)[kLeftKnee], 0.245 * 1.55, 0.026 * 0.245 * 1.55);
  EXPECT_NEAR(bone_lengths(clip.b)[kLeftKnee], 0.245 * 1.90, 0.026 * 0.245 * 1.90);
  // Sway moves a standing root by less than 2 cm.
  EXPECT_NEAR(root_distance(clip, 0), 4.5, 0.04);
  const Eigen::Vector3d towards_b = clip.b.joints.at(0, kPelvis) - clip.a.joints.at(0, kPelvis);
  EXPECT_NEAR(std::atan2(towards_b.y(), towards_b.x()) - heading(clip.a.joints, 0), 0.4, 0.06);
  double fastest = 0.0;  // along A's way; over 0.2 s, so that sway and bob do not count
  for (int t = 10; t < clip.phases.act_begin; ++t)
    fastest =
        std::max(fastest, (clip.a.joints.at(t, kPelvis) - clip.a.joints.at(t - 10, kPelvis)).head<2>().norm() / 0.2);
  EXPECT_NEAR(fastest, 0.8, 0.06);
}

TEST(Synthesis, HonoursSideAndMirrorsTheHandedness) {
  for (const Task task : {Task::kHandshake, Task::kHighFive, Task::kWave, Task::kFlyKiss})
    for (const Side side : {Side::kLeft, Side::kRight}) {
      SynthesisOptions options;
      options.side = side;
      const InteractionClip clip = synthesize(task, options);
      const int acting = side == Side::kLeft ? kLeftHand : kRightHand;
      for (const ContactWindow& window : clip.contacts) {
        EXPECT_EQ(window.joint_a, acting);
        EXPECT_EQ(window.joint_b, acting);
      }
      for (const HumanMotion* person : {&clip.a, &clip.b}) {
        const int from = clip.phases.act_begin, to = clip.phases.act_end;
        EXPECT_GT(path_length(person->joints, acting, from, to),
                  2.0 * path_length(person->joints, kSmplMirror[acting], from, to))
            << to_string(task);
      }
    }
}

TEST(Synthesis, HonoursTheTargetHeight) {
  for (const Task task : {Task::kHug, Task::kHandshake, Task::kHighFive}) {
    const synthesis::Act& act = definition_of(task).act;
    for (const double z : {act.lowest, act.highest}) {
      SynthesisOptions options;
      options.target_height = z;
      options.height_a = 1.70;
      options.height_b = 1.75;
      const InteractionClip clip = synthesize(task, options);
      double sum = 0.0;
      int n = 0;
      for (const ContactWindow& window : clip.contacts)
        for (int t = window.begin; t < window.end; ++t) {
          const bool hand_of_a = window.joint_a >= kLeftHand;
          sum += hand_of_a ? clip.a.joints.at(t, window.joint_a).z() : clip.b.joints.at(t, window.joint_b).z();
          ++n;
        }
      EXPECT_NEAR(sum / n, z, 0.04) << to_string(task);
    }
  }
  for (const double z : {1.5, 1.68}) {
    const InteractionClip clip = synthesize(Task::kWave, {.side = Side::kRight, .target_height = z});
    double highest = 0.0;
    for (int t = 0; t < clip.frames(); ++t) highest = std::max(highest, clip.a.joints.at(t, kRightHand).z());
    EXPECT_NEAR(highest, z, 0.03);
  }
}

TEST(Synthesis, HonoursStyleDurationAndRate) {
  SynthesisOptions restrained{.side = Side::kRight, .style = 0.0}, expansive{.side = Side::kRight, .style = 1.0};
  const auto highest_hand = [](const InteractionClip& clip) {
    double z = 0.0;
    for (int t = 0; t < clip.frames(); ++t) z = std::max(z, clip.b.joints.at(t, kRightHand).z());
    return z;
  };
  EXPECT_GT(highest_hand(synthesize(Task::kWave, expansive)), highest_hand(synthesize(Task::kWave, restrained)) + 0.1);
  const InteractionClip clip = synthesize(Task::kBend, {.duration = 31.4, .rate_hz = 100.0});
  EXPECT_EQ(clip.frames(), 3140);
  EXPECT_EQ(clip.rate_hz(), 100.0);
  EXPECT_NO_THROW(validate(clip));
}

TEST(Synthesis, OneOptionLeavesTheOtherDrawsAsTheyWere) {
  const InteractionClip plain = synthesize(Task::kWave, {.index = 2});
  EXPECT_EQ(changed(plain, synthesize(Task::kWave, {.index = 2, .speed = 0.77})), std::set<std::string>{"speed"});
  EXPECT_EQ(changed(plain, synthesize(Task::kWave, {.index = 2, .angle = 0.1})), std::set<std::string>{"angle"});
  EXPECT_EQ(changed(plain, synthesize(Task::kWave, {.index = 2, .duration = 25.0})), std::set<std::string>{"duration"});
  const Side other = plain.source.at("side") == "right" ? Side::kLeft : Side::kRight;
  EXPECT_EQ(changed(plain, synthesize(Task::kWave, {.index = 2, .side = other})),
            (std::set<std::string>{"side", "left_handed"}));
  EXPECT_EQ(changed(plain, synthesize(Task::kWave, {.index = 2, .height_a = 1.6})),
            (std::set<std::string>{"a.height", "a.target_height"}));
}

TEST(Synthesis, RefusesOptionsOutOfRangeAndNamesTheRange) {
  EXPECT_SENTENCE(refused(Task::kHug, {.index = -1}));
  EXPECT_SENTENCE(refused(Task::kHug, {.height_a = 1.2}));
  EXPECT_SENTENCE(refused(Task::kHug, {.height_b = 2.1}));
  EXPECT_SENTENCE(refused(Task::kHug, {.distance = 1.0}));
  EXPECT_SENTENCE(refused(Task::kHug, {.angle = 2.0}));
  EXPECT_SENTENCE(refused(Task::kHug, {.speed = 2.0}));
  EXPECT_SENTENCE(refused(Task::kHug, {.style = -0.1}));
  EXPECT_SENTENCE(refused(Task::kHug, {.duration = 5.0}));
  EXPECT_SENTENCE(refused(Task::kHug, {.rate_hz = 0.0}));
  EXPECT_SENTENCE(refused(Task::kHandshake, {.target_height = 2.0}));
  EXPECT_SENTENCE(refused(Task::kBend, {.target_height = 1.0}));
  const double nan = std::nan("");
  EXPECT_SENTENCE(refused(Task::kHug, {.speed = nan}));
}

TEST(Synthesis, RefusesADurationThatTheWaysDoNotFitIn) {
  const std::string message = refused(Task::kHug, {.distance = 5.0, .speed = 0.6, .duration = 10.0});
  EXPECT_NE(message.find("synthesize: duration 10 s is too short for these ways and this act; expected ["),
            std::string::npos)
      << message;
}

// The synthetic clips as they are: suites are made of them, so a number that moves here moves every published table. A
// change on purpose needs another version of the suites.

constexpr double kSame = 1e-6;  // far above what compilers and mathematical libraries differ by

// A weighted mean of all coordinates of a person, each frame and joint with a weight of its own [m].
double mark(const HumanMotion& person) {
  double sum = 0.0;
  for (int t = 0; t < person.joints.frames(); ++t)
    for (int j = 0; j < person.joints.points(); ++j)
      sum += std::cos(0.7 * t + 1.3 * j) * person.joints.at(t, j).dot(Eigen::Vector3d(1.0, 2.0, 3.0));
  return sum / std::sqrt(static_cast<double>(person.joints.frames()));
}

struct Record {
  int act_begin, act_end, frames;
  double a, b;
};

struct Case {
  Task task;
  int index;
  Record record;
};

const std::array<Case, 12> kRecords = {{
    {Task::kHug, 0, {319, 870, 1383, 0.022872581, 0.038999495}},
    {Task::kHug, 7, {295, 945, 1372, 0.039021411, 0.084322143}},
    {Task::kHandshake, 0, {268, 740, 1210, 0.068052673, 0.102310885}},
    {Task::kHandshake, 7, {225, 535, 919, 0.080058903, 0.067174007}},
    {Task::kHighFive, 0, {216, 379, 709, 0.012846758, 0.071422284}},
    {Task::kHighFive, 7, {232, 557, 886, 0.106285491, 0.172550821}},
    {Task::kWave, 0, {165, 540, 925, -0.088096871, 0.030954154}},
    {Task::kWave, 7, {150, 454, 751, 0.128312282, 0.186579400}},
    {Task::kBend, 0, {210, 569, 774, 0.027522364, -0.041441751}},
    {Task::kBend, 7, {173, 570, 951, 0.016226132, 0.039766761}},
    {Task::kFlyKiss, 0, {185, 678, 1041, -0.045831732, 0.007633927}},
    {Task::kFlyKiss, 7, {197, 697, 1016, -0.014864837, -0.003097514}},
}};

const std::array<Case, 16> kPeopleRecords = {{
    {Task::kHug, 1, {0, 62, 98, 0.174314343, 0.266180998}},
    {Task::kHug, 2, {24, 81, 109, -0.092824500, -0.032469066}},
    {Task::kHug, 3, {0, 46, 100, -0.005523994, -0.009770855}},
    {Task::kHug, 4, {8, 81, 126, 0.010023127, -0.019804916}},
    {Task::kHug, 0, {0, 63, 110, 0.021911116, 0.131747048}},
    {Task::kHug, 7, {0, 62, 105, 0.449931057, 0.542531810}},
    {Task::kHandshake, 0, {0, 68, 101, 0.088277301, -0.002235132}},
    {Task::kHandshake, 7, {0, 105, 141, 0.258804066, 0.369768922}},
    {Task::kHighFive, 0, {44, 178, 190, -0.041317520, -0.034467632}},
    {Task::kHighFive, 7, {44, 137, 158, 0.289118275, 0.538915267}},
    {Task::kWave, 0, {63, 252, 274, 0.250124261, 0.327020352}},
    {Task::kWave, 7, {36, 300, 310, 0.153902345, 0.379227771}},
    {Task::kBend, 0, {35, 306, 322, 0.086462429, 0.124218148}},
    {Task::kBend, 7, {32, 305, 323, -0.000169700, 0.030138763}},
    {Task::kFlyKiss, 0, {68, 254, 269, 0.032169743, 0.031974538}},
    {Task::kFlyKiss, 7, {24, 214, 226, 0.008355419, -0.052087041}},
}};

void expect_records(std::span<const Case> cases, Likeness like) {
  for (const Case& c : cases) {
    SynthesisOptions options;
    options.index = c.index;
    options.like = like;
    const InteractionClip clip = synthesize(c.task, options);
    EXPECT_EQ(clip.phases.act_begin, c.record.act_begin) << to_string(c.task) << " " << c.index;
    EXPECT_EQ(clip.phases.act_end, c.record.act_end) << to_string(c.task) << " " << c.index;
    EXPECT_EQ(clip.frames(), c.record.frames) << to_string(c.task) << " " << c.index;
    EXPECT_NEAR(mark(clip.a), c.record.a, kSame) << to_string(c.task) << " " << c.index;
    EXPECT_NEAR(mark(clip.b), c.record.b, kSame) << to_string(c.task) << " " << c.index;
  }
}

TEST(SynthesisOfRecord, ClipsAreWhatTheyWere) { expect_records(kRecords, Likeness::kScripted); }
TEST(SynthesisOfRecord, ClipsLikePeopleAreWhatTheyWere) { expect_records(kPeopleRecords, Likeness::kPeople); }

}  // namespace
}  // namespace duet
