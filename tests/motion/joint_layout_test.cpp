#include "duet/motion/layouts/joint_layout.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <sstream>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/layouts/joint_recipes.h"
#include "duet/motion/people/source_clip.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/tasks/synthesis/posed_body.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

double weight_of(const std::vector<JointRecipe::Part>& parts) {
  double weight = 0.0;
  for (const JointRecipe::Part& part : parts) weight += part.weight;
  return weight;
}

TEST(JointLayout, WeightsOfEachJointAddUpToOneAndDirectionsToZero) {
  for (const std::string& name : joint_layout_names()) {
    const JointLayout& layout = joint_layout(name);
    for (int j = 0; j < kSmplJoints; ++j) {
      EXPECT_NEAR(weight_of(layout.smpl[j].parts), 1.0, 1e-12) << name << " " << kSmplNames[j];
      EXPECT_NEAR(weight_of(layout.smpl[j].toward), 0.0, 1e-12) << name << " " << kSmplNames[j];
    }
  }
}

TEST(JointLayout, APrefixThatAllNamesShareSaysNothing) {
  const JointLayout& plain = joint_layout("smpl-22");
  for (const char* prefix : {"Actor1.", "Actor1:", "character_A_", "ns:Skeleton_", "jnt_", "DEF-"}) {
    std::vector<std::string> names = plain.names;
    for (std::string& name : names) name.insert(0, prefix);
    const JointLayout found = layout_of_names("prefixed", names);
    for (int j = 0; j < kSmplJoints; ++j)
      EXPECT_EQ(found.smpl[j].parts[0].column, plain.smpl[j].parts[0].column) << prefix << kSmplNames[j];
  }
}

TEST(JointLayout, APrefixIsFoundAmongManyNamesAndLongOnes) {
  std::vector<std::string> names;
  for (int i = 0; i < 60000; ++i) names.push_back("rig_" + std::to_string(i) + "_joint.a-b|c d");
  names.emplace_back(1 << 20, '_');
  const std::vector<std::string> plain = without_prefix(names);
  EXPECT_EQ(plain[7], "7_joint.a-b|c d");
  EXPECT_EQ(plain.back(), names.back());
}

TEST(JointLayout, AFileOfNamesMapsTheColumnsOfAFile) {
  const test::ScratchFolder folder;
  std::vector<std::string> own;
  std::string map;
  for (int j = 0; j < 22; ++j) {
    own.push_back(fmt::format("marker {}", 21 - j));
    map += fmt::format("{}: marker {}\n", kSmplNames[j], 21 - j);
  }
  write_file(folder / "map.yaml", "\xef\xbb\xbf" + map);
  const JointLayout found = read_joint_layout(folder / "map.yaml", own);
  EXPECT_EQ(found.smpl[kLeftWrist].parts[0].column, static_cast<int>(kLeftWrist));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read_joint_layout(folder / "map.yaml"); }));
}

// A recipe uses columns of the file, and SMPL joints that stand before it in the order of making.
TEST(JointLayout, RecipesUseOnlyWhatIsMadeBefore) {
  for (const std::string& name : joint_layout_names()) {
    const JointLayout& layout = joint_layout(name);
    const auto size = static_cast<int>(layout.names.size());
    std::array<bool, kSmplJoints> made{};
    for (const SmplJoint joint : kRecipeOrder) {
      for (const auto* parts : {&layout.smpl[joint].parts, &layout.smpl[joint].toward})
        for (const JointRecipe::Part& part : *parts) {
          ASSERT_GE(part.column, 0);
          ASSERT_LT(part.column, size + kSmplJoints);
          if (part.column >= size) {
            EXPECT_TRUE(made[part.column - size]) << name << " " << kSmplNames[joint];
          }
        }
      made[joint] = true;
    }
  }
}

TEST(JointLayout, SizesAreTheNumbersInTheNames) {
  for (const std::string& name : joint_layout_names())
    EXPECT_EQ(std::to_string(joint_layout(name).names.size()), name.substr(name.rfind('-') + 1)) << name;
}

// Where a skeleton has a joint of SMPL's, that is it.
TEST(JointLayout, ColumnsOfKnownSkeletonsAreTheirJoints) {
  const auto column = [](const char* layout, SmplJoint joint) {
    const JointLayout& found = joint_layout(layout);
    const JointRecipe& recipe = found.smpl[joint];
    return recipe.parts.size() == 1 && recipe.parts[0].column < static_cast<int>(found.names.size())
               ? found.names[recipe.parts[0].column]
               : "(made)";
  };
  for (int j = 0; j < kSmplJoints; ++j) EXPECT_EQ(column("smpl-24", static_cast<SmplJoint>(j)), kSmplNames[j]);
  EXPECT_EQ(column("kinect-15", kLeftAnkle), "lfoot");
  EXPECT_EQ(column("kinect-15", kLeftToe), "lfoot");  // and ahead of it
  EXPECT_FALSE(joint_layout("kinect-15").has_toes());
  EXPECT_EQ(column("kinect-25", kRightToe), "FootRight");
  EXPECT_EQ(column("kinect-25", kRightHand), "HandRight");
  EXPECT_EQ(column("kinect-25", kNeck), "Neck");
  EXPECT_EQ(column("kinect-20", kNeck), "ShoulderCenter");
  EXPECT_EQ(column("coco-17", kLeftWrist), "left_wrist");
  EXPECT_EQ(column("optitrack-64", kLeftShoulder), "LeftArm");
  EXPECT_EQ(column("optitrack-64", kLeftCollar), "LeftShoulder");
  EXPECT_EQ(column("optitrack-64", kLeftWrist), "LeftHand");
  EXPECT_EQ(column("optitrack-64", kLeftHand), "LeftHandMiddle1");
  EXPECT_EQ(column("optitrack-64", kRightToe), "RightToeBase");
  EXPECT_EQ(column("smplx-127", kLeftHand), "left_middle1");
  EXPECT_EQ(column("imar-25", kNeck), "thorax");
}

TEST(JointLayout, ASmplPersonComesBackFromEveryPartOfItsJoints) {
  const InteractionClip clip = synthesize(Task::kHandshake, {.seed = 3});
  const JointLayout& layout = joint_layout("smpl-22");
  for (const int t : {0, clip.frames() / 2}) {
    PointTracks columns(1, 22);
    columns.frame(0) = clip.a.joints.frame(t).leftCols<22>();
    SmplFrame smpl;
    make_smpl(layout, std::as_const(columns).frame(0), true, smpl);
    EXPECT_EQ(Eigen::Matrix3Xd(smpl.leftCols<22>()), Eigen::Matrix3Xd(columns.frame(0)));
    for (const SmplJoint hand : {kLeftHand, kRightHand})
      EXPECT_LT((smpl.col(hand) - clip.a.joints.at(t, hand)).norm(), 0.05);
  }
}

// Joints that fifteen columns lack are where a person has them, to the spread of people.
TEST(JointLayout, FifteenJointsMakeAPerson) {
  const InteractionClip clip = synthesize(Task::kHug, {.seed = 4});
  const JointLayout& layout = joint_layout("kinect-15");
  const std::array<int, 15> smpl_of = {kHead,     kNeck,          kSpine2,     kLeftShoulder, kLeftElbow,
                                       kLeftHand, kRightShoulder, kRightElbow, kRightHand,    kLeftHip,
                                       kLeftKnee, kLeftAnkle,     kRightHip,   kRightKnee,    kRightAnkle};
  for (int t = 0; t < clip.frames(); t += 50) {
    PointTracks columns(1, 15);
    for (int k = 0; k < 15; ++k) columns.at(0, k) = clip.a.joints.at(t, smpl_of[k]);
    SmplFrame smpl;
    make_smpl(layout, std::as_const(columns).frame(0), true, smpl);
    for (int j = 0; j < kSmplJoints; ++j)
      EXPECT_LT((smpl.col(j) - clip.a.joints.at(t, j)).norm(), 0.12) << t << " " << kSmplNames[j];
  }
}

TEST(JointLayout, NamesOfOthersAreMatched) {
  const std::vector<std::string> sides = {"L_", "R_"};
  std::vector<std::string> names = {"Head", "Neck"};
  for (const std::string& side : sides)
    for (const char* part : {"Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle"}) names.push_back(side + part);
  const JointLayout layout = layout_of_names("mine", names);
  EXPECT_EQ(layout.smpl[kLeftKnee].parts[0].column, 6);
  EXPECT_EQ(layout.smpl[kRightWrist].parts[0].column, 10);
}

// From below: thorax, shoulder centre, neck 1.
TEST(JointLayout, TheLowestOfSeveralSecondNecksCounts) {
  std::vector<std::string> names = {"Thorax", "Head", "Neck1"};
  for (const char* side : {"L_", "R_"})
    for (const char* part : {"Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle"})
      names.push_back(std::string(side) + part);
  EXPECT_EQ(layout_of_names("mine", names).smpl[kNeck].parts[0].column, 0);
  names[0] = "Neck";
  EXPECT_EQ(layout_of_names("mine", names).smpl[kNeck].parts[0].column, 0);
  names[0] = "Tail";
  EXPECT_EQ(layout_of_names("mine", names).smpl[kNeck].parts[0].column, 2);
}

TEST(JointLayout, MissingAndDoubledPartsAreNamed) {
  const auto refusal = [](const std::vector<std::string>& names) {
    return thrown_message<InputError>([&] { (void)layout_of_names("mine", names); });
  };
  std::vector<std::string> names = joint_layout("coco-17").names;
  names[13] = "something";
  EXPECT_SENTENCE(refusal(names));
  EXPECT_SENTENCE(refusal({}));
  names[13] = "left_hip";
  EXPECT_SENTENCE(refusal(names));
}

TEST(JointLayout, AFileOfNamesIsASkeleton) {
  const test::ScratchFolder folder;
  std::string text = "# mine\n";
  for (const std::string& name : joint_layout("coco-17").names) text += name + "  # a joint\n\n";
  write_file(folder / "names.txt", text);
  EXPECT_EQ(read_joint_layout(folder / "names.txt").names, joint_layout("coco-17").names);
  EXPECT_EQ(read_joint_layout("coco-17").name, "coco-17");
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)read_joint_layout("coco-18"); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)joint_layout("kinect-16"); }));
}

// The table of the 24 joints in docs/file-formats.md is that of the code.

constexpr double kStature = 1.75;      // [m] of the table
constexpr double kRounded = 0.005001;  // [m]

// Standing straight in the T pose, the origin on the ground below the pelvis.
std::array<Eigen::Vector3d, kSmplJoints> standing() {
  const synthesis::Body body = synthesis::make_body(kStature, {});
  std::array<Eigen::Vector3d, kSmplJoints> p;
  const double legs = body.leg() + body.ankle_height() - body.offset[kLeftHip].z();
  p[kPelvis] = {0.0, 0.0, legs};
  for (int j = 1; j < kSmplJoints; ++j) p[j] = p[kSmplParents[j]] + body.offset[j];
  return p;
}

TEST(JointTable, OfTheDocsIsTheCodes) {
  const std::array<Eigen::Vector3d, kSmplJoints> positions = standing();
  std::istringstream lines(read_file(fmt::format("{}/docs/file-formats.md", DUET_SOURCE_DIR)));
  int found = 0;
  for (std::string line; std::getline(lines, line);) {
    int joint = -1;
    std::array<char, 32> name{}, parent{};
    double x = 0.0, y = 0.0, z = 0.0;
    if (std::sscanf(line.c_str(), "| %d | `%31[a-z_0-9]` | %31[^|] | %lf, %lf, %lf |", &joint, name.data(),
                    parent.data(), &x, &y, &z) != 6)
      continue;
    ASSERT_EQ(joint, found++) << line;
    EXPECT_EQ(kSmplNames[joint], name.data());
    const std::string expected = joint == 0 ? "- " : "`" + std::string(kSmplNames[kSmplParents[joint]]) + "` ";
    EXPECT_EQ(expected, parent.data());
    EXPECT_LT((positions[joint] - Eigen::Vector3d(x, y, z)).cwiseAbs().maxCoeff(), kRounded) << line;
  }
  EXPECT_EQ(found, kSmplJoints);
}

constexpr int kFrames = 9, kWristLeft = 6;
constexpr double kRate = 60.0;

RawPeople two_people() {
  const JointLayout& layout = joint_layout("kinect-25");
  RawPeople people{.id = "clip", .name = "clip.npz", .layout = &layout, .joints = {}};
  for (PointTracks& joints : people.joints) {
    joints = PointTracks(kFrames, static_cast<int>(layout.names.size()));
    for (int t = 0; t < kFrames; ++t) joints.frame(t).setOnes();
  }
  return people;
}

TEST(JointGaps, AreFilledAlongAStraightLine) {
  for (const int who : {0, 1}) {
    RawPeople people = two_people();
    people.rate_hz = kRate;
    PointTracks& joints = people.joints[who];
    joints.at(2, kWristLeft) = Eigen::Vector3d(1.0, 0.0, -3.0);
    for (const int t : {3, 4, 5}) joints.at(t, kWristLeft).setConstant(std::nan(""));
    joints.at(6, kWristLeft) = Eigen::Vector3d(5.0, 8.0, -3.0);
    RawPeople filled = people;
    EXPECT_EQ(fill_gaps(filled, {}).gaps, 1);
    for (const int t : {3, 4, 5}) {
      const Eigen::Vector3d expected(1.0 + (t - 2), 2.0 * (t - 2), -3.0);
      EXPECT_LT((filled.joints[who].at(t, kWristLeft) - expected).norm(), 1e-15) << "frame " << t;
    }
    EXPECT_EQ(filled.joints[who].at(6, kWristLeft), joints.at(6, kWristLeft));
    EXPECT_EQ(filled.joints[1 - who].data(), people.joints[1 - who].data());
  }
}

TEST(JointGaps, WherePeopleAreSeenThroughoutNothingIsFilled) {
  RawPeople people = two_people();
  EXPECT_EQ(fill_gaps(people, {}).gaps, 0);
  EXPECT_EQ(people.joints[0].data(), two_people().joints[0].data());
}

}  // namespace
}  // namespace duet
