// The bodies that published controllers were made for, against the maker's descriptions.
#include "duet/robots/kinematics.h"
#include "tests/robots/fixtures.h"

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

}  // namespace
}  // namespace duet
