// Parts that recordings lack and duet makes up: legs, a partner, gaps, frames between those of a low rate.
#include "duet/motion/people/made_up.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "duet/core/require.h"
#include "duet/motion/people/people_detection.h"
#include "duet/motion/people/source_clip.h"
#include "duet/motion/plausibility.h"
#include "tests/motion/people_standins.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::FileWorld;
using test::standin_clip;
using test::thrown_message;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

constexpr double kMillimetre = 1e-3;

const std::vector<std::string> kEight = {"head",       "neck",        "left_shoulder", "right_shoulder",
                                         "left_elbow", "right_elbow", "left_hand",     "right_hand"};

std::vector<std::string> and_more(std::vector<std::string> names, const std::vector<std::string>& more) {
  names.insert(names.end(), more.begin(), more.end());
  return names;
}

JointLayout upper_layout(const std::vector<std::string>& names = kEight) {
  JointLayout layout = layout_of_names("upper", names, Legs::kMadeUp);
  layout.has_gaps = true;
  return layout;
}

// The columns of the stand-in that the file has.
RawPeople upper_people(const InteractionClip& clip, const JointLayout& layout, const FileWorld& world = {}) {
  RawPeople people = test::standin_people(clip, layout, world);
  for (PointTracks& joints : people.joints) {
    PointTracks in_file(joints.frames(), joints.points() - layout.made_up);
    for (int t = 0; t < joints.frames(); ++t) in_file.frame(t) = joints.frame(t).leftCols(in_file.points());
    joints = in_file;
  }
  return people;
}

std::string refusal(const RawPeople& people, const PeopleOptions& options = {}) {
  return thrown_message<InputError>([&] { (void)clip_of(people, options); });
}

double to_hand(const InteractionClip& clip, int frame) {
  return (clip.a.joints.at(frame, kRightHand) - clip.b.joints.at(frame, kRightHand)).norm();
}

TEST(MadeUpLegs, StandStraightBelowUpperBodiesInAnyAxesAndUnit) {
  const InteractionClip clip = standin_clip(60, 50.0);
  const JointLayout layout = upper_layout();
  EXPECT_EQ(layout.made_up, 6);
  for (const Axis up : {Axis::kPlusX, Axis::kMinusY, Axis::kPlusZ})
    for (const LengthUnit& unit : kLengthUnits) {
      const SourceClip found =
          clip_of(upper_people(clip, layout, {.M = rotation_of(up).transpose() / unit.metres, .p = {0.0, 0.0, 0.7}}));
      EXPECT_THAT(made_up_of(found.clip.source), ElementsAre(Pair("legs", 1.0)));
      EXPECT_THAT(found.evidence, Contains(HasSubstr("below the neck, facing as the shoulders do")));
      for (const int t : {0, 30, 59}) {
        EXPECT_NEAR(to_hand(found.clip, t), to_hand(clip, t), kMillimetre) << unit.name;
        for (const HumanMotion* person : {&found.clip.a, &found.clip.b}) {
          const Eigen::Vector3d hip = person->joints.at(t, kLeftHip), ankle = person->joints.at(t, kLeftAnkle);
          EXPECT_LT((hip - ankle).head<2>().norm(), kMillimetre);
          EXPECT_NEAR(ankle.z(), 0.07, 0.02);
          EXPECT_LT((hip - person->joints.at(t, kNeck)).head<2>().norm(), 0.12);
          EXPECT_GT(stature(*person), 1.3);
        }
        EXPECT_NEAR(std::remainder(heading(found.clip.a.joints, t) - heading(clip.a.joints, t), 2.0 * std::numbers::pi),
                    0.0, 0.3);
      }
    }
}

TEST(MadeUpLegs, HangOnHipsOrPelvisWhereTheseAreKnown) {
  const InteractionClip clip = standin_clip(60, 50.0);
  const JointLayout hips = upper_layout(and_more(kEight, {"left_hip", "right_hip"}));
  EXPECT_EQ(hips.made_up, 4);
  const SourceClip with_hips = clip_of(upper_people(clip, hips));
  EXPECT_THAT(with_hips.evidence, Contains(HasSubstr("below the hips")));
  EXPECT_LT((with_hips.clip.a.joints.at(9, kLeftHip) - with_hips.clip.a.joints.at(9, kRightHip) -
             clip.a.joints.at(9, kLeftHip) + clip.a.joints.at(9, kRightHip))
                .norm(),
            kMillimetre);
  const SourceClip with_pelvis = clip_of(upper_people(clip, upper_layout(and_more(kEight, {"pelvis"}))));
  EXPECT_THAT(with_pelvis.evidence, Contains(HasSubstr("below the pelvis")));
  EXPECT_NEAR(with_pelvis.clip.a.joints.at(9, kPelvis).x(), clip.a.joints.at(9, kPelvis).x(), kMillimetre);
}

TEST(MadeUpLegs, StayWhereTheyAreInABow) {
  InteractionClip clip = synthesize(Task::kBend, {.seed = 5, .rate_hz = 50.0});
  const SourceClip found = clip_of(upper_people(clip, upper_layout()));
  for (int t = 0; t < found.clip.frames(); t += 10)
    EXPECT_NEAR(found.clip.a.joints.at(t, kLeftHip).z(), found.clip.a.joints.at(0, kLeftHip).z(), kMillimetre);
}

TEST(MadeUpLegs, EndOnTheFloorThatIsTold) {
  const JointLayout layout = upper_layout();
  const SourceClip found = clip_of(upper_people(standin_clip(60, 50.0), layout), {.floor = -0.1});
  EXPECT_NEAR(found.clip.a.joints.at(0, kLeftToe).z(), 0.02, 0.01);
}

TEST(MadeUpLegs, AreRefusedWhereSomeAreThereOrNothingTellsTheWorld) {
  const auto refused = [](const std::vector<std::string>& more) {
    return thrown_message<InputError>([&] { (void)upper_layout(and_more(kEight, more)); });
  };
  EXPECT_SENTENCE(refused({"left_hip"}));
  EXPECT_SENTENCE(refused({"left_hip", "right_hip", "left_knee", "right_knee"}));
  EXPECT_SENTENCE(thrown_message<InputError>([] { (void)layout_of_names("upper", kEight); }));
  const InteractionClip clip = standin_clip(60, 50.0);
  const JointLayout layout = upper_layout();
  EXPECT_SENTENCE(refusal(upper_people(clip, layout, {.M = 4.0 * Eigen::Matrix3d::Identity()})));
  const Eigen::AngleAxisd tilt(0.8, Eigen::Vector3d::UnitX());
  EXPECT_SENTENCE(refusal(upper_people(clip, layout, {.M = tilt.toRotationMatrix()})));
}

RawPeople alone(const InteractionClip& clip, const JointLayout& layout, const FileWorld& world = {}) {
  RawPeople people = test::standin_people(clip, layout, world);
  people.joints[1] = {};
  return people;
}

TEST(StillPartner, FacesTheOneWhoIsAlone) {
  const InteractionClip clip = synthesize(Task::kWave, {.seed = 3});
  const RawPeople people = alone(clip, joint_layout("kinect-20"), test::y_up(1000.0));
  const SourceClip found = clip_of(people, {.still_partner = true});
  const InteractionClip& made = found.clip;
  EXPECT_THAT(made_up_of(made.source), ElementsAre(Pair("partner", 1.0)));
  EXPECT_EQ(made.reactor, Person::kA);
  EXPECT_EQ(clip_of(people, {.reactor = Person::kB, .still_partner = true}).clip.reactor, Person::kB);
  double nearest = 1e9;
  for (int t = 0; t < made.frames(); ++t) {
    EXPECT_EQ(made.b.joints.frame(t), made.b.joints.frame(0));
    nearest = std::min(nearest, (made.a.joints.at(t, kPelvis) - made.b.joints.at(t, kPelvis)).head<2>().norm());
  }
  EXPECT_NEAR(nearest, 1.5, 0.1);  // as people wave
  const Eigen::Vector3d to_a = made.a.joints.at(0, kPelvis) - made.b.joints.at(0, kPelvis);
  EXPECT_NEAR(std::remainder(heading(made.b.joints, 0) - std::atan2(to_a.y(), to_a.x()), 2.0 * std::numbers::pi), 0.0,
              0.5);
  EXPECT_NEAR(made.b.joints.at(0, kLeftToe).z(), 0.02, 0.01);
  EXPECT_TRUE(judge_people(made).faults.empty());
}

TEST(FillGaps, OfWhatLengthIsToldAndAlsoAtTheEnds) {
  const InteractionClip clip = standin_clip(60, 30.0);
  RawPeople people = test::standin_people(clip, joint_layout("kinect-25"));
  for (int t = 20; t < 38; ++t) people.joints[0].at(t, 6).setConstant(std::nan(""));  // .6 s
  EXPECT_SENTENCE(refusal(people));
  EXPECT_SENTENCE(refusal(people, {.fill_gaps = 0.5}));
  const SourceClip filled = clip_of(people, {.fill_gaps = 0.6});
  EXPECT_THAT(made_up_of(filled.clip.source), ElementsAre(Pair("gaps", 0.3)));
  EXPECT_EQ(made_up_kinds(filled.clip.source), "gaps");
  for (int t = 0; t < 5; ++t) people.joints[1].at(t, 3).setConstant(std::nan(""));
  for (int t = 57; t < 60; ++t) people.joints[1].at(t, 6).setConstant(std::nan(""));
  EXPECT_SENTENCE(refusal(people, {.fill_gaps = 0.1}));
  const SourceClip held = clip_of(people, {.fill_gaps = 0.6, .output_rate_hz = 30.0});
  EXPECT_EQ(held.clip.b.joints.at(0, kHead), held.clip.b.joints.at(5, kHead));
  EXPECT_EQ(held.clip.b.joints.at(59, kLeftWrist), held.clip.b.joints.at(56, kLeftWrist));
  EXPECT_THAT(held.evidence, Contains(HasSubstr("at the ends with the nearest position")));
  for (int t = 0; t < 60; ++t) people.joints[1].at(t, 3).setConstant(std::nan(""));
  EXPECT_SENTENCE(refusal(people, {.fill_gaps = 9.0}));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)clip_of(people, {.fill_gaps = -1.0}); }));
}

TEST(LowRate, OfSevenHertzIsReadResampledAndCounted) {
  const InteractionClip clip = standin_clip(250, 50.0);
  InteractionClip slow;
  slow.task = clip.task;
  slow.a = resample(clip.a, 7.0);
  slow.b = resample(clip.b, 7.0);
  const RawPeople people = test::standin_people(slow, joint_layout("kinect-25"));
  const SourceClip found = clip_of(people);
  EXPECT_EQ(found.clip.rate_hz(), 50.0);
  EXPECT_EQ(found.clip.frames(), resampled_frames(slow.frames(), 7.0, 50.0));
  EXPECT_NEAR(made_up_of(found.clip.source).at("rate"), 0.86, 1e-3);
  EXPECT_THAT(found.evidence, Contains("rate: 86 % of the frames lie between recorded ones"));
  double farthest = 0.0;
  for (int t = 0; t < found.clip.frames(); ++t)
    farthest = std::max(farthest, (found.clip.a.joints.at(t, kRightHand) - clip.a.joints.at(t, kRightHand)).norm());
  EXPECT_LT(farthest, 0.1);
}

TEST(MadeUp, KindsOfAFileThatNobodyKnowsAreLeftOut) {
  EXPECT_EQ(made_up_kinds({{"made_up.legs", "1"}, {"made_up.<b>", "1"}, {"made_up.gaps", "much"}}), "gaps+legs");
}

}  // namespace
}  // namespace duet
