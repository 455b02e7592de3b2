#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <tuple>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/people/bvh/bvh.h"
#include "duet/people/bvh/bvh_skeleton.h"
#include "tests/people/bvh_text.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::BvhWriter;
using test::thrown_message;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

// The files hold 12 digits of lengths of the size of 1 m.
constexpr double kDigits = 1e-10;

BvhImport import_texts(const std::string& a, const std::string& b, const BvhOptions& options = {}) {
  const test::ScratchFolder folder;
  write_file(folder / "a.bvh", a);
  write_file(folder / "b.bvh", b);
  return import_bvh_pair(folder / "a.bvh", folder / "b.bvh", Task::kHandshake, options);
}

BvhWriter person_b(BvhWriter writer) {
  writer.root.z() = 1.5;
  writer.first_angles = {0, 180, 0};  // turned to face the other
  return writer;
}

BvhImport import_pair(const BvhWriter& writer, const BvhOptions& options = {}) {
  return import_texts(writer.text(), person_b(writer).text(), options);
}

std::string refusal(const BvhWriter& a, const BvhWriter& b, const BvhOptions& options = {}) {
  return thrown_message<InputError>([&] { (void)import_texts(a.text(), b.text(), options); });
}

TEST(BvhImport, UnitsAreToldFromTheSkeleton) {
  const BvhImport reference = import_pair({});
  EXPECT_NEAR(reference.clip.a.joints.at(0, kPelvis).z(), 0.93, kDigits);
  for (const double metres : {1.0, 0.056444, 0.0254, 0.01, 0.001}) {
    BvhWriter writer;
    writer.metres_per_unit = metres;
    const BvhImport result = import_pair(writer);
    EXPECT_THAT(result.verdict, Contains(HasSubstr(fmt::format("unit: {} m", metres))));
    for (std::size_t i = 0; i < result.clip.a.joints.data().size(); ++i)
      ASSERT_NEAR(result.clip.a.joints.data()[i], reference.clip.a.joints.data()[i], kDigits);
  }
}

TEST(BvhImport, AnUnlikelyStatureNeedsTheUnitStated) {
  BvhWriter writer;
  writer.metres_per_unit = 0.005;
  EXPECT_SENTENCE(refusal(writer, person_b(writer)));
  const BvhImport result = import_pair(writer, {.metres_per_unit = 0.005});
  EXPECT_NEAR(result.clip.a.joints.at(0, kPelvis).z(), 0.93, kDigits);
  EXPECT_THAT(result.verdict, Contains(HasSubstr("unit: 0.005 m (as told")));
}

TEST(BvhImport, PeopleThatAreNotAsExpectedAreInTheVerdict) {
  EXPECT_THAT(import_pair({}).verdict, Not(Contains(HasSubstr("not as expected"))));
  EXPECT_THAT(import_pair({}, {.metres_per_unit = 0.5}).verdict,
              Contains(HasSubstr("not as expected: person A measures")));
}

// Every way of naming finds the same person: 1.7 m in the T pose, whose joints stand in bvh_text.h.
TEST(BvhImport, NamesOfEachMakerFindTheSamePerson) {
  for (const auto& [naming, bones] :
       {std::pair{"Xsens", test::xsens_bones()}, {"SOMA", test::soma_bones()}, {"common", test::lafan_bones()}}) {
    BvhWriter writer{.bones = bones};
    writer.arm_drop = 0.0;
    writer.swing = 0.0;
    const BvhImport found = import_pair(writer);
    EXPECT_THAT(found.verdict, Contains(HasSubstr(std::string("joint names: ") + naming)));
    const PointTracks& joints = found.clip.a.joints;
    const double pelvis = joints.at(0, kPelvis).z();
    for (const auto& [joint, height] : {std::pair{kLeftHip, -0.07},
                                        {kRightKnee, -0.47},
                                        {kLeftAnkle, -0.87},
                                        {kRightToe, -0.91},
                                        {kSpine1, 0.10},
                                        {kSpine3, 0.34},
                                        {kNeck, 0.52},
                                        {kHead, 0.62},
                                        {kLeftCollar, 0.44},
                                        {kRightShoulder, 0.44},
                                        {kLeftHand, 0.44}})
      EXPECT_NEAR(joints.at(0, joint).z() - pelvis, height, kDigits) << naming << " " << kSmplNames[joint];
    EXPECT_NEAR((joints.at(0, kLeftWrist) - joints.at(0, kLeftShoulder)).norm(), 0.53, kDigits) << naming;
    // LAFAN1's hands end where they begin: theirs is 0.32 of the forearm.
    const double hand = std::string(naming) == "common" ? 0.32 * 0.25 : 0.09;
    EXPECT_NEAR((joints.at(0, kLeftHand) - joints.at(0, kLeftWrist)).norm(), hand, kDigits) << naming;
  }
}

double largest_difference(const PointTracks& a, const PointTracks& b, std::initializer_list<int> but = {}) {
  double largest = 0.0;
  for (int t = 0; t < a.frames(); ++t)
    for (int j = 0; j < kSmplJoints; ++j)
      if (std::find(but.begin(), but.end(), j) == but.end())
        largest = std::max(largest, (a.at(t, j) - b.at(t, j)).norm());
  return largest;
}

BvhWriter lafan_writer() { return {.bones = test::lafan_bones()}; }

TEST(BvhImport, NamesOfOthersFindTheSamePerson) {
  const InteractionClip common = import_pair(lafan_writer()).clip;
  for (const test::BvhNames& names : test::bvh_names_of_others()) {
    BvhWriter writer = lafan_writer();
    writer.names = names.map();
    const BvhImport found = import_pair(writer);
    EXPECT_LT(largest_difference(found.clip.a.joints, common.a.joints, {kSpine1, kSpine2}), kDigits) << names.maker;
    EXPECT_LT(largest_difference(found.clip.b.joints, common.b.joints, {kSpine1, kSpine2}), kDigits) << names.maker;
  }
}

TEST(BvhImport, AHandThatEndsAtTheWristIsMadeAlongTheForearm) {
  const BvhImport found = import_pair(lafan_writer());
  EXPECT_THAT(found.verdict, Contains(HasSubstr("the left hand is made beyond the wrist along the forearm")));
  const PointTracks& joints = found.clip.b.joints;
  for (int t = 0; t < joints.frames(); ++t) {
    const Eigen::Vector3d forearm = joints.at(t, kRightWrist) - joints.at(t, kRightElbow);
    EXPECT_LT((joints.at(t, kRightHand) - joints.at(t, kRightWrist) - 0.32 * forearm).norm(), kDigits);
  }
  EXPECT_THAT(import_pair({.bones = test::common_bones()}).verdict, Not(Contains(HasSubstr("is made"))));
}

TEST(BvhImport, ToesThatAFileLacksAreMadeAheadOfTheAnkles) {
  BvhWriter writer = lafan_writer();
  std::erase_if(writer.bones, [](const test::BvhBone& bone) { return bone.name.find("Toe") != std::string::npos; });
  for (test::BvhBone& bone : writer.bones) ASSERT_LT(bone.parent, static_cast<int>(writer.bones.size()));
  for (std::size_t j = 0; j < writer.bones.size(); ++j)  // one toe stood between them
    if (writer.bones[j].name == "RightLeg" || writer.bones[j].name == "RightFoot") --writer.bones[j].parent;
  const BvhImport found = import_pair(writer);
  EXPECT_THAT(found.verdict, Contains(HasSubstr("the left toe is made ahead of the ankle")));
  const PointTracks& joints = found.clip.a.joints;
  for (int t = 0; t < joints.frames(); ++t) {
    const double yaw = heading(joints, t);
    const Eigen::Vector3d toe = joints.at(t, kLeftToe) - joints.at(t, kLeftAnkle);
    EXPECT_LT((toe - Eigen::Vector3d(0.12 * std::cos(yaw), 0.12 * std::sin(yaw), -0.05)).norm(), 1e-9);
  }
}

TEST(BvhImport, AFileOfNamesSaysWhichJointIsWhich) {
  BvhWriter writer = lafan_writer();
  std::map<std::string, std::string> names = test::bvh_names_of_others().front().map();
  std::string file = "# which bone is which\n";
  int number = 0;
  for (const auto& [smpl, common] : {std::pair{"left_hip", "LeftUpLeg"},
                                     {"right_hip", "RightUpLeg"},
                                     {"left_knee", "LeftLeg"},
                                     {"right_knee", "RightLeg"},
                                     {"left_ankle", "LeftFoot"},
                                     {"right_ankle", "RightFoot"},
                                     {"left_toe", "LeftToe"},
                                     {"right_toe", "RightToe"},
                                     {"left_shoulder", "LeftArm"},
                                     {"right_shoulder", "RightArm"},
                                     {"left_elbow", "LeftForeArm"},
                                     {"right_elbow", "RightForeArm"},
                                     {"left_wrist", "LeftHand"},
                                     {"right_wrist", "RightHand"},
                                     {"head", "Head"},
                                     {"neck", "Neck"},
                                     {"pelvis", "Hips"}}) {
    names[common] = fmt::format("Bone {}", ++number);
    file += fmt::format("{}: \"Bone {}\"  # here\n", smpl, number);
  }
  writer.names = names;
  const test::ScratchFolder folder;
  write_file(folder / "names.yaml", file);
  EXPECT_SENTENCE(refusal(writer, writer));
  const InteractionClip common = import_pair(lafan_writer()).clip;
  const BvhImport found = import_pair(writer, {.skeleton = folder / "names.yaml"});
  EXPECT_THAT(found.verdict, Contains(HasSubstr("joint names: as told")));
  EXPECT_LT(
      largest_difference(found.clip.a.joints, common.a.joints, {kSpine1, kSpine2, kSpine3, kLeftCollar, kRightCollar}),
      kDigits);
  for (const std::string line :
       {"left_hipp: x", "left_hip: x\nleft_hip: y", "left_hip: x\nhead: x", "left_hip:", "left_hip: nobody"}) {
    write_file(folder / "bad.yaml", std::string("# :\n") + line + "\n");
    EXPECT_SENTENCE(refusal(writer, writer, {.skeleton = folder / "bad.yaml"}));
  }
}

TEST(BvhImport, TwoPeopleInOneFileAreThoseOfAPair) {
  const BvhWriter a = lafan_writer(), b = person_b(lafan_writer());
  const InteractionClip pair = import_texts(a.text(), b.text()).clip;
  const auto hierarchy = [](const BvhWriter& writer) {
    const std::string text = writer.text();
    const std::size_t begin = text.find("ROOT");
    return text.substr(begin, text.find("MOTION") - begin);
  };
  const auto motion = [&] {
    std::string text = fmt::format("MOTION\nFrames: {}\nFrame Time: {}\n", a.frames, a.frame_time);
    for (int t = 0; t < a.frames; ++t) text += a.frame(t) + b.frame(t) + "\n";
    return text;
  };
  BvhWriter called_a = a, called_b = b;
  for (const test::BvhBone& bone : a.bones) {
    called_a.names[bone.name] = "character_A_" + bone.name;
    called_b.names[bone.name] = "character_B_" + bone.name;
  }
  const std::string roots = "HIERARCHY\n" + hierarchy(a) + hierarchy(b) + motion();
  std::string branches =
      "HIERARCHY\nROOT World\n{\nOFFSET 0 0 0\nCHANNELS 0\n" + hierarchy(called_a) + hierarchy(called_b);
  for (std::size_t at = branches.find("ROOT character"); at != std::string::npos; at = branches.find("ROOT character"))
    branches.replace(at, 4, "JOINT");
  for (const std::string& text : {roots, branches + "}\n" + motion()}) {
    const std::array<Bvh, 2> people = two_people_in(parse_bvh(text, "both.bvh"));
    const InteractionClip clip = import_bvh_pair(people[0], people[1], Task::kHandshake).clip;
    EXPECT_LT(largest_difference(clip.a.joints, pair.a.joints), kDigits);
    EXPECT_LT(largest_difference(clip.b.joints, pair.b.joints), kDigits);
  }
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)two_people_in(parse_bvh(a.text(), "one.bvh")); }));
}

TEST(BvhImport, UpAxisIsToldFromHeadsAboveFeet) {
  const BvhImport y_up = import_pair({});
  BvhWriter writer;
  writer.z_up = true;
  const BvhImport z_up = import_pair(writer);
  EXPECT_THAT(y_up.verdict, Contains(HasSubstr("up axis: y")));
  EXPECT_THAT(z_up.verdict, Contains(HasSubstr("up axis: z")));
  for (const auto& [y, z] : {std::pair{&y_up.clip.a, &z_up.clip.a}, {&y_up.clip.b, &z_up.clip.b}})
    for (std::size_t i = 0; i < y->joints.data().size(); ++i)
      ASSERT_NEAR(y->joints.data()[i], z->joints.data()[i], kDigits);
  EXPECT_NEAR(heading(y_up.clip.a.joints, 0), -std::numbers::pi / 2, kDigits);  // +z of the file is -y of W
  EXPECT_NEAR(heading(y_up.clip.b.joints, 0), std::numbers::pi / 2, kDigits);
}

TEST(BvhImport, APersonLyingDownNeedsTheUpAxisStated) {
  BvhWriter writer;
  writer.first_angles = {90, 0, 0};
  EXPECT_SENTENCE(refusal(writer, writer));
  EXPECT_THAT(import_texts(writer.text(), writer.text(), {.up = UpAxis::kY}).verdict,
              Contains(HasSubstr("up axis: y (as told)")));
}

TEST(BvhImport, RateIsAWholeNumberWhereTheFrameTimeIsRounded) {
  for (const auto& [frame_time, rate] : {std::pair<std::string, std::string>{".0083333", "rate: 120 Hz"},
                                         {"0.033333", "rate: 30 Hz"},
                                         {"0.0333667", "rate: 29.97 Hz"},
                                         {"0.02", "rate: 50 Hz"}}) {
    BvhWriter writer;
    writer.frame_time = frame_time;
    EXPECT_THAT(import_pair(writer).verdict, Contains(HasSubstr(rate)));
  }
  EXPECT_THAT(import_pair({}, {.rate_hz = 100.0}).verdict, Contains(HasSubstr("rate: 100 Hz (as told")));
  EXPECT_EQ(import_pair({}, {.rate_hz = 100.0}).clip.frames(), 3);
}

TEST(BvhImport, FrameTimesOutOfRangeAreRefused) {
  BvhWriter writer;
  for (const std::string frame_time : {"1e-320", "1e-9", "1e9"}) {
    writer.frame_time = frame_time;
    EXPECT_SENTENCE(refusal(writer, person_b(writer)));
  }
  writer.frame_time = "50";
  EXPECT_SENTENCE(refusal(writer, person_b(writer), {.output_rate_hz = 1e6}));
}

TEST(BvhImport, LengthsThatOverflowAreRefused) {
  BvhWriter writer;
  writer.bones[3].offset = {0, -1e305, 0};
  writer.bones[4].offset = {0, -1e305, 0};
  for (const BvhOptions& options : {BvhOptions{}, BvhOptions{.metres_per_unit = 1.0, .up = UpAxis::kY}})
    EXPECT_SENTENCE(refusal(writer, person_b(writer), options));
}

TEST(BvhImport, AnAddedTPoseIsDropped) {
  BvhWriter writer;
  writer.t_pose = true;
  const BvhImport result = import_pair(writer);
  EXPECT_THAT(result.verdict, Contains(HasSubstr("frame 0 dropped: an added T pose")));
  EXPECT_EQ(result.clip.frames(), 5);
  EXPECT_EQ(import_pair(writer, {.drop_t_pose = false}).clip.frames(), 6);
  EXPECT_THAT(import_pair({}).verdict, Contains(HasSubstr("frame 0 kept: not an added T pose")));
  EXPECT_EQ(import_pair({}).clip.frames(), 6);
}

TEST(BvhImport, AMotionThatBeginsWithArmsOutIsNoTPose) {
  BvhWriter writer;
  writer.arm_drop = 0.0;
  EXPECT_EQ(import_pair(writer).clip.frames(), 6);
}

TEST(BvhImport, ATPoseOfOnePersonIsDroppedWithItsFrame) {
  BvhWriter with;
  with.t_pose = true;
  const BvhImport same_length = import_texts(with.text(), person_b({}).text());
  EXPECT_THAT(same_length.verdict, Contains(HasSubstr("frame 0 dropped: an added T pose of")));
  EXPECT_EQ(same_length.clip.frames(), 5);
  // One frame more: it was added to that file alone.
  with.frames = 7;
  const BvhImport longer = import_texts(with.text(), person_b({}).text());
  EXPECT_THAT(longer.verdict, Contains(HasSubstr("frame 0 dropped from one file: an added T pose of")));
  EXPECT_EQ(longer.clip.frames(), 6);
  EXPECT_EQ(longer.clip.b.joints, import_pair({}).clip.b.joints);
  EXPECT_EQ(import_texts(with.text(), person_b({}).text(), {.drop_t_pose = false}).clip.frames(), 6);
}

TEST(BvhImport, BonesStayRigidThroughResampling) {
  BvhWriter writer;
  writer.frame_time = "0.0083333333";
  writer.frames = 40;
  writer.velocity = {0.003, 0, 0.006};
  const InteractionClip clip = import_pair(writer).clip;
  ASSERT_EQ(clip.frames(), 17);
  const std::array<double, kSmplJoints> lengths = bone_lengths(clip.a);
  for (int t = 0; t < clip.frames(); ++t)
    for (int j = 1; j < kSmplJoints; ++j)
      ASSERT_NEAR((clip.a.joints.at(t, j) - clip.a.joints.at(t, kSmplParents[j])).norm(), lengths[j], 1e-14);
  // Root: linear in time. Thigh: turns uniformly.
  EXPECT_NEAR(clip.a.joints.at(16, kPelvis).x(), 0.003 * 16 * 2.4, 1e-9);
  const Eigen::Vector3d thigh = clip.a.joints.at(16, kLeftKnee) - clip.a.joints.at(16, kLeftHip);
  const double swing = 3.0 * 16 * 2.4 * std::numbers::pi / 180.0;
  EXPECT_NEAR(thigh.z(), -0.4 * std::cos(swing), 1e-9);
}

// Rotations are counted from the reference posture that faces +x: they turn its bones into those of the motion.
TEST(BvhImport, RotationsTurnTheReferenceBones) {
  for (const auto& bones : {test::cmu_bones(), test::common_bones()}) {
    BvhWriter writer{.bones = bones};
    writer.first_angles = {0, 40, 0};
    const HumanMotion motion = import_pair(writer).clip.a;
    const auto expect_bone = [&](int joint, const Eigen::Vector3d& reference) {
      for (int t = 0; t < motion.frames(); ++t) {
        const int parent = kSmplParents[joint];
        const Eigen::Vector3d bone = motion.joints.at(t, joint) - motion.joints.at(t, parent);
        EXPECT_LT((bone - motion.rotations[t * kSmplJoints + parent] * reference).norm(), kDigits) << joint;
      }
    };
    expect_bone(kLeftHip, {0, 0.09, -0.07});
    expect_bone(kLeftKnee, {0, 0, -0.4});
    expect_bone(kRightAnkle, {0, 0, -0.4});
    expect_bone(kLeftToe, {0.12, 0, -0.04});
    expect_bone(kRightElbow, {0, -0.28, 0});
    expect_bone(kLeftHand, {0, 0.09, 0});
  }
}

TEST(BvhImport, CommonNamesAreKnownToo) {
  const BvhImport result = import_pair({.bones = test::common_bones()});
  EXPECT_THAT(result.verdict, Contains(HasSubstr("joint names: common")));
  std::vector<test::BvhBone> two_spines = test::common_bones();  // OptiTrack: no Spine2
  two_spines[3].name = "mixamorig:Chest";
  two_spines[2].name = "mixamorig:Spine1";
  EXPECT_NO_THROW((void)import_pair({.bones = two_spines}));
}

TEST(BvhImport, AMissingJointIsNamedWithTheNearest) {
  BvhWriter renamed;
  renamed.bones[4].name = "LeftFot";
  EXPECT_SENTENCE(refusal(renamed, renamed));
  BvhWriter b = person_b({});
  b.bones[21].name = "LeftOberarm";
  EXPECT_SENTENCE(refusal({}, b));
}

TEST(BvhImport, OfDifferentLengthsTheCommonOneIsTaken) {
  BvhWriter b = person_b({});
  b.frames = 5;
  const BvhImport found = import_texts(BvhWriter{}.text(), b.text());
  EXPECT_THAT(found.verdict, Contains(HasSubstr("length: 'a.bvh' has 6 frames and 'b.bvh' 5: the first 5 of both")));
  EXPECT_EQ(found.clip.frames(), 5);
  EXPECT_EQ(found.clip.a.joints, import_pair({}).clip.a.joints.slice(0, 5));
}

TEST(BvhImport, FrameTimesOfOneRateAreOneClockAndOthersAreRefused) {
  for (const auto& [a, b, same] : {std::tuple{"0.033333", "0.0333333", true},
                                   {".0083333", "0.008333333", true},
                                   {"0.02", "0.0200001", true},
                                   {"0.0333667", "0.0333333", false},
                                   {"0.02", "0.01", false}}) {
    BvhWriter first, second = person_b({});
    first.frame_time = a;
    second.frame_time = b;
    if (same) {
      EXPECT_NO_THROW((void)import_texts(first.text(), second.text())) << a << " " << b;
    } else {
      EXPECT_SENTENCE(refusal(first, second)) << a << " " << b;
      EXPECT_NO_THROW((void)import_texts(first.text(), second.text(), {.rate_hz = 50.0})) << "as told";
    }
  }
}

TEST(BvhImport, TooFewFramesAreRefused) {
  BvhWriter writer;
  writer.frames = 1;
  EXPECT_SENTENCE(refusal(writer, person_b(writer)));
  writer.frames = 2;
  writer.frame_time = "0.001";
  EXPECT_SENTENCE(refusal(writer, person_b(writer)));
}

TEST(BvhImport, ZeroLengthBonesAreNamed) {
  BvhWriter writer;
  writer.bones[3].offset.setZero();
  EXPECT_SENTENCE(refusal(writer, person_b(writer), {.metres_per_unit = 0.01}));
}

TEST(BvhImport, OptionsThatAreNoNumbersAreRefused) {
  for (const BvhOptions& options :
       {BvhOptions{.metres_per_unit = 0.0}, BvhOptions{.rate_hz = -1.0}, BvhOptions{.output_rate_hz = std::nan("")}})
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)import_pair({}, options); }));
}

// ---- The real handshake: facts of its README ------------------------------------------------------------------------

class CmuHandshake : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string a = test::shared_file("data/cmu_handshake/18_01.bvh");
    const std::string b = test::shared_file("data/cmu_handshake/19_01.bvh");
    if (a.empty() || b.empty()) GTEST_SKIP() << "not run: data/cmu_handshake absent";
    result_ = import_bvh_pair(a, b, Task::kHandshake, {.output_rate_hz = 120.0});
    at_50_hz_ = import_bvh_pair(a, b, Task::kHandshake);
  }
  [[nodiscard]] double distance(int frame, int joint) const {
    return (result_.clip.a.joints.at(frame, joint) - result_.clip.b.joints.at(frame, joint)).norm();
  }
  BvhImport result_, at_50_hz_;
};

TEST_F(CmuHandshake, VerdictFindsWhatIsKnown) {
  EXPECT_THAT(at_50_hz_.verdict, Contains(HasSubstr("joint names: CMU")));
  EXPECT_THAT(at_50_hz_.verdict, Contains(HasSubstr("unit: 0.056444 m")));
  EXPECT_THAT(at_50_hz_.verdict, Contains(HasSubstr("up axis: y")));
  EXPECT_THAT(at_50_hz_.verdict, Contains(HasSubstr("frame 0 dropped: an added T pose")));
  EXPECT_THAT(at_50_hz_.verdict, Contains(HasSubstr("rate: 120 Hz")));
  EXPECT_EQ(result_.clip.frames(), 303);
  EXPECT_EQ(at_50_hz_.clip.frames(), 126);
  EXPECT_EQ(at_50_hz_.clip.id, "18_01-19_01");
}

TEST_F(CmuHandshake, HipsApproachAndPart) {
  EXPECT_NEAR(distance(0, kPelvis), 1.98, 0.005);
  EXPECT_NEAR(distance(302, kPelvis), 1.80, 0.005);
  double nearest = 10.0;
  for (int t = 0; t < 303; ++t) nearest = std::min(nearest, distance(t, kPelvis));
  EXPECT_NEAR(nearest, 0.74, 0.005);
}

// Fingertips 0.23-0.27 m and wrists 0.38-0.42 m apart while clasped; 0.01 m at the two ends, where the hands close.
TEST_F(CmuHandshake, HandsStayTogetherWhileClasped) {
  for (int t = 65; t <= 201; ++t) {
    EXPECT_GT(distance(t, kRightHand), 0.225);
    EXPECT_LT(distance(t, kRightHand), 0.28);
    EXPECT_GT(distance(t, kRightWrist), 0.375);
    EXPECT_LT(distance(t, kRightWrist), 0.43);
  }
  EXPECT_GT(distance(45, kRightHand), 0.5);
  EXPECT_GT(distance(230, kRightHand), 0.5);
}

TEST_F(CmuHandshake, PeopleAreAsTallAsKnown) {
  for (const auto& [motion, height] : {std::pair{&result_.clip.a, 1.46}, {&result_.clip.b, 1.52}}) {
    double mean = 0.0;
    for (int t = 0; t < 303; ++t)
      mean += motion->joints.at(t, kHead).z() -
              0.5 * (motion->joints.at(t, kLeftToe).z() + motion->joints.at(t, kRightToe).z());
    EXPECT_NEAR(mean / 303, height, 0.005);
  }
}

// Until the hands meet; A turns away at the end.
TEST_F(CmuHandshake, TheyWalkUpFacingEachOther) {
  for (int t = 0; t <= 60; t += 10) {
    const Eigen::Vector3d to_b = result_.clip.b.joints.at(t, kPelvis) - result_.clip.a.joints.at(t, kPelvis);
    const double bearing = std::atan2(to_b.y(), to_b.x());
    EXPECT_GT(std::cos(heading(result_.clip.a.joints, t) - bearing), 0.8);
    EXPECT_LT(std::cos(heading(result_.clip.b.joints, t) - bearing), -0.8);
  }
}

TEST_F(CmuHandshake, ResamplingAgreesWithTheSourceWhereInstantsCoincide) {
  for (int k = 0; 12 * k < 303; ++k)
    EXPECT_EQ(at_50_hz_.clip.a.joints.slice(5 * k, 5 * k + 1), result_.clip.a.joints.slice(12 * k, 12 * k + 1));
}

TEST_F(CmuHandshake, ProposedActCoversTheClasp) {
  const Phases phases = at_50_hz_.clip.phases;  // the clasp is [65, 201] of 120 Hz = [27.1, 83.75] of 50 Hz
  EXPECT_LE(phases.act_begin, 27);
  EXPECT_GE(phases.act_begin, 10);
  EXPECT_GT(phases.act_end, 84);
  EXPECT_LE(phases.act_end, 96);
}

}  // namespace
}  // namespace duet
