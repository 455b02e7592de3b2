#include <gmock/gmock.h>

#include <cmath>

#include "duet/motion/layouts/joint_layout.h"
#include "duet/motion/people/source_clip.h"

namespace duet {
namespace {

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
    PointTracks& joints = people.joints[who];
    joints.at(2, kWristLeft) = Eigen::Vector3d(1.0, 0.0, -3.0);
    for (const int t : {3, 4, 5}) joints.at(t, kWristLeft).setConstant(std::nan(""));
    joints.at(6, kWristLeft) = Eigen::Vector3d(5.0, 8.0, -3.0);
    std::optional<RawPeople> filled;
    EXPECT_NE(fill_gaps(people, kRate, filled), "");
    ASSERT_TRUE(filled);
    for (const int t : {3, 4, 5}) {
      const Eigen::Vector3d expected(1.0 + (t - 2), 2.0 * (t - 2), -3.0);
      EXPECT_LT((filled->joints[who].at(t, kWristLeft) - expected).norm(), 1e-15) << "frame " << t;
    }
    EXPECT_EQ(filled->joints[who].at(6, kWristLeft), joints.at(6, kWristLeft));
    EXPECT_EQ(filled->joints[1 - who].data(), people.joints[1 - who].data());
  }
}

TEST(JointGaps, WherePeopleAreSeenThroughoutNothingIsCopied) {
  std::optional<RawPeople> filled;
  EXPECT_EQ(fill_gaps(two_people(), kRate, filled), "");
  EXPECT_FALSE(filled);
}

}  // namespace
}  // namespace duet
