// What is told of a robot motion from its numbers, and what stays as it is documented.
#include <gmock/gmock.h>

#include <numbers>

#include "duet/formats/robot_motion_format.h"
#include "tests/formats/known_motion.h"
#include "tests/formats/motion_files.h"

namespace duet {
namespace {

using test::distance;
using test::file_of;
using test::known_motion;
using test::kSame;
using test::read_bytes;
using test::robot;
using ::testing::Contains;
using ::testing::HasSubstr;

// The rows of `table` with the quaternion's scalar in the other place.
std::string with_scalar_first(const std::string& table) {
  Eigen::MatrixXd rows = parse_csv_table(table, "x.csv").values;
  const Eigen::MatrixXd vector = rows.middleRows(3, 3);
  rows.row(3) = Eigen::MatrixXd(rows.row(6));
  rows.middleRows(4, 3) = vector;
  return csv_text({}, rows);
}

TEST(RobotMotionFormat, TheOrderOfQuaternionsIsToldByWhereTheSolesAre) {
  const RobotMotion motion = known_motion(robot("g1"));
  const std::string xyzw = file_of(motion, "unitree"), wxyz = with_scalar_first(xyzw);
  for (const auto& [bytes, found] :
       {std::pair<std::string, std::string>{xyzw, "xyzw (as documented)"}, {wxyz, "wxyz (detected)"}}) {
    const RobotMotionFile read = read_bytes(bytes, "x.csv", {.rate_hz = 50.0});
    EXPECT_LT(distance(read.motion, motion), kSame);
    EXPECT_THAT(read.evidence, Contains(HasSubstr("root rotation: " + found + ": the lower sole is at ")));
  }
  const RobotMotionFile told = read_bytes(wxyz, "x.csv", {.rate_hz = 50.0, .quaternion = QuaternionOrder::kXyzw});
  EXPECT_GT(distance(told.motion, motion), 1.0);
  EXPECT_THAT(told.evidence, Contains(HasSubstr("root rotation: xyzw (as told)")));
}

// A robot in the air tells nothing: the documented order stays.
TEST(RobotMotionFormat, TheDocumentedOrderOfQuaternionsStaysWhereNeitherPutsTheSolesOnTheFloor) {
  RobotMotion motion = known_motion(robot("g1"));
  for (Pose& X_WB : motion.root) X_WB.p.z() += 0.3;
  EXPECT_LT(distance(read_bytes(file_of(motion, "unitree"), "x.csv", {.rate_hz = 50.0}).motion, motion), kSame);
}

// Facing -x, w and z of a quaternion are 0 and 1, and the other order is no turn at all: both stand upright.
TEST(RobotMotionFormat, TheDocumentedOrderOfQuaternionsStaysWhereBothLookAlike) {
  RobotMotion motion = known_motion(robot("g1"));
  for (Pose& X_WB : motion.root) {
    X_WB.R =
        yaw_rotation(std::numbers::pi - 0.02) * Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY()));
    X_WB.p.z() = 0.85;  // soles 7 to 8 cm over the floor as documented, 4 cm in the other order
  }
  for (const double lift : {-0.04, -0.02, 0.0, 0.02}) {
    RobotMotion lifted = motion;
    for (Pose& X_WB : lifted.root) X_WB.p.z() += lift;
    for (const char* format : {"unitree", "beyondmimic", "holosoma", "duet"})
      EXPECT_LT(distance(read_bytes(file_of(lifted, format), std::string("x") + robot_motion_format(format).ending,
                                    {.rate_hz = 50.0})
                             .motion,
                         lifted),
                kSame)
          << format << " " << lift;
  }
}

TEST(RobotMotionFormat, DegreesAreToldByTheLimitsOfTheJoints) {
  const RobotMotion motion = known_motion(robot("g1"));
  Eigen::MatrixXd rows = parse_csv_table(file_of(motion, "unitree"), "x.csv").values;
  rows.bottomRows(29) *= 180.0 / std::numbers::pi;
  const RobotMotionFile read = read_bytes(csv_text({}, rows), "x.csv", {.rate_hz = 50.0});
  EXPECT_LT(distance(read.motion, motion), kSame);
  EXPECT_THAT(read.evidence, Contains(HasSubstr("angles: deg (detected): within the joint limits")));
  const RobotMotionFile told =
      read_bytes(csv_text({}, rows), "x.csv", {.rate_hz = 50.0, .angles = AngleUnit::kRadians});
  EXPECT_THAT(told.evidence, Contains(HasSubstr("angles: rad (as told)")));
}

TEST(RobotMotionFormat, CentimetresAreToldByTheHeightOfTheRoot) {
  const RobotMotion motion = known_motion(robot("g1"));
  Eigen::MatrixXd rows = parse_csv_table(file_of(motion, "unitree"), "x.csv").values;
  rows.topRows(3) *= 100.0;
  const RobotMotionFile read = read_bytes(csv_text({}, rows), "x.csv", {.rate_hz = 50.0});
  EXPECT_LT(distance(read.motion, motion), kSame);
  EXPECT_THAT(read.evidence, Contains(HasSubstr("length: 0.01 m a unit (detected)")));
  EXPECT_THAT(read_bytes(csv_text({}, rows), "x.csv", {.metres = 1.0}).evidence,
              Contains(HasSubstr("length: 1 m a unit (as told)")));
}

TEST(RobotMotionFormat, ARateInTheNameOfAUnitreeFileCounts) {
  const std::string bytes = file_of(known_motion(robot("g1")), "unitree");
  EXPECT_EQ(read_bytes(bytes, "a/take_102.bvh_60Hz.csv").motion.rate_hz, 60.0);
  EXPECT_EQ(read_bytes(bytes, "walk.csv").motion.rate_hz, 30.0);
  EXPECT_EQ(read_bytes(bytes, "hz.csv").motion.rate_hz, 30.0);
  EXPECT_EQ(read_bytes(bytes, "a_60hz.csv", {.rate_hz = 20.0}).motion.rate_hz, 20.0);
}

TEST(RobotMotionFormat, NamedJointsAreBoundByNameInAnyOrder) {
  const RobotMotion motion = known_motion(robot("g1"));
  const CsvTable table = parse_csv_table(file_of(motion, "hhtools"), "x.csv");
  std::vector<int> order(table.columns.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(order.size() - 1 - i);
  std::vector<std::string> columns;
  for (const int c : order) columns.push_back(table.columns[static_cast<std::size_t>(c)]);
  columns[0] = "dof_left_finger";  // was the last wrist
  const RobotMotionFile read =
      read_bytes("# sample_rate = 40\n" + csv_text(columns, rows_of(table.values, order)), "x.csv");
  RobotMotion expected = motion;
  expected.q.row(28).setZero();
  EXPECT_EQ(read.motion.rate_hz, 40.0);
  EXPECT_LT(distance(read.motion, expected), kSame);
  EXPECT_THAT(read.evidence, Contains("held straight, not in the file: right_wrist_yaw_joint"));
  EXPECT_THAT(read.evidence, Contains("left out, not of 'g1': left_finger"));
}

TEST(RobotMotionFormat, ATableOfTimesHasTheirRate) {
  std::string bytes = file_of(known_motion(robot("g1"), 11, 20.0), "hhtools");
  bytes.erase(0, bytes.find('\n') + 1);
  EXPECT_NEAR(read_bytes(bytes, "x.csv").motion.rate_hz, 20.0, 1e-9);
}

TEST(RobotMotionFormat, NearlyUnitQuaternionsAreRenormalisedAndSaid) {
  const RobotMotion motion = known_motion(robot("g1"));
  Eigen::MatrixXd rows = parse_csv_table(file_of(motion, "unitree"), "x.csv").values;
  rows.col(4).segment<4>(3) *= 0.95;
  const RobotMotionFile read = read_bytes(csv_text({}, rows), "x.csv", {.rate_hz = 50.0});
  EXPECT_LT(distance(read.motion, motion), kSame);
  EXPECT_THAT(read.evidence, Contains("root rotation: renormalised, worst length off by 0.0500 in frame 4"));
}

}  // namespace
}  // namespace duet
