#include "duet/motion/carried_object.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/interaction_clip.h"
#include "duet/motion/paired_motion.h"
#include "tests/motion/npz_edit.h"
#include "tests/motion/people.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

CarriedObject turning_box(int frames) {
  CarriedObject object;
  object.keypoints.resize(3, 2);
  object.keypoints << 0.2, -0.1, 0.3, 0.0, -0.1, 0.4;
  for (int t = 0; t < frames; ++t) object.poses.push_back({.R = yaw_rotation(0.1 * t), .p = {0.05 * t, 0.3, 1.0}});
  return object;
}

InteractionClip five_frames() {
  InteractionClip clip = test::two_people(5);
  clip.phases = {.act_begin = 1, .act_end = 2};
  clip.contacts.clear();
  return clip;
}

PairedMotion paired(int frames) {
  PairedMotion motion;
  motion.clip_id = "carry";
  motion.phases = {.act_begin = 1, .act_end = 2};
  motion.robot.joint_names = {"a"};
  motion.robot.root.resize(static_cast<std::size_t>(frames));
  motion.robot.q = Eigen::MatrixXd::Zero(1, frames);
  motion.partner = motion.source_partner = motion.source_reactor = test::moving_person(frames, 50.0, {0, 0, 0});
  return motion;
}

void expect_same(const CarriedObject& a, const CarriedObject& b) {
  EXPECT_EQ(a.keypoints, b.keypoints);
  ASSERT_EQ(a.poses.size(), b.poses.size());
  for (std::size_t t = 0; t < a.poses.size(); ++t) {
    EXPECT_EQ(a.poses[t].p, b.poses[t].p);
    EXPECT_EQ(a.poses[t].R.coeffs(), b.poses[t].R.coeffs());
  }
}

TEST(CarriedObject, ClipsAndPairedMotionsGiveBackEveryBit) {
  InteractionClip clip = five_frames();
  clip.object = turning_box(5);
  expect_same(parse_clip(clip_bytes(clip), "clip.npz").object, clip.object);
  PairedMotion motion = paired(5);
  motion.object = turning_box(5);
  expect_same(parse_paired_motion(paired_motion_bytes(motion), "pair.npz").object, motion.object);
}

TEST(CarriedObject, FilesWithoutOneHaveNoneOfItsKeys) {
  for (const std::string& bytes : {clip_bytes(five_frames()), paired_motion_bytes(paired(5))})
    for (const std::string& key : Npz::parse(bytes, "file").keys())
      EXPECT_THAT(key, testing::Not(testing::StartsWith("object")));
  EXPECT_TRUE(parse_clip(clip_bytes(five_frames()), "clip.npz").object.empty());
}

TEST(CarriedObject, HalfAnObjectIsRefusedByItsKey) {
  InteractionClip clip = five_frames();
  clip.object = turning_box(5);
  for (const char* key : {"object_position", "object_quat_wxyz", "object_keypoints"})
    EXPECT_SENTENCE(thrown_message<InputError>([&] { parse_clip(test::without_key(clip_bytes(clip), key), "x.npz"); }));
  const auto no_frame = [](Npz& npz) {
    npz.set("object_position", std::vector<double>{}, {0, 3});
    npz.set("object_quat_wxyz", std::vector<double>{}, {0, 4});
  };
  EXPECT_SENTENCE(thrown_message<InputError>([&] { parse_clip(test::edited(clip_bytes(clip), no_frame), "x.npz"); }));
}

TEST(CarriedObject, ValidationNamesTheFault) {
  const auto fault = [](const CarriedObject& object) {
    return thrown_message<std::invalid_argument>([&] { validate(object, 5, "clip 'x', object"); });
  };
  EXPECT_NO_THROW(validate(CarriedObject{}, 5, "none"));
  EXPECT_NO_THROW(validate(turning_box(5), 5, "box"));
  EXPECT_SENTENCE(fault(turning_box(4)));
  CarriedObject bad = turning_box(5);
  bad.keypoints.resize(3, 0);
  EXPECT_SENTENCE(fault(bad));
  bad.keypoints = Eigen::Matrix3Xd::Zero(3, 17);
  EXPECT_SENTENCE(fault(bad));
  bad.keypoints = Eigen::Matrix3Xd::Zero(3, 16);
  EXPECT_NO_THROW(validate(bad, 5, "box"));
  bad.keypoints(1, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(fault(bad));
  bad = turning_box(5);
  bad.poses[2].p.x() = std::numeric_limits<double>::infinity();
  EXPECT_SENTENCE(fault(bad));
  bad = turning_box(5);
  bad.poses[3].R.coeffs() *= 1.1;
  EXPECT_SENTENCE(fault(bad));
}

TEST(CarriedObject, KeypointsMoveWithIt) {
  const CarriedObject object = turning_box(4);
  const PointTracks tracks = keypoint_tracks(object);
  ASSERT_EQ(tracks.points(), 2);
  for (int t = 0; t < 4; ++t)
    for (int o = 0; o < 2; ++o)
      EXPECT_LT((tracks.at(t, o) - object.poses[t] * Eigen::Vector3d(object.keypoints.col(o))).norm(), 1e-15);
  EXPECT_TRUE(keypoint_tracks(CarriedObject{}).empty());
}

TEST(CarriedObject, ResamplesAsThePeopleDo) {
  const CarriedObject fast = resample(turning_box(5), 25.0, 50.0);
  ASSERT_EQ(static_cast<int>(fast.poses.size()), resampled_frames(5, 25.0, 50.0));
  EXPECT_LT((fast.poses[3].p - Eigen::Vector3d(0.075, 0.3, 1.0)).norm(), 1e-12);
  EXPECT_LT(fast.poses[3].R.angularDistance(yaw_rotation(0.15)), 1e-9);
  expect_same(resample(turning_box(5), 50.0, 50.0), turning_box(5));
}

TEST(CarriedObject, PaddedAndMirroredClipsTakeItAlong) {
  InteractionClip clip = five_frames();
  clip.object = turning_box(5);
  const InteractionClip longer = padded(clip, 0.04, 0.06);
  ASSERT_EQ(longer.object.poses.size(), 10U);
  EXPECT_EQ(longer.object.poses[1].p, clip.object.poses[0].p);
  EXPECT_EQ(longer.object.poses[2].p, clip.object.poses[0].p);
  EXPECT_EQ(longer.object.poses[3].p, clip.object.poses[1].p);
  EXPECT_EQ(longer.object.poses[9].p, clip.object.poses[4].p);
  const PointTracks before = keypoint_tracks(clip.object), after = keypoint_tracks(mirrored(clip).object);
  for (int t = 0; t < 5; ++t)
    for (int o = 0; o < 2; ++o)
      EXPECT_LT((after.at(t, o) - Eigen::Vector3d(1, -1, 1).cwiseProduct(Eigen::Vector3d(before.at(t, o)))).norm(),
                1e-12);
}

TEST(CarriedObject, AnotherObjectIsAnotherClip) {
  PairedMotion motion = paired(5);
  const std::string without = clip_digest(motion);
  motion.object = turning_box(5);
  const std::string with = clip_digest(motion);
  EXPECT_NE(with, without);
  motion.object.keypoints(0, 0) += 0.01;
  EXPECT_NE(clip_digest(motion), with);
}

TEST(CarriedObject, NoneIsNoneInTheMirror) { EXPECT_TRUE(mirrored(CarriedObject{}).empty()); }

class ObjectShape : public testing::Test {
 protected:
  Eigen::Matrix3Xd read(const std::string& name, const std::string& text) {
    write_file(folder_ / name, text);
    return read_object_keypoints(folder_ / name);
  }
  std::string fault(const std::string& name, const std::string& text) {
    return test::thrown_message<InputError>([&] { read(name, text); });
  }

 private:
  test::ScratchFolder folder_;
};

TEST_F(ObjectShape, AMeshGivesItsVertices) {
  const Eigen::Matrix3Xd points =
      read("a.obj", "# a triangle\nv 0 0 0\nv 0.1 0 -2e-1 1.0\r\nvn 0 0 1\n  v 0 0.3 0\nf 1 2 3\n");
  ASSERT_EQ(points.cols(), 3);
  EXPECT_EQ(points.col(1), Eigen::Vector3d(0.1, 0, -0.2));
  EXPECT_EQ(points.col(2), Eigen::Vector3d(0, 0.3, 0));
}

TEST_F(ObjectShape, ABoxIsItsCentreAndCorners) {
  const Eigen::Matrix3Xd points = read("box.json", R"({"box": [0.6, 0.4, 0.2], "centre": [0, 0, 0.1]})");
  ASSERT_EQ(points.cols(), 9);
  EXPECT_EQ(points.col(0), Eigen::Vector3d(0, 0, 0.1));
  EXPECT_LT((points.rowwise().maxCoeff() - Eigen::Vector3d(0.3, 0.2, 0.2)).norm(), 1e-15);
  EXPECT_LT((points.rowwise().minCoeff() - Eigen::Vector3d(-0.3, -0.2, 0.0)).norm(), 1e-15);
}

TEST_F(ObjectShape, PointsAreTakenAsTheyAre) {
  const Eigen::Matrix3Xd points = read("p.json", R"({"points": [[0, 0, 1], [0.5, 0, 0]]})");
  ASSERT_EQ(points.cols(), 2);
  EXPECT_EQ(points.col(1), Eigen::Vector3d(0.5, 0, 0));
}

TEST_F(ObjectShape, ManyVerticesAreThinnedToThoseFarthestFromEachOther) {
  std::string text;
  for (int i = 0; i <= 100; ++i) text += "v " + std::to_string(0.01 * i) + " 0 0\n";
  const Eigen::Matrix3Xd points = read("line.obj", text);
  ASSERT_EQ(points.cols(), kMostObjectKeypoints);
  EXPECT_EQ(std::abs(points(0, 0) - points(0, 1)), 1.0);  // the two ends, whichever is first
  EXPECT_EQ(points(0, 2), 0.5);
  EXPECT_EQ(farthest_points(points, 16), points);
}

TEST_F(ObjectShape, FaultsNameFileAndPlace) {
  EXPECT_SENTENCE(fault("a.stl", ""));
  EXPECT_SENTENCE(fault("a.obj", "f 1 2 3\n"));
  EXPECT_SENTENCE(fault("a.obj", "v 0 0 0\nv 0 x 0\n"));
  EXPECT_SENTENCE(fault("a.obj", "v 0 0\n"));
  EXPECT_SENTENCE(fault("a.obj", "v 0 0 nan\n"));
  EXPECT_SENTENCE(fault("a.obj", "v 0 0 100.5\n"));
  EXPECT_EQ(read("a.obj", "v 0 0 100\n").cols(), 1);
  for (const char* text :
       {"[]", R"({"points": [], "box": [1, 1, 1]})", R"({"points": [], "centre": [1, 1, 1]})", R"({"points": 3})",
        R"({"points": [[0, 1]]})", R"({"points": [[0, 1, "2"]]})", R"({"box": [1, 0, 1]})", "{"})
    EXPECT_SENTENCE(fault("a.json", text));
}

}  // namespace
}  // namespace duet
