#include "duet/motion/people/source_clip.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "duet/core/require.h"
#include "duet/motion/people/people_detection.h"
#include "duet/motion/plausibility.h"
#include "tests/motion/people_standins.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::expected_clip;
using test::FileWorld;
using test::standin_clip;
using test::standin_people;
using test::thrown_message;
using test::worst_distance;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr double kMillimetre = 1e-3;
constexpr double kDegree = std::numbers::pi / 180.0;

std::string refusal(const RawPeople& people, const PeopleOptions& options = {}) {
  return thrown_message<InputError>([&] { (void)clip_of(people, options); });
}

TEST(SourceClip, EveryLayoutAndUnitComesBackAsTheClip) {
  const InteractionClip clip = standin_clip(48, 120.0);
  for (const std::string& name : joint_layout_names()) {
    const JointLayout& layout = joint_layout(name);
    for (const LengthUnit& unit : kLengthUnits) {
      const SourceClip found = clip_of(standin_people(clip, layout, {.M = Eigen::Matrix3d::Identity() / unit.metres}));
      EXPECT_LT(worst_distance(found.clip, expected_clip(clip, layout)), kMillimetre) << name << " " << unit.name;
      EXPECT_THAT(found.evidence, Contains(HasSubstr(std::string("m, ") + unit.name)));
    }
  }
}

TEST(SourceClip, EveryUpAxisComesBackAsTheClip) {
  const InteractionClip clip = standin_clip(24, 60.0);
  const JointLayout& layout = joint_layout("smpl-24");
  for (const Axis up : {Axis::kPlusX, Axis::kMinusX, Axis::kPlusY, Axis::kMinusY, Axis::kPlusZ, Axis::kMinusZ}) {
    const SourceClip found = clip_of(standin_people(clip, layout, {.M = rotation_of(up).transpose()}));
    EXPECT_THAT(found.evidence, Contains(HasSubstr("up axis: " + std::string(to_string(up)))));
    EXPECT_LT(worst_distance(found.clip, expected_clip(clip, layout)), kMillimetre) << to_string(up);
    EXPECT_NEAR(rotation_of(up).determinant(), 1.0, 1e-15);
  }
}

TEST(SourceClip, TheFloorIsPutToZero) {
  const InteractionClip clip = standin_clip(24, 60.0);
  const JointLayout& layout = joint_layout("kinect-25");
  const SourceClip found = clip_of(standin_people(clip, layout, {.p = {0, 0, 1.3}}));
  const double feet =
      found.clip.a.joints.at(0, kLeftToe).z() - expected_clip(clip, layout).a.joints.at(0, kLeftToe).z();
  EXPECT_NEAR(feet, 0.0, 0.01);  // the feet of the file say where the floor is
  EXPECT_THAT(found.evidence, Contains(HasSubstr("by the median of the lower foot; moved to 0")));
  const SourceClip told = clip_of(standin_people(clip, layout, {.p = {0, 0, 1.3}}), {.floor = -1.3});
  EXPECT_LT(worst_distance(told.clip, expected_clip(clip, layout)), kMillimetre);
}

// A camera that looked down by 10 degrees, in any direction: what is left of the tilt is less than a person's lean.
TEST(SourceClip, ACamerasTiltIsTakenOut) {
  const InteractionClip clip = standin_clip(100, 30.0);
  for (const double about : {0.0, 1.0, 2.0, 3.0, 4.0, 5.0}) {
    const Eigen::Vector3d axis(std::cos(about), std::sin(about), 0.0);
    const Eigen::Matrix3d tilt = Eigen::AngleAxisd(10.0 * kDegree, axis).toRotationMatrix();
    const RawPeople people = standin_people(clip, joint_layout("kinect-15"), {.M = tilt});
    const SourceClip found = clip_of(people);
    EXPECT_THAT(found.evidence, Contains(HasSubstr("level: turned by")));
    const Eigen::Matrix3d left =
        Eigen::Quaterniond::FromTwoVectors(found.clip.a.joints.at(0, kHead) - found.clip.a.joints.at(0, kPelvis),
                                           clip.a.joints.at(0, kHead) - clip.a.joints.at(0, kPelvis))
            .toRotationMatrix();
    EXPECT_LT(std::acos(std::min(1.0, left(2, 2))), 4.0 * kDegree) << about;
    EXPECT_THAT(clip_of(people, {.level = false}).evidence, Contains("level: the world is kept (as told)"));
  }
}

TEST(SourceClip, ALevelWorldIsKept) {
  for (const Task task : kPaperTasks) {
    const InteractionClip clip = synthesize(task, {.seed = 5});
    const JointLayout& layout = joint_layout("smpl-24");
    const SourceClip found = clip_of(standin_people(clip, layout));
    EXPECT_THAT(found.evidence, Contains(HasSubstr("level: kept"))) << to_string(task);
    EXPECT_LT(worst_distance(found.clip, expected_clip(clip, layout)), kMillimetre) << to_string(task);
  }
}

// A left-handed world: seen in toes, in a face, in knees. The right hands that met still meet.
TEST(SourceClip, AMirroredWorldIsReflected) {
  const InteractionClip clip = synthesize(Task::kHandshake, {.seed = 6});
  for (const char* name : {"smpl-24", "coco-17", "kinect-15"}) {
    const JointLayout& layout = joint_layout(name);
    FileWorld world;
    world.M(1, 1) = -1.0;
    const SourceClip found = clip_of(standin_people(clip, layout, world));
    EXPECT_THAT(found.evidence, Contains(HasSubstr("mirror: left and right are exchanged"))) << name;
    EXPECT_LT(worst_distance(found.clip, expected_clip(clip, layout)), kMillimetre) << name;
    EXPECT_THAT(clip_of(standin_people(clip, layout)).evidence, Contains(HasSubstr("mirror: no"))) << name;
  }
  FileWorld world;
  world.M(1, 1) = -1.0;
  const RawPeople people = standin_people(clip, joint_layout("smpl-24"), world);
  EXPECT_SENTENCE(refusal(people, {.mirrored = false}));
}

TEST(SourceClip, TheRateOfTheFileIsNeededAndOverridden) {
  const InteractionClip clip = standin_clip(24, 60.0);
  RawPeople people = standin_people(clip, joint_layout("smpl-24"));
  EXPECT_EQ(clip_of(people, {.rate_hz = 120.0}).clip.frames(), 10);
  EXPECT_EQ(clip_of(people, {.output_rate_hz = 60.0}).clip.frames(), 24);
  people.rate_hz = 0.0;
  EXPECT_SENTENCE(refusal(people));
  EXPECT_SENTENCE(refusal(people, {.rate_hz = -1.0}));
  EXPECT_SENTENCE(refusal(people, {.rate_hz = 1e4}));
}

TEST(SourceClip, ShortGapsAreFilledAndCounted) {
  const InteractionClip clip = standin_clip(48, 60.0);
  const JointLayout& layout = joint_layout("kinect-25");
  RawPeople people = standin_people(clip, layout);
  for (const int t : {20, 21, 22}) people.joints[1].at(t, 6).setConstant(std::nan(""));
  const SourceClip found = clip_of(people);
  EXPECT_THAT(found.evidence, Contains(HasSubstr("gaps: 1 stretches of a joint not seen, 3 positions, the longest 3")));
  EXPECT_EQ(found.clip.source.at("interpolated"), "true");
  EXPECT_LT(worst_distance(found.clip, expected_clip(clip, layout)), 0.01);
  people.joints[1].at(10, 22).setConstant(std::nan(""));  // a thumb, which nothing is made of
  EXPECT_NO_THROW((void)clip_of(people));
}

TEST(SourceClip, LongGapsAndDamagedValuesAreRefusedWithTheirPlace) {
  const InteractionClip clip = standin_clip(48, 60.0);
  RawPeople people = standin_people(clip, joint_layout("kinect-25"));
  for (int t = 10; t < 40; ++t) people.joints[0].at(t, 6).setConstant(std::nan(""));
  EXPECT_SENTENCE(refusal(people));
  people = standin_people(clip, joint_layout("kinect-25"));
  people.joints[1].at(47, 3).setConstant(std::nan(""));
  EXPECT_SENTENCE(refusal(people));
  people.joints[1].at(47, 3).setConstant(std::numeric_limits<double>::infinity());
  EXPECT_SENTENCE(refusal(people));
  people = standin_people(clip, joint_layout("smpl-24"));
  people.joints[1].at(7, kNeck).setConstant(std::nan(""));
  EXPECT_SENTENCE(refusal(people));
}

TEST(SourceClip, WhatCannotBePeopleIsRefused) {
  const InteractionClip clip = standin_clip(24, 60.0);
  const JointLayout& layout = joint_layout("smpl-24");
  RawPeople people = standin_people(clip, layout);
  people.joints[1] = people.joints[1].slice(0, 20);
  EXPECT_SENTENCE(refusal(people));
  people = standin_people(clip, layout);
  for (PointTracks& joints : people.joints) joints = joints.slice(0, 1);
  EXPECT_SENTENCE(refusal(people));
  people = standin_people(clip, layout, {.M = Eigen::Matrix3d::Identity() * 4.0});
  EXPECT_SENTENCE(refusal(people));
  people = standin_people(clip, layout, {.M = Eigen::AngleAxisd(0.8, Eigen::Vector3d::UnitX()).toRotationMatrix()});
  EXPECT_SENTENCE(refusal(people));
  people = standin_people(clip, layout);
  people.task.reset();
  EXPECT_SENTENCE(refusal(people));
  people.source["label"] = "kicking";
  EXPECT_SENTENCE(refusal(people));
  EXPECT_EQ(clip_of(people, {.task = Task::kHug}).clip.task, Task::kHug);
  EXPECT_SENTENCE(refusal(standin_people(clip, layout), {.metres_per_unit = 0.5}));
  for (PointTracks& joints : people.joints) joints = PointTracks(24, kSmplJoints);
  EXPECT_SENTENCE(refusal(people, {.task = Task::kHug}));
}

TEST(SourceClip, AnAddedTPoseIsDropped) {
  const InteractionClip clip = standin_clip(48, 60.0);
  const JointLayout& layout = joint_layout("smpl-24");
  RawPeople people = standin_people(clip, layout);
  for (PointTracks& joints : people.joints) {
    PointTracks::Frame p = joints.frame(0);
    for (const auto& [shoulder, side] : {std::pair{kLeftShoulder, 1.0}, {kRightShoulder, -1.0}}) {
      const Eigen::Vector3d out = side * (p.col(kLeftShoulder) - p.col(kRightShoulder)).normalized();
      for (int k = 1; k <= 3; ++k) p.col(shoulder + 2 * k) = p.col(shoulder) + 0.25 * k * out;
    }
  }
  const SourceClip found = clip_of(people);
  EXPECT_THAT(found.evidence, Contains(HasSubstr("frame 0 dropped: an added T pose")));
  EXPECT_EQ(found.clip.source.at("first_frame"), "1");
  EXPECT_EQ(clip_of(people, {.drop_t_pose = false}).clip.frames(), 40);
  EXPECT_EQ(found.clip.frames(), 39);
  people.joints[1] = standin_people(clip, layout).joints[1];
  const SourceClip of_one = clip_of(people);
  EXPECT_THAT(of_one.evidence, Contains(HasSubstr("frame 0 dropped: an added T pose of person A")));
  EXPECT_EQ(of_one.clip.frames(), 39);
}

// R_WJ turns the bones of the reference posture (docs/conventions.md) into those of the clip, whatever the file's axes.
TEST(SourceClip, RotationsAreThoseOfTheConventions) {
  const InteractionClip clip = standin_clip(24, 60.0);
  RawPeople people = standin_people(clip, joint_layout("smpl-24"), test::y_up(100.0));
  Eigen::Matrix3d R_JB;
  R_JB << 0, 1, 0, 0, 0, 1, 1, 0, 0;
  const Eigen::Quaterniond R_FW(Eigen::Matrix3d(test::y_up().M));
  for (const std::size_t who : {0U, 1U})
    for (const Eigen::Quaterniond& R : (who == 0 ? clip.a : clip.b).rotations)
      people.rotations[who].push_back(R_FW * R * Eigen::Quaterniond(R_JB).conjugate());
  const SourceClip found = clip_of(people, {.output_rate_hz = 60.0});
  ASSERT_EQ(found.clip.a.rotations.size(), clip.a.rotations.size());
  for (std::size_t i = 0; i < clip.a.rotations.size(); ++i)
    EXPECT_LT(found.clip.a.rotations[i].angularDistance(clip.a.rotations[i]), 1e-6);
}

TEST(SourceClip, AnObjectMovesWithThePeople) {
  const InteractionClip clip = standin_clip(24, 60.0);
  RawPeople people = standin_people(clip, joint_layout("smpl-24"), test::y_up(100.0));
  for (int t = 0; t < 24; ++t)
    people.object.push_back({Eigen::Quaterniond(Eigen::Matrix3d(test::y_up().M)), people.joints[0].at(t, kRightHand)});
  const SourceClip found = clip_of(people);
  ASSERT_EQ(static_cast<int>(found.clip.object.poses.size()), found.clip.frames());
  EXPECT_EQ(found.clip.object.keypoints, Eigen::Matrix3Xd::Zero(3, 1));
  for (int t = 0; t < found.clip.frames(); ++t) {
    EXPECT_LT((found.clip.object.poses[t].p - found.clip.a.joints.at(t, kRightHand)).norm(), 1e-9);
    EXPECT_LT(found.clip.object.poses[t].R.angularDistance(Eigen::Quaterniond::Identity()), 1e-9);
  }
  people.object.pop_back();
  EXPECT_SENTENCE(refusal(people));
}

TEST(SourceClip, PhasesOfTheFileAreMovedToTheClipsRate) {
  const InteractionClip clip = standin_clip(48, 120.0);
  RawPeople people = standin_people(clip, joint_layout("smpl-24"));
  people.phases = Phases{.act_begin = 12, .act_end = 36};
  const SourceClip found = clip_of(people);
  EXPECT_EQ(found.clip.phases, (Phases{.act_begin = 5, .act_end = 15}));
  EXPECT_FALSE(found.clip.source.contains("phases"));
}

TEST(SourceClip, AxesAreReadByName) {
  EXPECT_EQ(parse_axis("y"), Axis::kPlusY);
  EXPECT_EQ(parse_axis("-z"), Axis::kMinusZ);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)parse_axis("w"); }));
}

}  // namespace
}  // namespace duet
