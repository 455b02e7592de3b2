#include "duet/robots/kinematics.h"
#include "duet/robots/robot_cards.h"
#include "duet/robots/robot_model.h"
#include "tests/robots/fixtures.h"
#include "tests/robots/moved_t1.h"

namespace duet {
namespace {

using test::MovedT1;
using test::replaced;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

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
