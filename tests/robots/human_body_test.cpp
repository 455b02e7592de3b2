#include "duet/robots/human_body.h"

#include <limits>
#include <map>
#include <set>

#include "duet/core/recording.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

// Bones of an adult of about 1.75 m.
std::array<double, 24> adult_bones() {
  return {0.0,  0.10, 0.10, 0.11, 0.40, 0.40, 0.137, 0.42, 0.42, 0.06, 0.135, 0.135,
          0.21, 0.13, 0.13, 0.09, 0.12, 0.12, 0.29,  0.29, 0.25, 0.25, 0.085, 0.085};
}

TEST(HumanBody, CoversEveryRegionAndJoint) {
  const HumanBody body = make_human_body(adult_bones());
  std::set<std::string> names, regions;
  std::set<int> joints;
  for (const HumanCapsule& capsule : body.capsules) {
    EXPECT_TRUE(names.insert(capsule.name).second) << capsule.name;
    regions.insert(capsule.region);
    joints.insert(capsule.joint_a);
    joints.insert(capsule.joint_b);
    EXPECT_NE(capsule.joint_a, capsule.joint_b);
    EXPECT_LT(capsule.begin, capsule.end);
  }
  EXPECT_GE(body.capsules.size(), 20u);
  EXPECT_EQ(joints.size(), 24u);
  EXPECT_EQ(regions, (std::set<std::string>{"head", "neck", "chest", "abdomen", "back", "pelvis", "upper_arm",
                                            "forearm", "hand", "thigh", "shin", "foot"}));
}

// Capsules follow one bone: no joint moves between the two ends, so their length is constant.
TEST(HumanBody, EndsAreNeighboursInTheSkeleton) {
  for (const HumanCapsule& capsule : make_human_body(adult_bones()).capsules)
    EXPECT_EQ(kSmplParents[capsule.joint_b], capsule.joint_a) << capsule.name;
}

TEST(HumanBody, LeftMirrorsRight) {
  const HumanBody body = make_human_body(adult_bones());
  std::map<std::string, HumanCapsule> by_name;
  for (const HumanCapsule& capsule : body.capsules) by_name[capsule.name] = capsule;
  int pairs = 0;
  for (const auto& [name, left] : by_name) {
    if (!name.starts_with("left_")) continue;
    const HumanCapsule& right = by_name.at("right_" + name.substr(5));
    EXPECT_EQ(kSmplMirror[left.joint_a], right.joint_a);
    EXPECT_EQ(kSmplMirror[left.joint_b], right.joint_b);
    EXPECT_EQ(left.radius, right.radius);
    EXPECT_EQ(left.region, right.region);
    ++pairs;
  }
  EXPECT_GE(pairs, 9);
}

TEST(HumanBody, GrowsWithThePerson) {
  std::array<double, 24> tall = adult_bones();
  for (double& bone : tall) bone *= 1.2;
  const HumanBody small = make_human_body(adult_bones()), large = make_human_body(tall);
  for (size_t i = 0; i < small.capsules.size(); ++i)
    EXPECT_NEAR(large.capsules[i].radius, 1.2 * small.capsules[i].radius, 1e-15) << small.capsules[i].name;
}

TEST(HumanBody, AdultRadiiArePlausible) {
  for (const HumanCapsule& capsule : make_human_body(adult_bones()).capsules) {
    EXPECT_GT(capsule.radius, 0.025) << capsule.name;
    EXPECT_LT(capsule.radius, 0.13) << capsule.name;
  }
}

TEST(HumanBody, EndsLieOnTheLineOfTheJoints) {
  HumanCapsule capsule;
  capsule.joint_a = kNeck;
  capsule.joint_b = kHead;
  capsule.begin = 0.5;
  capsule.end = 2.0;
  Eigen::Matrix3Xd joints = Eigen::Matrix3Xd::Zero(3, 24);
  joints.col(kNeck) = Eigen::Vector3d(0, 0, 1.4);
  joints.col(kHead) = Eigen::Vector3d(0.1, 0, 1.5);
  const auto ends = capsule.ends(joints);
  EXPECT_LT((ends[0] - Eigen::Vector3d(0.05, 0, 1.45)).norm(), 1e-15);
  EXPECT_LT((ends[1] - Eigen::Vector3d(0.2, 0, 1.6)).norm(), 1e-15);
}

TEST(HumanBody, RefusesBonesWithoutLength) {
  for (const double bad :
       {0.0, -0.1, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    std::array<double, 24> bones = adult_bones();
    bones[kLeftKnee] = bad;
    EXPECT_EQ(test::thrown_message<std::invalid_argument>([&] { make_human_body(bones); }),
              fmt::format("human body: expected a finite, positive length of the bone from 'left_knee' to 'left_hip', "
                          "found {}",
                          bad));
  }
}

}  // namespace
}  // namespace duet
