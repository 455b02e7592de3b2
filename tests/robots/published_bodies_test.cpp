// The bodies of published walkers beside the G1 and the T1: what their makers say of them, and that their numbers are
// the makers'.
#include <gtest/gtest.h>

#include "duet/robots/kinematics.h"
#include "duet/robots/robot_model.h"
#include "tests/support.h"

namespace duet {
namespace {

struct PublishedBody {
  const char* card;
  int joints;
  double mass, standing;  // [kg], of the base over the soles in the neutral pose [m]
  const char* urdf;       // of the maker; "": none that can be read
};

std::ostream& operator<<(std::ostream& out, const PublishedBody& body) { return out << body.card; }

class PublishedBodies : public testing::TestWithParam<PublishedBody> {};

TEST_P(PublishedBodies, StandOnTheirSolesWithTheMakersMass) {
  const PublishedBody& body = GetParam();
  const RobotModel robot = load_robot(card_path(body.card));
  EXPECT_EQ(robot.dof(), body.joints);
  EXPECT_NEAR(robot.total_mass(), body.mass, 1e-3);
  EXPECT_NEAR(robot.standing_height, body.standing, 2e-3);
  EXPECT_EQ(robot.feet.size(), 8U);
  EXPECT_EQ(robot.tracks.size(), 6U);
  Kinematics kinematics(robot);
  kinematics.update({}, robot.neutral);
  const Eigen::Vector3d left = kinematics.frame_position(robot.track_frame("lhand"));
  const Eigen::Vector3d right = kinematics.frame_position(robot.track_frame("rhand"));
  EXPECT_LT((left - Eigen::Vector3d(right.x(), -right.y(), right.z())).norm(), 1e-2) << "hands mirror one another";
}

TEST_P(PublishedBodies, HaveTheNumbersOfTheMakersDescription) {
  const std::string path = test::shared_file(std::string("arena/") + GetParam().urdf);
  if (*GetParam().urdf == '\0') return;
  if (path.empty()) GTEST_SKIP() << "not run: " << GetParam().urdf << " absent";
  const RobotModel ours = load_robot(card_path(GetParam().card)), maker = load_robot(card_path(GetParam().card), path);
  constexpr double kPrinted = 1e-9;  // twelve digits
  ASSERT_EQ(ours.links.size(), maker.links.size());
  for (std::size_t i = 0; i < maker.links.size(); ++i) {
    const RobotLink &a = ours.links[i], &b = maker.links[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_NEAR(a.mass, b.mass, kPrinted);
    EXPECT_LT((a.com - b.com).norm(), kPrinted) << a.name;
    EXPECT_LT((a.inertia - b.inertia).norm(), kPrinted) << a.name;
    EXPECT_LT((a.X_PL.p - b.X_PL.p).norm(), kPrinted) << a.name;
    EXPECT_LT((a.X_PL.R.toRotationMatrix() - b.X_PL.R.toRotationMatrix()).norm(), kPrinted) << a.name;
    if (i == 0) continue;
    EXPECT_LT((a.axis - b.axis).norm(), kPrinted) << a.name;
    EXPECT_EQ(ours.joints[i - 1].lower, maker.joints[i - 1].lower);
    EXPECT_EQ(ours.joints[i - 1].upper, maker.joints[i - 1].upper);
    EXPECT_EQ(ours.joints[i - 1].effort, maker.joints[i - 1].effort);
    EXPECT_EQ(ours.joints[i - 1].velocity, maker.joints[i - 1].velocity);
  }
  for (const RobotFrame& frame : ours.frames)
    EXPECT_LT((frame.X_LF.p - maker.frames[maker.frame_index(frame.name)].X_LF.p).norm(), kPrinted) << frame.name;
}

INSTANTIATE_TEST_SUITE_P(All, PublishedBodies,
                         testing::Values(PublishedBody{"agibot_x1", 12, 36.064, 0.6130, ""},
                                         PublishedBody{"h1", 10, 51.650, 1.0342, "h1/h1.urdf"},
                                         PublishedBody{"h1_2", 12, 67.368, 1.0151, ""},
                                         PublishedBody{"t1_12dof", 12, 31.614, 0.6709,
                                                       "t1/booster_gym/T1_locomotion.urdf"},
                                         PublishedBody{"t1_23dof", 23, 31.614, 0.6659, "t1/T1_serial.urdf"},
                                         PublishedBody{"xbot_l", 12, 53.036, 0.8853, "xbot_l/XBot-L.urdf"}),
                         [](const auto& info) { return std::string(info.param.card); });

}  // namespace
}  // namespace duet
