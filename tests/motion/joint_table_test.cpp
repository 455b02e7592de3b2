// The table of the 24 joints in docs/file-formats.md is that of the code.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <sstream>

#include "duet/core/file.h"
#include "duet/tasks/synthesis/posed_body.h"

namespace duet {
namespace {

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

}  // namespace
}  // namespace duet
