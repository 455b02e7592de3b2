// The Booster T1 that ships with duet against the maker's description; its roles where they are others than the G1's.
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/roles.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

const RobotModel& t1() {
  static const RobotModel model = load_robot(card_path("t1"));
  return model;
}

Eigen::VectorXd with_waist(double angle) {
  Eigen::VectorXd q = t1().neutral;
  q[t1().joint_index("Waist")] = angle;
  return q;
}

TEST(T1, MassDegreesOfFreedomAndHeight) {
  EXPECT_EQ(t1().dof(), 29);
  EXPECT_NEAR(t1().total_mass(), 33.52, 5e-3);
  EXPECT_NEAR(t1().standing_height, 0.679, 5e-4);
  EXPECT_EQ(t1().feet.size(), 8u);
}

TEST(T1, AgreesWithTheMakersDescription) {
  const std::string path = test::shared_file("t1/t1_29dof.urdf");
  if (path.empty()) GTEST_SKIP() << "not run: t1/t1_29dof.urdf absent";
  const RobotModel maker = load_robot(card_path("t1"), path);
  constexpr double kEqual = 1e-9;
  ASSERT_EQ(t1().links.size(), maker.links.size());
  for (std::size_t i = 0; i < maker.links.size(); ++i) {
    const RobotLink &a = t1().links[i], &b = maker.links[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.parent, b.parent);
    EXPECT_NEAR(a.mass, b.mass, kEqual);
    EXPECT_LT((a.com - b.com).norm(), kEqual);
    EXPECT_LT((a.inertia - b.inertia).norm(), kEqual);
    EXPECT_LT((a.X_PL.p - b.X_PL.p).norm(), kEqual);
    EXPECT_LT((a.X_PL.R.toRotationMatrix() - b.X_PL.R.toRotationMatrix()).norm(), kEqual);
    if (i == 0) continue;
    EXPECT_LT((a.axis - b.axis).norm(), kEqual);
    EXPECT_EQ(t1().joints[i - 1].lower, maker.joints[i - 1].lower);
    EXPECT_EQ(t1().joints[i - 1].upper, maker.joints[i - 1].upper);
    EXPECT_EQ(t1().joints[i - 1].effort, maker.joints[i - 1].effort);
    EXPECT_EQ(t1().joints[i - 1].velocity, maker.joints[i - 1].velocity);
  }
  ASSERT_EQ(t1().frames.size(), maker.frames.size());
  for (const RobotFrame& frame : maker.frames) {
    const RobotFrame& ours = t1().frames[t1().frame_index(frame.name)];
    EXPECT_EQ(ours.link, frame.link) << frame.name;
    EXPECT_LT((ours.X_LF.p - frame.X_LF.p).norm(), kEqual) << frame.name;
  }
}

TEST(T1, ThePelvisHangsBelowTheBaseAndTurnsWithTheWaist) {
  EXPECT_FALSE(base_is_pelvis(t1()));
  const Pose still = pelvis_in_base(t1(), with_waist(0.0)), turned = pelvis_in_base(t1(), with_waist(0.7));
  EXPECT_LT((still.p - Eigen::Vector3d(0.0625, 0.0, -0.1155)).norm(), 1e-15);
  EXPECT_LT((turned.p - still.p).norm(), 1e-15);
  EXPECT_NEAR(yaw_of(turned.R), 0.7, 1e-15);
  Kinematics kinematics(t1());
  kinematics.update({}, with_waist(0.7));
  EXPECT_LT((kinematics.frame_position(t1().frame_index("Waist")) - turned.p).norm(), 1e-15);
}

TEST(T1, ItsWaistTiltsNothingAndItsLegsBeginBelowIt) {
  EXPECT_TRUE(tilting_waist(t1()).empty());
  EXPECT_EQ(leg_joints(t1()).size(), 12u);
  EXPECT_EQ(t1().joints[t1().roles.legs[0].front()].name, "Left_Hip_Pitch");
}

TEST(T1, MirroringTheNeutralPoseGivesTheNeutralPose) {
  for (int j = 0; j < t1().dof(); ++j)
    EXPECT_EQ(mirror_sign(t1(), j) * t1().neutral[j], t1().neutral[t1().roles.counterpart[j]]) << t1().joints[j].name;
}

// Its waist yaw has no counterpart: mirrored, it turns the other way.
TEST(T1, MirroredAnglesMirrorEveryPair) {
  Eigen::VectorXd q = t1().neutral, mirrored = q;
  Random random(1, 1);
  for (int j = 0; j < t1().dof(); ++j) q[j] += random.uniform(-0.2, 0.2);
  for (int j = 0; j < t1().dof(); ++j) mirrored[t1().roles.counterpart[j]] = mirror_sign(t1(), j) * q[j];
  Kinematics kinematics(t1()), image(t1());
  kinematics.update({}, q);
  image.update({}, mirrored);
  const auto place = [](const Kinematics& k, const char* frame) { return k.frame_position(t1().frame_index(frame)); };
  for (const auto& [left, right] : std::initializer_list<std::pair<const char*, const char*>>{
           {"left_palm_link", "right_palm_link"}, {"left_toe_link", "right_toe_link"}, {"head_link", "head_link"}}) {
    const Eigen::Vector3d a = place(kinematics, left), b = place(image, right);
    EXPECT_LT((a - Eigen::Vector3d(b.x(), -b.y(), b.z())).norm(), 2e-3)
        << left;  // the maker's shoulders are 0.9 mrad off
  }
}

}  // namespace
}  // namespace duet
