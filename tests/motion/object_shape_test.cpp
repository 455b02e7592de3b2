#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/carried_object.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

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
  EXPECT_THAT(fault("a.stl", ""), HasSubstr("expected the shape of an object as .obj or .json"));
  EXPECT_THAT(fault("a.obj", "f 1 2 3\n"), HasSubstr("expected points of an object, found none"));
  EXPECT_THAT(fault("a.obj", "v 0 0 0\nv 0 x 0\n"), HasSubstr("line 2: expected a vertex 'v x y z', found 'x'"));
  EXPECT_THAT(fault("a.obj", "v 0 0\n"), HasSubstr("line 1: expected a vertex"));
  EXPECT_THAT(fault("a.obj", "v 0 0 nan\n"), HasSubstr("line 1: expected metres, at most 100 from the origin"));
  EXPECT_THAT(fault("a.obj", "v 0 0 100.5\n"), HasSubstr("line 1: expected metres"));
  EXPECT_EQ(read("a.obj", "v 0 0 100\n").cols(), 1);
  EXPECT_THAT(fault("a.json", "[]"), HasSubstr("expected an object with either 'points' or 'box'"));
  EXPECT_THAT(fault("a.json", R"({"points": [], "box": [1, 1, 1]})"), HasSubstr("either 'points' or 'box'"));
  EXPECT_THAT(fault("a.json", R"({"points": [], "centre": [1, 1, 1]})"), HasSubstr("unknown key 'centre'"));
  EXPECT_THAT(fault("a.json", R"({"points": 3})"), HasSubstr("'points': expected a list of points"));
  EXPECT_THAT(fault("a.json", R"({"points": [[0, 1]]})"), HasSubstr("point 0: expected three numbers, found [0,1]"));
  EXPECT_THAT(fault("a.json", R"({"points": [[0, 1, "2"]]})"), HasSubstr("expected three numbers"));
  EXPECT_THAT(fault("a.json", R"({"box": [1, 0, 1]})"), HasSubstr("'box': expected lengths above zero"));
  EXPECT_THAT(fault("a.json", "{"), HasSubstr("not valid JSON"));
}

}  // namespace
}  // namespace duet
