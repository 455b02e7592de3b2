#include "duet/people/bvh/bvh.h"

#include <gmock/gmock.h>

#include <numbers>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/people/bvh/bvh.h"
#include "tests/people/bvh_text.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

constexpr double kRoundOff = 1e-12;

std::string two_joints(const std::string& channels, const std::string& motion) {
  return "HIERARCHY\nROOT Root\n{\n  OFFSET 0 0 0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation "
         "Xrotation\n  JOINT Arm\n  {\n    OFFSET 1 0 0\n    " +
         channels + "\n    End Site\n    {\n      OFFSET 0 2 0\n    }\n  }\n}\nMOTION\n" + motion;
}

const std::string kThree = "CHANNELS 3 Zrotation Yrotation Xrotation";
const std::string kOneFrame = "Frames: 1\nFrame Time: 0.01\n";

TEST(Bvh, ReadsHierarchyAndValues) {
  const Bvh bvh = parse_bvh(two_joints(kThree,
                                       "Frames: 2\nFrame Time: .0083333\n1 2 3 4 5 6 7 8 9\r\n"
                                       "-1 +2 .5 1e1 0 0 0 0 0\n\n"),
                            "x.bvh");
  ASSERT_EQ(bvh.joints.size(), 3u);
  EXPECT_EQ(bvh.joints[1].name, "Arm");
  EXPECT_EQ(bvh.joints[1].parent, 0);
  EXPECT_EQ(bvh.joints[1].channels, (std::vector<int>{5, 4, 3}));
  EXPECT_EQ(bvh.joints[2].name, "Arm/end");
  EXPECT_EQ(bvh.joints[2].offset, Eigen::Vector3d(0, 2, 0));
  EXPECT_EQ(bvh.frame_time, 0.0083333);
  EXPECT_EQ(bvh.frames, 2);
  EXPECT_EQ(bvh.values, (std::vector<double>{1, 2, 3, 4, 5, 6, 7, 8, 9, -1, 2, 0.5, 10, 0, 0, 0, 0, 0}));
}

TEST(Bvh, RotationsMultiplyInFileOrder) {
  // Rz(90) Rx(90): the arm's end, along y, goes to z by Rx and stays there under Rz.
  const Bvh bvh = parse_bvh(two_joints(kThree, kOneFrame + "0 0 0 0 0 0 90 0 90\n"), "x.bvh");
  const std::vector<Pose> poses = global_poses(bvh, local_poses(bvh, 0));
  EXPECT_LT((poses[2].p - Eigen::Vector3d(1, 0, 2)).norm(), kRoundOff);
  // Rx(90) Rz(90): y goes to -x by Rz and stays there under Rx.
  const Bvh other =
      parse_bvh(two_joints("CHANNELS 3 Xrotation Yrotation Zrotation", kOneFrame + "0 0 0 0 0 0 90 0 90\n"), "x.bvh");
  EXPECT_LT((global_poses(other, local_poses(other, 0))[2].p - Eigen::Vector3d(-1, 0, 0)).norm(), kRoundOff);
}

TEST(Bvh, ParentsCarryTheirChildren) {
  const Bvh bvh = parse_bvh(two_joints(kThree, kOneFrame + "5 6 7 90 0 0 0 0 0\n"), "x.bvh");
  const std::vector<Pose> poses = global_poses(bvh, local_poses(bvh, 0));
  EXPECT_LT((poses[1].p - Eigen::Vector3d(5, 7, 7)).norm(), kRoundOff);
  EXPECT_LT((poses[2].p - Eigen::Vector3d(3, 7, 7)).norm(), kRoundOff);
}

TEST(Bvh, APositionChannelReplacesTheOffset) {
  const Bvh bvh = parse_bvh(two_joints("CHANNELS 1 Yposition", kOneFrame + "0 0 0 0 0 0 0.25\n"), "x.bvh");
  EXPECT_EQ(local_poses(bvh, 0)[1].p, Eigen::Vector3d(1, 0.25, 0));
}

TEST(Bvh, PosesBetweenFramesTurnUniformly) {
  const Bvh bvh =
      parse_bvh(two_joints(kThree, "Frames: 2\nFrame Time: 1\n0 0 0 0 0 0 10 0 0\n4 0 0 0 0 0 50 0 0\n"), "x.bvh");
  const std::vector<Pose> poses = local_poses_at(bvh, 0.25);
  EXPECT_LT((poses[0].p - Eigen::Vector3d(1, 0, 0)).norm(), kRoundOff);
  EXPECT_LT(poses[1].R.angularDistance(yaw_rotation(20.0 * std::numbers::pi / 180.0)), 1e-7);
  EXPECT_EQ(local_poses_at(bvh, 1.0)[1].R.coeffs(), local_poses(bvh, 1)[1].R.coeffs());
}

TEST(Bvh, RefusalsNameFileLineExpectedAndFound) {
  const std::string good = kOneFrame + "0 0 0 0 0 0 0 0 0\n";
  const std::vector<std::string> cases = {"",
                                          "\n\n  \n",
                                          "PK\x03\x04",
                                          "HIERARCHY\nJOINT a",
                                          "HIERARCHY\nROOT\n{",
                                          "HIERARCHY\nROOT a\nOFFSET 0 0 0",
                                          "HIERARCHY\nROOT a\n{\nOFFSET 0 x 0",
                                          "HIERARCHY\nROOT a\n{\nOFFSET 0 nan 0",
                                          "HIERARCHY\nROOT a\n{\nOFFSET 0 1e999 0",
                                          "HIERARCHY\nROOT a\n{\n}",
                                          "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\n",
                                          two_joints("CHANNELS 7 Xrotation", good),
                                          two_joints("CHANNELS 1 Xrotatoin", good),
                                          two_joints("CHANNELS 2 Xrotation Xrotation", good),
                                          two_joints("JOINT Root\n{", good),
                                          two_joints(kThree + "\nOFFSET 0 0 0", good),
                                          two_joints(kThree, ""),
                                          two_joints(kThree, "Frames: 0\n"),
                                          two_joints(kThree, "Frames: 1.5\n"),
                                          two_joints(kThree, "Frames: 1\nFrame Time: 0\n"),
                                          two_joints(kThree, "Frames: 1\nFrame Time: -1\n"),
                                          two_joints(kThree, "Frames: 1\nFrame Time: nan\n"),
                                          two_joints(kThree, kOneFrame + "0 0 0 0 0 0 0 0\n"),
                                          two_joints(kThree, kOneFrame + "0 0 0 0 0 0 0 0 0 0\n"),
                                          two_joints(kThree, kOneFrame + "0 0 0 0 inf 0 0 0 0\n"),
                                          two_joints(kThree, kOneFrame + "0 0 0 0 0 0x1 0 0 0\n"),
                                          two_joints(kThree, "Frames: 3\nFrame Time: 1\n0 0 0 0 0 0 0 0 0\n"),
                                          two_joints(kThree, good + "0 0 0 0\n"),
                                          two_joints(kThree, good + "and more\n")};
  for (const std::string& bad : cases)
    EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)parse_bvh(bad, "x.bvh"); }));
}

TEST(Bvh, WhatMakersWriteInTheirOwnWayIsTaken) {
  const std::string frames = "Frames: 1\nFrame Time: 0.01\n1 2 3 4 5 6 7 8 9\n";
  const Bvh plain = parse_bvh(two_joints(kThree, frames), "x.bvh");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = two_joints(kThree, frames);
    text.replace(text.find(from), from.size(), to);
    return parse_bvh(text, "x.bvh");
  };
  for (const auto& [from, to] : {std::pair{"End Site", "End site"},
                                 {"End Site", "END SITE"},
                                 {"End Site", "EndSite"},
                                 {"End Site", "End Site Arm_end"},
                                 {"Frames: 1", "Frames : 1"},
                                 {"Frames: 1", "FRAMES:1"},
                                 {"Frame Time: 0.01", "Frame time :  0.01"},
                                 {"Xposition Yposition", "XPOSITION yposition"},
                                 {"JOINT Arm\n  {", "Joint Arm {"}}) {
    const Bvh read = with(from, to);
    EXPECT_EQ(read.values, plain.values) << to;
    EXPECT_EQ(read.joints.back().name, "Arm/end") << to;
    EXPECT_EQ(read.joints[0].channels, plain.joints[0].channels) << to;
  }
  EXPECT_EQ(with("JOINT Arm", "JOINT Bip01 L UpperArm \t").joints[1].name, "Bip01 L UpperArm");
}

TEST(Bvh, FramesBeyondTheAnnouncedOnesAreLeftOutWithANote) {
  const std::string one = kOneFrame + "1 2 3 4 5 6 7 8 9\n";
  EXPECT_TRUE(parse_bvh(two_joints(kThree, one), "x.bvh").notes.empty());
  const Bvh bvh = parse_bvh(two_joints(kThree, one + "9 8 7 6 5 4 3 2 1\n"), "x.bvh");
  EXPECT_EQ(bvh.frames, 1);
  EXPECT_EQ(bvh.values.size(), 9U);
  EXPECT_SENTENCE(bvh.notes);
}

TEST(Bvh, PositionChannelsThatNobodyFilledAreNoPositions) {
  const std::string channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation";
  const std::string frames = "Frames: 2\nFrame Time: 0.01\n0 0 0 0 0 0 0 0 0 0 0 0\n0 0 0 0 0 0 0 0 0 0 0 90\n";
  const Bvh bvh = parse_bvh(two_joints(channels, frames), "x.bvh");
  EXPECT_EQ(local_poses(bvh, 0)[1].p, Eigen::Vector3d(1, 0, 0));
  EXPECT_SENTENCE(bvh.notes);
  const Bvh filled = parse_bvh(
      two_joints(channels, "Frames: 2\nFrame Time: 0.01\n0 0 0 0 0 0 0 0 0 0 0 0\n0 0 0 0 0 0 0 0 1 0 0 0\n"), "x.bvh");
  EXPECT_EQ(local_poses(filled, 0)[1].p, Eigen::Vector3d(0, 0, 0));
  EXPECT_TRUE(filled.notes.empty());
}

TEST(Bvh, SeveralRootsAreReadEachWithNamesOfItsOwn) {
  const std::string one = two_joints(kThree, "");
  const std::string root = one.substr(one.find("ROOT"), one.find("MOTION") - one.find("ROOT"));
  const std::string values = "1 2 3 4 5 6 7 8 9";
  const Bvh bvh =
      parse_bvh("HIERARCHY\n" + root + root + "MOTION\n" + kOneFrame + values + " " + values + "\n", "x.bvh");
  ASSERT_EQ(bvh.joints.size(), 6U);
  EXPECT_EQ(bvh.joints[3].parent, -1);
  EXPECT_EQ(bvh.joints[4].parent, 3);
  EXPECT_EQ(global_poses(bvh, local_poses(bvh, 0))[5].p, global_poses(bvh, local_poses(bvh, 0))[2].p);
}

// Only a cut inside the last number can leave a file that is whole.
TEST(Bvh, TruncatedAnywhereIsRefused) {
  const std::string good = two_joints(kThree, "Frames: 2\nFrame Time: 0.5\n1 2 3 4 5 6 7 8 9\n1 2 3 4 5 6 7 8 9");
  EXPECT_NO_THROW((void)parse_bvh(good, "x.bvh"));
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_THROW((void)parse_bvh(good.substr(0, size), "x.bvh"), InputError) << size;
}

TEST(Bvh, DeepNestingNeedsNoDeepStack) {
  std::string text = "HIERARCHY\nROOT j\n{ OFFSET 0 0 0\n";
  for (int i = 0; i < 20'000; ++i) text += fmt::format("JOINT j{} {{ OFFSET 0 0 0\n", i);
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)parse_bvh(text, "x.bvh"); }));
}

TEST(Bvh, MissingFileIsNamed) {
  EXPECT_SENTENCE(thrown_message<InputError>([] { (void)read_bvh("no/such.bvh"); }));
}

}  // namespace
}  // namespace duet
