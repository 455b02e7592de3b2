// Facts that are told of a robot motion from its numbers, and those that stay as documented.
#include <gmock/gmock.h>

#include <numbers>

#include "duet/core/require.h"
#include "duet/formats/motion_layout.h"
#include "duet/formats/robot_motion_format.h"
#include "tests/formats/known_motion.h"
#include "tests/formats/motion_files.h"
#include "tests/support.h"

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

TEST(RobotMotionFormat, ARateInANameIsReadWholeOrAskedFor) {
  const std::string bytes = file_of(known_motion(robot("g1")), "unitree");
  for (const auto& [name, rate] : {std::pair{"walk_119.88hz.csv", 119.88},
                                   {"walk_119_88Hz.csv", 119.88},
                                   {"u_29_97hz.csv", 29.97},
                                   {"take_3_60hz.csv", 60.0},
                                   {"walk2_50hz.csv", 50.0},
                                   {"dance_120_hz.csv", 120.0},
                                   {"dance_25fps.csv", 25.0}})
    EXPECT_EQ(read_bytes(bytes, name).motion.rate_hz, rate) << name;
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { read_bytes(bytes, "take_77_33hz.csv"); }));
  EXPECT_EQ(read_bytes(bytes, "take_77_33hz.csv", {.rate_hz = 33.0}).motion.rate_hz, 33.0);
}

// A motion that stands, with everything off zero, so that each fact tells.
RobotMotion standing_motion() {
  RobotMotion motion = known_motion(robot("g1"));
  const RobotState state = robot("g1").standing_state();
  for (int t = 0; t < motion.frames(); ++t) {
    const double s = 0.1 * t;
    motion.q.col(t) = robot("g1").neutral;
    for (const char* name : {"left_shoulder_pitch_joint", "right_elbow_joint", "left_elbow_joint"})
      motion.q(robot("g1").joint_index(name), t) += 0.4 * std::sin(s);
    motion.root[t] = {yaw_rotation(0.3 + 0.01 * t), state.X_WB.p};
  }
  return motion;
}

TEST(RobotMotionFormat, ALineOfNamesBindsAUnitreeTable) {
  const RobotMotion motion = standing_motion();
  const Eigen::MatrixXd rows = parse_csv_table(file_of(motion, "unitree"), "x.csv").values;
  std::vector<std::string> names = {"root_x", "root_y", "root_z", "qx", "qy", "qz", "qw"};
  for (const std::string& joint : motion.joint_names) names.push_back(joint);
  std::vector<int> order(names.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>((i * 5 + 3) % order.size());
  std::vector<std::string> shuffled;
  for (const int c : order) shuffled.push_back(names[static_cast<std::size_t>(c)]);
  Eigen::MatrixXd mixed(rows.rows(), rows.cols());
  for (std::size_t i = 0; i < order.size(); ++i) mixed.row(static_cast<Eigen::Index>(i)) = rows.row(order[i]);
  for (const char* format : {"", "unitree"}) {
    const RobotMotionFile read = read_bytes(csv_text(shuffled, mixed), "x.csv", {.rate_hz = 50.0}, format);
    EXPECT_LT(distance(read.motion, motion), kSame);
    EXPECT_THAT(read.evidence, Contains(HasSubstr("29, bound by name")));
  }
  names[3] = "left_foo";
  EXPECT_SENTENCE(test::thrown_message<InputError>(
      [&] { read_bytes(csv_text(names, rows), "x.csv", {.rate_hz = 50.0}, "unitree"); }));
}

TEST(RobotMotionFormat, TheOrderOfUnnamedJointsIsToldByTheRobotsBody) {
  const RobotMotion motion = standing_motion();
  const Eigen::MatrixXd rows = parse_csv_table(file_of(motion, "unitree"), "x.csv").values;
  const std::vector<int> joints = joints_in_order(robot("g1"), TreeOrder::kBreadthFirst);
  Eigen::MatrixXd breadth = rows;
  for (std::size_t i = 0; i < joints.size(); ++i)
    breadth.row(7 + static_cast<Eigen::Index>(i)) = rows.row(7 + joints[i]);
  const RobotMotionFile read = read_bytes(csv_text({}, breadth), "x.csv", {.rate_hz = 50.0});
  EXPECT_LT(distance(read.motion, motion), kSame);
  EXPECT_THAT(read.evidence, Contains(HasSubstr("joints: breadth-first, detected")));
  EXPECT_THAT(read.evidence, testing::Not(Contains(testing::StartsWith("doubt"))));
  const RobotMotionFile told =
      read_bytes(csv_text({}, breadth), "x.csv", {.rate_hz = 50.0, .joints = TreeOrder::kDepthFirst});
  EXPECT_THAT(told.evidence, Contains(testing::StartsWith("doubt: within the limits")));
  Eigen::MatrixXd negated = rows;
  negated.bottomRows(29) *= -1.0;
  negated.bottomRows(29).setConstant(-3.5);
  EXPECT_SENTENCE(
      test::thrown_message<InputError>([&] { read_bytes(csv_text({}, negated), "x.csv", {.rate_hz = 50.0}); }));
}

TEST(RobotMotionFormat, AnotherAxisUpAndAWrongClockAreNotPassedOver) {
  const RobotMotion motion = standing_motion();
  Eigen::MatrixXd rows = parse_csv_table(file_of(motion, "unitree"), "x.csv").values;
  EXPECT_THAT(read_bytes(csv_text({}, rows), "x.csv", {.rate_hz = 5000.0}).evidence,
              Contains(HasSubstr("doubt: at 5000 Hz a joint is quicker than its limit")));
  rows.row(1).swap(rows.row(2));
  EXPECT_SENTENCE(
      test::thrown_message<InputError>([&] { read_bytes(csv_text({}, rows), "x.csv", {.rate_hz = 50.0}); }));
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
