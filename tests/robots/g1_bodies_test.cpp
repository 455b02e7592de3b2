// The bodies that published controllers were made for, against the maker's descriptions.
#include <gtest/gtest.h>

#include "duet/robots/kinematics.h"
#include "duet/robots/robot_model.h"
#include "tests/robots/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Body {
  const char* card;
  const char* makers_urdf;  // of the shared reference data
  int dof;
  double mass;  // [kg], of the controller's own model
};

void PrintTo(const Body& body, std::ostream* out) { *out << body.card; }

constexpr Body kBodies[] = {{"g1_27dof", "g1_29dof_with_hand_rev_1_0", 27, 34.394},
                            {"g1_12dof", "g1_12dof", 12, 32.107},
                            {"g1_twist2", "g1_29dof_rev_1_0", 29, 33.341},
                            {"g1_playground", "g1_29dof_rev_1_0", 29, 33.341}};

std::string card_of(const Body& body) { return fmt::format("{}/robots/g1/{}.yaml", DUET_SOURCE_DIR, body.card); }

class G1Bodies : public ::testing::TestWithParam<Body> {
 protected:
  const RobotModel model = load_robot(card_of(GetParam()));
};

TEST_P(G1Bodies, HaveTheirMassAndDegreesOfFreedom) {
  EXPECT_EQ(model.name, GetParam().card);
  EXPECT_EQ(model.dof(), GetParam().dof);
  EXPECT_NEAR(model.total_mass(), GetParam().mass, 5e-4);
}

TEST_P(G1Bodies, AgreeWithTheMakersDescription) {
  const std::string path = test::shared_file(fmt::format("g1/{}.urdf", GetParam().makers_urdf));
  if (path.empty()) GTEST_SKIP() << "not run: g1/" << GetParam().makers_urdf << ".urdf absent";
  const RobotModel maker = load_robot(card_of(GetParam()), path);
  constexpr double kEqual = 1e-9;
  ASSERT_EQ(model.links.size(), maker.links.size());
  for (size_t i = 0; i < model.links.size(); ++i) {
    const RobotLink &a = model.links[i], &b = maker.links[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_NEAR(a.mass, b.mass, kEqual) << a.name;
    EXPECT_LT((a.com - b.com).norm(), kEqual) << a.name;
    EXPECT_LT((a.inertia - b.inertia).norm(), kEqual) << a.name;
    EXPECT_LT((a.X_PL.p - b.X_PL.p).norm(), kEqual) << a.name;
    EXPECT_LT((a.X_PL.R.toRotationMatrix() - b.X_PL.R.toRotationMatrix()).norm(), kEqual) << a.name;
    if (i == 0) continue;
    EXPECT_LT((a.axis - b.axis).norm(), kEqual) << a.name;
    EXPECT_EQ(model.joints[i - 1].lower, maker.joints[i - 1].lower) << a.name;
    EXPECT_EQ(model.joints[i - 1].upper, maker.joints[i - 1].upper) << a.name;
    EXPECT_EQ(model.joints[i - 1].effort, maker.joints[i - 1].effort) << a.name;
  }
}

// Policies, metrics and detectors look frames up by name, whatever the body.
TEST_P(G1Bodies, KnowTheFramesPairsAndTracksOfTheG1) {
  ASSERT_EQ(model.pairs.size(), test::g1().pairs.size());
  for (size_t k = 0; k < model.pairs.size(); ++k)
    EXPECT_EQ(model.frames[model.pairs[k].frame].name, test::g1().frames[test::g1().pairs[k].frame].name);
  ASSERT_EQ(model.keypoints.size(), test::g1().keypoints.size());
  EXPECT_EQ(model.tracks.size(), test::g1().tracks.size());
}

TEST_P(G1Bodies, StandOnEightSpheresWithTheirLegsAsTheControllersWere) {
  EXPECT_EQ(model.feet.size(), 8U);
  EXPECT_GT(model.standing_height, 0.74);
  EXPECT_LT(model.standing_height, 0.80);
  const RobotState state = model.standing_state();
  Kinematics kinematics(model);
  kinematics.update(state.X_WB, state.q);
  const Eigen::Vector3d com = kinematics.center_of_mass();
  EXPECT_GT(com.x(), -0.06);
  EXPECT_LT(com.x(), 0.12);
  EXPECT_NEAR(com.y(), 0.0, 3e-3);
}

INSTANTIATE_TEST_SUITE_P(Cards, G1Bodies, ::testing::ValuesIn(kBodies),
                         [](const auto& info) { return std::string(info.param.card); });

TEST(G1Bodies, Of12DofHaveTheWristsAndHandsOfTheWholeRobotAtTheSamePlace) {
  const RobotModel legs = load_robot(card_of(kBodies[1]));
  Kinematics a(legs), b(test::g1());
  Eigen::VectorXd q = Eigen::VectorXd::Zero(29);
  q.head(12) = legs.neutral;
  a.update({}, legs.neutral);
  b.update({}, q);
  for (const char* frame : {"left_hand_link", "right_hand_link", "left_wrist_yaw_link", "head_link", "chest_link"}) {
    const double apart =
        (a.frame_position(legs.frame_index(frame)) - b.frame_position(test::g1().frame_index(frame))).norm();
    EXPECT_LT(apart, 0.06) << frame;  // the 23-joint description's arms are another build
  }
}

// The bodies of published walkers beside the G1 and the T1: what their makers say of them, and that their numbers are
// the makers'.

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
