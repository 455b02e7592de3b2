
#include <cmath>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/carried_object.h"
#include "tests/support.h"

namespace duet {
namespace {

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
