#include "duet/robots/kinematics.h"

#include <cstdlib>

#include "duet/robots/robot_cards.h"
#include "duet/robots/robot_model.h"
#include "tests/robots/allocations.h"
#include "tests/robots/fixtures.h"
#include "tests/robots/moved_t1.h"

namespace duet {
namespace {

using test::g1;
using test::MovedT1;
using test::random_state;
using test::replaced;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// The chain product with homogeneous matrices and quaternion exponentials: no code in common with Kinematics.
Eigen::Matrix4d chain_product(const RobotModel& model, const RobotState& state, int link) {
  if (link == 0) {
    Eigen::Matrix4d X = Eigen::Matrix4d::Identity();
    X.topLeftCorner<3, 3>() = state.X_WB.R.toRotationMatrix();
    X.topRightCorner<3, 1>() = state.X_WB.p;
    return X;
  }
  const RobotLink& l = model.links[link];
  const double half = 0.5 * state.q[link - 1];
  Eigen::Quaterniond turn;
  turn.w() = std::cos(half);
  turn.vec() = std::sin(half) * l.axis;
  Eigen::Matrix4d X = Eigen::Matrix4d::Identity();
  X.topLeftCorner<3, 3>() = (l.X_PL.R * turn).toRotationMatrix();
  X.topRightCorner<3, 1>() = l.X_PL.p;
  return chain_product(model, state, l.parent) * X;
}

void expect_chain_product(const RobotModel& model, const RobotState& state) {
  Kinematics kinematics(model);
  kinematics.update(state.X_WB, state.q);
  for (int i = 0; i < static_cast<int>(model.links.size()); ++i) {
    const Eigen::Matrix4d X = chain_product(model, state, i);
    const Eigen::Matrix3d R = X.topLeftCorner<3, 3>();
    const Eigen::Vector3d p = X.topRightCorner<3, 1>();
    EXPECT_LT((kinematics.R_WL(i) - R).cwiseAbs().maxCoeff(), 1e-12) << model.links[i].name;
    EXPECT_LT((kinematics.p_WL(i) - p).cwiseAbs().maxCoeff(), 1e-12) << model.links[i].name;
  }
}

TEST(Kinematics, EqualsTheChainProductOnTheG1) {
  Random random(1, 1);
  for (int k = 0; k < 20; ++k) expect_chain_product(g1(), random_state(g1(), random));
}

TEST(Kinematics, EqualsTheChainProductWithASkewAxis) {
  Random random(2, 1);
  const RobotModel model = test::load_small();
  for (int k = 0; k < 20; ++k) expect_chain_product(model, random_state(model, random));
}

TEST(Kinematics, NegativeAxisTurnsTheOtherWay) {
  const RobotModel plus = test::load_small();
  const RobotModel minus = test::load_small(
      test::kSmallCard, test::replaced(test::kSmallUrdf, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"0 -1 0\"/>"));
  Kinematics a(plus), b(minus);
  a.update({}, Eigen::Vector2d(0.4, 0.0));
  b.update({}, Eigen::Vector2d(-0.4, 0.0));
  EXPECT_LT((a.p_WL(2) - b.p_WL(2)).norm(), 1e-15);
  b.update({}, Eigen::Vector2d(0.4, 0.0));
  EXPECT_GT((a.p_WL(2) - b.p_WL(2)).norm(), 0.01);
}

TEST(Kinematics, RotationsStayOrthonormal) {
  Random random(3, 1);
  const RobotState state = random_state(g1(), random);
  Kinematics kinematics(g1());
  kinematics.update(state.X_WB, state.q);
  for (int i = 0; i <= g1().dof(); ++i)
    EXPECT_LT((kinematics.R_WL(i) * kinematics.R_WL(i).transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
}

TEST(Kinematics, FramesAndShapesSitOnTheirLinks) {
  Random random(4, 1);
  const RobotState state = random_state(g1(), random);
  Kinematics kinematics(g1());
  kinematics.update(state.X_WB, state.q);
  for (size_t f = 0; f < g1().frames.size(); ++f) {
    const RobotFrame& frame = g1().frames[f];
    const Pose X = kinematics.X_WL(frame.link) * frame.X_LF;
    EXPECT_LT((kinematics.frame_position(static_cast<int>(f)) - X.p).norm(), 1e-14) << frame.name;
    EXPECT_LT(kinematics.frame_pose(static_cast<int>(f)).R.angularDistance(X.R), 1e-7) << frame.name;
  }
  for (size_t s = 0; s < g1().shapes.size(); ++s) {
    const RobotShape& shape = g1().shapes[s];
    EXPECT_LT((kinematics.shape_position(static_cast<int>(s)) - kinematics.X_WL(shape.link) * shape.X_LS.p).norm(),
              1e-14);
  }
}

TEST(Kinematics, CenterOfMassIsTheMeanOfMass) {
  const RobotModel model = test::load_small();
  Kinematics kinematics(model);
  kinematics.update({}, Eigen::Vector2d::Zero());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < model.links.size(); ++i)
    sum += model.links[i].mass * (kinematics.X_WL(static_cast<int>(i)) * model.links[i].com);
  EXPECT_LT((kinematics.center_of_mass() - sum / model.total_mass()).norm(), 1e-15);
  EXPECT_NEAR(model.total_mass(), 6.5, 1e-15);
}

// Central differences of step h have an error of order h^2, and round-off of order epsilon / h.
constexpr double kStep = 1e-5;
constexpr double kDifferenceTolerance = 1e-9;

TEST(Kinematics, PointJacobianIsTheDerivativeOfTheFramePosition) {
  Random random(5, 1);
  const RobotModel& model = g1();
  Kinematics kinematics(model);
  for (const char* name : {"pelvis", "left_hand_link", "right_toe_link", "head_link"}) {
    const int frame = model.frame_index(name);
    const RobotState state = random_state(model, random);
    kinematics.update(state.X_WB, state.q);
    Eigen::MatrixXd J = Eigen::MatrixXd::Constant(3, 6 + model.dof(), 7.0);
    kinematics.point_jacobian(model.frames[frame].link, kinematics.frame_position(frame), J);
    for (int k = 0; k < J.cols(); ++k) {
      const Eigen::VectorXd u = Eigen::VectorXd::Unit(J.cols(), k);
      const RobotState ahead = test::moved(state, u, kStep), behind = test::moved(state, u, -kStep);
      kinematics.update(ahead.X_WB, ahead.q);
      const Eigen::Vector3d p = kinematics.frame_position(frame);
      kinematics.update(behind.X_WB, behind.q);
      const Eigen::Vector3d difference = (p - kinematics.frame_position(frame)) / (2.0 * kStep);
      EXPECT_LT((J.col(k) - difference).norm(), kDifferenceTolerance) << name << ", column " << k;
    }
  }
}

TEST(Kinematics, AngularJacobianIsTheDerivativeOfTheRotation) {
  Random random(6, 1);
  const RobotModel& model = g1();
  Kinematics kinematics(model);
  const int link = model.frames[model.frame_index("left_wrist_yaw_link")].link;
  const RobotState state = random_state(model, random);
  kinematics.update(state.X_WB, state.q);
  Eigen::MatrixXd J(3, 6 + model.dof());
  kinematics.angular_jacobian(link, J);
  for (int k = 0; k < J.cols(); ++k) {
    const Eigen::VectorXd u = Eigen::VectorXd::Unit(J.cols(), k);
    const RobotState ahead = test::moved(state, u, kStep), behind = test::moved(state, u, -kStep);
    kinematics.update(ahead.X_WB, ahead.q);
    const Eigen::Matrix3d R = kinematics.R_WL(link);
    kinematics.update(behind.X_WB, behind.q);
    const Eigen::Matrix3d turn = R * kinematics.R_WL(link).transpose();  // exp of 2 h times the angular velocity
    const Eigen::Vector3d difference =
        Eigen::Vector3d(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1)) / (4.0 * kStep);
    EXPECT_LT((J.col(k) - difference).norm(), kDifferenceTolerance) << "column " << k;
  }
}

TEST(Kinematics, CenterOfMassJacobianIsItsDerivative) {
  Random random(7, 1);
  const RobotModel& model = g1();
  Kinematics kinematics(model);
  const RobotState state = random_state(model, random);
  kinematics.update(state.X_WB, state.q);
  Eigen::MatrixXd J(3, 6 + model.dof());
  kinematics.center_of_mass_jacobian(J);
  for (int k = 0; k < J.cols(); ++k) {
    const Eigen::VectorXd u = Eigen::VectorXd::Unit(J.cols(), k);
    const RobotState ahead = test::moved(state, u, kStep), behind = test::moved(state, u, -kStep);
    kinematics.update(ahead.X_WB, ahead.q);
    const Eigen::Vector3d p = kinematics.center_of_mass();
    kinematics.update(behind.X_WB, behind.q);
    EXPECT_LT((J.col(k) - (p - kinematics.center_of_mass()) / (2.0 * kStep)).norm(), kDifferenceTolerance)
        << "column " << k;
  }
}

TEST(Kinematics, AllocatesNothingAfterConstruction) {
  if (!test::counts_allocations()) GTEST_SKIP() << "not run: the sanitizer owns malloc";
  Random random(8, 1);
  const RobotState state = random_state(g1(), random);
  Kinematics kinematics(g1());
  Eigen::MatrixXd J(3, 6 + g1().dof());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const long before = test::allocations();
  kinematics.update(state.X_WB, state.q);
  kinematics.point_jacobian(20, kinematics.frame_position(3), J);
  kinematics.angular_jacobian(20, J);
  kinematics.center_of_mass_jacobian(J);
  sum += kinematics.center_of_mass() + kinematics.shape_position(2) + kinematics.frame_pose(4).p;
  EXPECT_EQ(test::allocations() - before, 0);
  EXPECT_TRUE(sum.allFinite());
}

TEST(FrameTracks, HoldThePositionsOfEachFrameOfTheMotion) {
  Random random(9, 1);
  const RobotModel& model = g1();
  RobotMotion motion;
  motion.joint_names = model.joint_names();
  motion.q.resize(model.dof(), 3);
  for (int t = 0; t < 3; ++t) {
    const RobotState state = random_state(model, random);
    motion.root.push_back(state.X_WB);
    motion.q.col(t) = state.q;
  }
  const std::vector<int> frames = {model.frame_index("head_link"), model.frame_index("pelvis")};
  const PointTracks tracks = frame_tracks(model, motion, frames);
  ASSERT_EQ(tracks.frames(), 3);
  ASSERT_EQ(tracks.points(), 2);
  Kinematics kinematics(model);
  kinematics.update(motion.root[2], motion.q.col(2));
  EXPECT_EQ((tracks.at(2, 0) - kinematics.frame_position(frames[0])).norm(), 0.0);
  EXPECT_EQ((tracks.at(1, 1) - motion.root[1].p).norm(), 0.0);
}

TEST(FrameTracks, RefuseAMotionOfAnotherRobot) {
  RobotMotion motion;
  motion.root.resize(2);
  motion.q = Eigen::MatrixXd::Zero(12, 2);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { frame_tracks(g1(), motion, {0}); }));
  motion.q = Eigen::MatrixXd::Zero(29, 2);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { frame_tracks(g1(), motion, {0, 99}); }));
}

const RobotModel& t1() {
  static const RobotModel model = load_robot(DUET_SOURCE_DIR "/robots/t1/t1.yaml");
  return model;
}

// The height of a frame over the soles in the neutral pose, base upright.
double height_of(const RobotModel& robot, const std::string& frame) {
  Kinematics kinematics(robot);
  kinematics.update(robot.standing_state().X_WB, robot.neutral);
  return kinematics.frame_position(robot.frame_index(frame)).z();
}

TEST(Origin, OfTheRobotsThatShipIsWhereTheirUrdfsHaveIt) {
  for (const RobotCardFile& card : robot_cards()) {
    EXPECT_TRUE(urdf_origin(load_robot(card.path)).isZero(0.0)) << card.name;
    EXPECT_THAT(robot_notes(card.path), IsEmpty()) << card.name;
  }
}

TEST(Origin, AnywhereInTheUrdfGivesTheSameBody) {
  constexpr double kRounding = 1e-12;
  const double pelvis = height_of(t1(), "Waist");
  for (const Eigen::Vector3d& trunk : {Eigen::Vector3d(0.0, 0.0, 0.7), Eigen::Vector3d(0.0, 0.0, -0.5),
                                       Eigen::Vector3d(0.4, -0.3, 0.9), Eigen::Vector3d(0.0, 2.0, 0.0)}) {
    const MovedT1 moved(trunk, "");
    const RobotModel robot = load_robot(moved.card);
    EXPECT_NEAR(robot.standing_height, pelvis, kRounding);
    EXPECT_NEAR(robot.fall.height / robot.standing_height, 0.57, 1e-9);
    for (const char* frame : {"Trunk", "head_link", "left_palm_link", "right_toe_link"})
      EXPECT_NEAR(height_of(robot, frame), height_of(t1(), frame), kRounding) << frame;
    Kinematics here(robot), there(t1());
    here.update({}, robot.neutral);
    there.update({}, t1().neutral);
    EXPECT_LT(((here.center_of_mass() - here.frame_position(robot.frame_index("Waist"))) -
               (there.center_of_mass() - there.frame_position(t1().frame_index("Waist"))))
                  .norm(),
              1e-9);
    EXPECT_LT((urdf_origin(robot) - (here.frame_position(robot.frame_index("Trunk")) - trunk)).norm(), kRounding);
    ASSERT_EQ(robot_notes(moved.card).size(), 1U);
    EXPECT_THAT(robot_notes(moved.card)[0], HasSubstr("m from the pelvis in the neutral pose"));
  }
}

TEST(Origin, NearThePelvisStaysWhereItIs) {
  const RobotModel robot = load_robot(MovedT1({0.0, 0.0, 0.05}).card);
  EXPECT_TRUE(urdf_origin(robot).isZero(0.0));
  EXPECT_NEAR(robot.standing_height, t1().standing_height - 0.05, 1e-12);
}

TEST(Origin, HeightsOfTheCardAreOfTheOriginWhereItIsAboveThem) {
  const double drop = t1().standing_height - height_of(t1(), "Waist");  // of the pelvis below the trunk
  EXPECT_NEAR(load_robot(MovedT1({0.0, 0.0, -0.6}, "fall: {height: 0.98, cos_tilt: 0.7}").card).fall.height,
              0.38 - drop, 1e-9);
  EXPECT_EQ(load_robot(MovedT1({0.0, 0.0, 0.7}).card).fall.height, 0.38);  // no height of an origin in the floor
}

TEST(Origin, WithoutAPelvisIsBetweenTheHipsAndWithoutLegsRefusedBelowTheSoles) {
  const MovedT1 moved({0.0, 0.0, 0.7});
  const std::string text = replaced(read_file(moved.card), "  - {frame: Waist, smpl: pelvis}\n", "");
  write_file(moved.card, text);
  EXPECT_LT(std::abs(load_robot(moved.card).standing_height - height_of(t1(), "Hip_Pitch_Left")), 1e-9);
  const std::size_t legs = text.find("legs:\n");
  write_file(moved.card, text.substr(0, legs) + text.substr(text.find("waist:", legs)));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { load_robot(moved.card); }));
}

TEST(RobotNotes, SayThatDynamicsAreNotSimulated) {
  const MovedT1 moved({0.0, 0.0, 0.0});
  const std::string urdf = moved.folder / "t1.urdf";
  write_file(urdf, replaced(read_file(urdf), "<axis xyz=\"0 0 1\"/>",
                            "<axis xyz=\"0 0 1\"/><dynamics damping=\"20\" friction=\"5\"/>"));
  EXPECT_THAT(robot_notes(moved.card),
              ElementsAre(urdf + ": <dynamics> of 1 joints (damping up to 20 N m s/rad, friction up to 5 N m) is not "
                                 "simulated: joints move without either"));
}

}  // namespace
}  // namespace duet
