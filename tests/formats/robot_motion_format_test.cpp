#include "duet/formats/robot_motion_format.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>
#include <numbers>

#include "duet/core/file.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "duet/formats/link_motion.h"
#include "tests/core/pickle_bytes.h"
#include "tests/formats/known_motion.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::distance;
using test::known_motion;
using test::source_of;
using test::thrown_message;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr double kSame = 1e-6;  // what a round trip may change: nine digits of text

const RobotModel& robot(const std::string& name) {
  static const RobotModel g1 = load_robot(card_path("g1")), t1 = load_robot(card_path("t1"));
  return name == "g1" ? g1 : t1;
}

RobotMotionFile read_bytes(const std::string& bytes, const std::string& name, const RobotMotionOptions& options = {},
                           const std::string& format = "") {
  return read_robot_motion(motion_source(bytes, name), robot("g1"), options, format);
}

std::vector<RobotMotionFormat> written_formats() {
  std::vector<RobotMotionFormat> formats;
  for (const RobotMotionFormat& format : robot_motion_formats())
    if (format.write != nullptr) formats.push_back(format);
  return formats;
}

std::string file_of(const RobotMotion& motion, const std::string& format) {
  return robot_motion_files(motion, robot("g1"), robot_motion_format(format), {.rate_hz = motion.rate_hz}).at("");
}

// ---- round trips

TEST(RobotMotionFormat, WhatIsWrittenIsReadBack) {
  for (const std::string name : {"g1", "t1"}) {
    for (const RobotMotionFormat& format : written_formats()) {
      const RobotMotion motion = known_motion(robot(name));
      const MotionFiles files = robot_motion_files(motion, robot(name), format, {.rate_hz = motion.rate_hz});
      const RobotMotionFile read = read_robot_motion(source_of(files, "x" + std::string(format.ending)), robot(name),
                                                     {.rate_hz = motion.rate_hz});
      EXPECT_EQ(read.format, format.name) << name;
      EXPECT_LT(distance(read.motion, motion), kSame) << name << " " << format.name;
      EXPECT_EQ(read.motion.joint_names, robot(name).joint_names());
      EXPECT_LT(read.kinematics_error.value_or(0.0), kSame) << name << " " << format.name;
    }
  }
}

TEST(RobotMotionFormat, FilesAndFoldersOnDiskAreReadBack) {
  const test::ScratchFolder folder;
  for (const RobotMotionFormat& format : written_formats()) {
    const RobotMotion motion = known_motion(robot("g1"));
    const std::string path = folder / (std::string("new/") + format.name + format.ending);
    write_robot_motion(motion, robot("g1"), format, path, {.rate_hz = 50.0});
    const RobotMotionFile read = read_robot_motion(path, robot("g1"), {.rate_hz = 50.0});
    EXPECT_EQ(read.format, format.name);
    EXPECT_LT(distance(read.motion, motion), kSame) << format.name;
  }
}

TEST(RobotMotionFormat, TheSameMotionGivesTheSameBytes) {
  for (const RobotMotionFormat& format : written_formats()) {
    const RobotMotion motion = known_motion(robot("g1"));
    EXPECT_EQ(robot_motion_files(motion, robot("g1"), format), robot_motion_files(motion, robot("g1"), format));
  }
}

// Files without a rate would be played at the wrong speed: they are written at the format's.
TEST(RobotMotionFormat, FormatsThatHoldNoRateAreWrittenAtTheirOwn) {
  const RobotMotion motion = known_motion(robot("g1"), 26, 25.0);  // 1 s
  for (const auto& [name, rate_hz] :
       {std::pair<std::string, double>{"unitree", 30.0}, {"bones", 120.0}, {"sonic", 50.0}}) {
    const RobotMotionFormat& format = robot_motion_format(name);
    EXPECT_EQ(written_rate(format, 25.0, {}), rate_hz);
    const RobotMotionFile read =
        read_robot_motion(source_of(robot_motion_files(motion, robot("g1"), format), "x.csv"), robot("g1"));
    EXPECT_EQ(read.motion.rate_hz, rate_hz);
    EXPECT_EQ(read.motion.frames(), static_cast<int>(rate_hz) + 1) << name;
    EXPECT_LT(distance(read.motion, resample(motion, rate_hz)), kSame) << name;
  }
  for (const char* name : {"gmr", "phc", "beyondmimic", "holosoma", "hhtools", "duet"})
    EXPECT_EQ(written_rate(robot_motion_format(name), 25.0, {}), 25.0) << name;
  EXPECT_EQ(written_rate(robot_motion_format("gmr"), 25.0, {.rate_hz = 30.0}), 30.0);
}

// ---- layouts that are only read, from stand-ins

TEST(RobotMotionFormat, StandInsOfLayoutsThatAreOnlyReadAreRead) {
  const RobotMotion motion = known_motion(robot("g1"));
  struct StandIn {
    std::string format, bytes, path;
    RobotMotionOptions options;
  };
  for (const StandIn& made :
       {StandIn{"omniretarget", test::omniretarget_stand_in(motion, robot("g1")), "x.npz", {}},
        StandIn{"locomujoco", test::locomujoco_stand_in(motion, robot("g1")), "x.npz", {.motion = "0"}},
        StandIn{"spider", test::spider_stand_in(motion, robot("g1")), "x.npz", {}}}) {
    const RobotMotionFile read = read_bytes(made.bytes, made.path, made.options);
    EXPECT_EQ(read.format, made.format);
    EXPECT_EQ(read.motion.rate_hz, 50.0) << made.format;
    EXPECT_LT(distance(read.motion, motion), kSame) << made.format;
  }
}

TEST(RobotMotionFormat, PhumaHasJointsFirstAndNoWrists) {
  RobotMotion motion = known_motion(robot("g1"));
  const RobotMotionFile read = read_bytes(test::phuma_stand_in(motion, robot("g1")), "kick.npy");
  EXPECT_EQ(read.format, "phuma");
  EXPECT_EQ(read.motion.rate_hz, 30.0);
  EXPECT_THAT(read.evidence, Contains(HasSubstr("without its wrists, which are held straight")));
  for (const int wrist : robot("g1").roles.wrists) motion.q.row(wrist).setZero();
  EXPECT_LT(distance(read.motion, motion), kSame);
}

TEST(RobotMotionFormat, OneOfSeveralTrajectoriesIsChosen) {
  const RobotMotion motion = known_motion(robot("g1"));
  const std::string bytes = test::locomujoco_stand_in(motion, robot("g1"));
  EXPECT_EQ(read_bytes(bytes, "x.npz", {.motion = "1"}).motion.frames(), motion.frames() - 1);
  EXPECT_THAT(thrown_message<InputError>([&] { (void)read_bytes(bytes, "x.npz"); }),
              HasSubstr("'x.npz': holds 2 motions, name one of them: 0 to 1"));
  EXPECT_THAT(thrown_message<InputError>([&] { (void)read_bytes(bytes, "x.npz", {.motion = "2"}); }),
              HasSubstr("no motion '2', expected 0 to 1"));
}

TEST(RobotMotionFormat, ObjectsAfterTheJointsAreLeftOutAndSaid) {
  const std::string bytes = test::omniretarget_stand_in(known_motion(robot("g1")), robot("g1"));
  EXPECT_THAT(read_bytes(bytes, "x.npz").evidence, Contains("1 objects after the joints: left out"));
}

TEST(RobotMotionFormat, DuetsPairedMotionGivesItsRobot) {
  const RobotMotion motion = known_motion(robot("g1"));
  Npz npz;
  npz.set_text("schema", "duet.paired_motion");
  npz.set_number("rate_hz", 50.0);
  npz.set("robot_joint_names", motion.joint_names);
  put_rows(npz, "robot_root_position", root_positions(motion));
  put_rows(npz, "robot_root_quat_wxyz", root_quaternions(motion, QuaternionOrder::kWxyz));
  put_rows(npz, "robot_q", motion.q);
  const RobotMotionFile read = read_bytes(npz.bytes(), "x.npz");
  EXPECT_EQ(read.format, "paired");
  EXPECT_LT(distance(read.motion, motion), kSame);
}

// ---- what a layout is documented to be

// IsaacLab's order of the G1, as BeyondMimic's and SONIC's code list it.
TEST(RobotMotionFormat, BreadthFirstIsIsaacLabsOrderOfTheG1) {
  const std::vector<std::string> isaac = {
      "left_hip_pitch_joint",       "right_hip_pitch_joint",  "waist_yaw_joint",         "left_hip_roll_joint",
      "right_hip_roll_joint",       "waist_roll_joint",       "left_hip_yaw_joint",      "right_hip_yaw_joint",
      "waist_pitch_joint",          "left_knee_joint",        "right_knee_joint",        "left_shoulder_pitch_joint",
      "right_shoulder_pitch_joint", "left_ankle_pitch_joint", "right_ankle_pitch_joint", "left_shoulder_roll_joint",
      "right_shoulder_roll_joint",  "left_ankle_roll_joint",  "right_ankle_roll_joint",  "left_shoulder_yaw_joint",
      "right_shoulder_yaw_joint",   "left_elbow_joint",       "right_elbow_joint",       "left_wrist_roll_joint",
      "right_wrist_roll_joint",     "left_wrist_pitch_joint", "right_wrist_pitch_joint", "left_wrist_yaw_joint",
      "right_wrist_yaw_joint"};
  EXPECT_EQ(joint_names(robot("g1"), joints_in_order(robot("g1"), TreeOrder::kBreadthFirst)), isaac);
  EXPECT_EQ(joint_names(robot("g1"), joints_in_order(robot("g1"), TreeOrder::kDepthFirst)), robot("g1").joint_names());
}

TEST(RobotMotionFormat, UnitreesTableIsPositionQuaternionXyzwAndJoints) {
  const RobotMotion motion = known_motion(robot("g1"));
  const CsvTable table = parse_csv_table(file_of(motion, "unitree"), "x.csv");
  ASSERT_EQ(table.values.rows(), 36);
  EXPECT_TRUE(table.columns.empty());
  const Eigen::Quaterniond& R = motion.root[3].R;
  EXPECT_NEAR((table.values.col(3).head<3>() - motion.root[3].p).norm(), 0.0, kSame);
  EXPECT_NEAR((table.values.col(3).segment<4>(3) - R.coeffs()).norm(), 0.0, kSame);
  EXPECT_NEAR((table.values.col(3).tail(29) - motion.q.col(3)).norm(), 0.0, kSame);
}

TEST(RobotMotionFormat, BonesIsCentimetresAndDegreesOfFixedAxes) {
  RobotMotion motion = known_motion(robot("g1"));
  const double x = 0.2, y = -0.3, z = 2.0;  // scipy's Rotation.from_euler("xyz", [x, y, z]) is Rz Ry Rx
  motion.root[1].R = Eigen::AngleAxisd(z, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(y, Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(x, Eigen::Vector3d::UnitX());
  const CsvTable table = parse_csv_table(file_of(motion, "bones"), "x.csv");
  constexpr double kDegree = std::numbers::pi / 180.0;
  const auto at = [&](const std::string& column) { return table.values(table.get(column), 1); };
  EXPECT_EQ(table.columns.front(), "Frame");
  EXPECT_NEAR(at("Frame"), 1.0, 0.0);
  EXPECT_NEAR(at("root_translateZ"), 100.0 * motion.root[1].p.z(), 1e-6);
  EXPECT_NEAR(at("root_rotateX"), x / kDegree, 1e-6);
  EXPECT_NEAR(at("root_rotateY"), y / kDegree, 1e-6);
  EXPECT_NEAR(at("root_rotateZ"), z / kDegree, 1e-6);
  EXPECT_NEAR(at("left_knee_joint_dof"), motion.q(3, 1) / kDegree, 1e-6);
}

TEST(RobotMotionFormat, BonesSurvivesAPitchOfNinetyDegrees) {
  RobotMotion motion = known_motion(robot("g1"));
  for (int t = 0; t < motion.frames(); ++t)
    motion.root[static_cast<std::size_t>(t)].R =
        yaw_rotation(0.3) * Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitY()));
  EXPECT_LT(distance(read_bytes(file_of(motion, "bones"), "x.csv", {.rate_hz = 50.0}).motion, motion), 1e-6);
}

TEST(RobotMotionFormat, BeyondMimicHasBodiesInTheOrderThatItNames) {
  const RobotMotion motion = known_motion(robot("g1"));
  for (const TreeOrder order : {TreeOrder::kBreadthFirst, TreeOrder::kDepthFirst}) {
    const MotionFiles files =
        robot_motion_files(motion, robot("g1"), robot_motion_format("beyondmimic"), {.order = order});
    const Npz npz = Npz::parse(files.at(""), "x.npz");
    EXPECT_EQ(npz.text("order"), to_string(order));
    EXPECT_EQ(npz.integers("fps", {1}), std::vector<std::int64_t>{50});
    const std::vector<int> links = links_in_order(robot("g1"), order);
    EXPECT_EQ(npz.strings("body_names", {-1}), link_names(robot("g1"), links));
    const PointTracks bodies = npz.tracks("body_pos_w", 30);
    Kinematics kinematics(robot("g1"));
    kinematics.update(motion.root[5], motion.q.col(5));
    for (std::size_t b = 0; b < links.size(); ++b)
      EXPECT_NEAR((bodies.at(5, static_cast<int>(b)) - kinematics.p_WL(links[b])).norm(), 0.0, 1e-12);
    EXPECT_EQ(npz.numbers("body_quat_w", {12, 30, 4}).size(), 12U * 30U * 4U);
    EXPECT_EQ(npz.numbers("joint_vel", {12, 29}).size(), 12U * 29U);
    EXPECT_LT(distance(read_robot_motion(source_of(files, "x.npz"), robot("g1")).motion, motion), kSame);
  }
}

// Files of others name neither joints nor bodies.
TEST(RobotMotionFormat, BeyondMimicsOrderIsDetectedByItsBodyPositions) {
  const RobotMotion motion = known_motion(robot("g1"));
  for (const TreeOrder order : {TreeOrder::kBreadthFirst, TreeOrder::kDepthFirst}) {
    const Npz named = Npz::parse(
        robot_motion_files(motion, robot("g1"), robot_motion_format("beyondmimic"), {.order = order}).at(""), "x");
    Npz bare;
    for (const char* key : {"fps", "joint_pos", "joint_vel", "body_pos_w", "body_quat_w"})
      bare.set(key, named.array(key));
    const RobotMotionFile read = read_bytes(bare.bytes(), "x.npz");
    EXPECT_LT(distance(read.motion, motion), kSame) << to_string(order);
    EXPECT_THAT(read.evidence, Contains(fmt::format("joints: {} (by the file's body positions)", to_string(order))));
    EXPECT_LT(read.kinematics_error.value(), 1e-9);
    const TreeOrder other = order == TreeOrder::kBreadthFirst ? TreeOrder::kDepthFirst : TreeOrder::kBreadthFirst;
    EXPECT_GT(distance(read_bytes(bare.bytes(), "x.npz", {.joints = other}).motion, motion), 0.1);  // as told
  }
}

TEST(RobotMotionFormat, HolosomaBeginsWithTheRootAndNamesTheWorld) {
  const RobotMotion motion = known_motion(robot("g1"));
  const Npz npz = Npz::parse(file_of(motion, "holosoma"), "x.npz");
  const std::vector<double> q = npz.numbers("joint_pos", {12, 36}), v = npz.numbers("joint_vel", {12, 35});
  const Eigen::Quaterniond& R = motion.root[2].R;
  EXPECT_NEAR(q[2 * 36 + 0], motion.root[2].p.x(), 1e-12);
  EXPECT_NEAR(q[2 * 36 + 3], R.w(), 1e-12);
  EXPECT_NEAR(q[2 * 36 + 6], R.z(), 1e-12);
  EXPECT_NEAR(q[2 * 36 + 7], motion.q(0, 2), 1e-12);
  EXPECT_NEAR(v[2 * 35 + 0], 1.0, 1e-9);  // 0.02 m a frame at 50 Hz
  EXPECT_NEAR(v[2 * 35 + 5], 1.5, 1e-6);  // 0.03 rad a frame about z of W
  EXPECT_EQ(npz.strings("body_names", {-1}).front(), "world");
  EXPECT_EQ(npz.strings("joint_names", {-1}), robot("g1").joint_names());
}

TEST(RobotMotionFormat, SonicsFolderHasItsFilesAndHeaders) {
  const MotionFiles files =
      robot_motion_files(known_motion(robot("g1")), robot("g1"), robot_motion_format("sonic"), {.name = "walk"});
  std::vector<std::string> names;
  for (const auto& [name, content] : files) names.push_back(name);
  EXPECT_THAT(names, testing::ElementsAre("body_ang_vel.csv", "body_lin_vel.csv", "body_pos.csv", "body_quat.csv",
                                          "joint_pos.csv", "joint_vel.csv", "metadata.txt"));
  EXPECT_TRUE(files.at("joint_pos.csv").starts_with("joint_0,joint_1,"));
  EXPECT_TRUE(files.at("joint_vel.csv").starts_with("joint_vel_0,"));
  EXPECT_TRUE(files.at("body_pos.csv").starts_with("body_0_x,body_0_y,body_0_z,body_1_x"));
  EXPECT_TRUE(files.at("body_quat.csv").starts_with("body_0_w,body_0_x,body_0_y,body_0_z,"));
  EXPECT_TRUE(files.at("body_lin_vel.csv").starts_with("body_0_vel_x,"));
  EXPECT_TRUE(files.at("body_ang_vel.csv").starts_with("body_0_angvel_x,"));
  EXPECT_THAT(files.at("metadata.txt"), HasSubstr("Metadata for: walk\n"));
  EXPECT_THAT(files.at("metadata.txt"), HasSubstr("Body part indexes:\n[0 1 2 "));
  EXPECT_THAT(files.at("metadata.txt"), HasSubstr("Total timesteps: 12\n"));
}

TEST(RobotMotionFormat, SonicsRootOnlyFoldersAndBodySubsetsAreRead) {
  const RobotMotion motion = known_motion(robot("g1"));
  const MotionFiles whole = robot_motion_files(motion, robot("g1"), robot_motion_format("sonic"));
  const auto subset = [&](const std::vector<int>& bodies, const std::string& list) {
    MotionFiles files = whole;
    for (const auto& [name, size] : {std::pair<std::string, int>{"body_pos.csv", 3}, {"body_quat.csv", 4}}) {
      const CsvTable table = parse_csv_table(whole.at(name), name);
      std::vector<int> rows;
      for (const int body : bodies)
        for (int i = 0; i < size; ++i) rows.push_back(size * body + i);
      files[name] = csv_text({}, rows_of(table.values, rows));
    }
    files["metadata.txt"] = "Body part indexes:\n" + list + "\n";
    return read_robot_motion(source_of(files, "walk"), robot("g1"));
  };
  EXPECT_LT(distance(subset({0}, "[0]").motion, motion), kSame);
  const RobotMotionFile several = subset({4, 0, 10, 18}, "[ 4 0, 10 18]");
  EXPECT_LT(distance(several.motion, motion), kSame);
  EXPECT_LT(several.kinematics_error.value(), kSame);
}

// Central differences, the ends one-sided; turns between the neighbours.
TEST(RobotMotionFormat, VelocitiesAreTheDocumentedFiniteDifferences) {
  Eigen::MatrixXd x(1, 4);
  x << 0.0, 1.0, 4.0, 9.0;
  Eigen::MatrixXd v(1, 4);
  v << 10.0, 20.0, 40.0, 50.0;
  EXPECT_TRUE(rate_of_change(x, 10.0).isApprox(v, 1e-15));
  std::vector<Eigen::Quaterniond> turning;
  for (const double angle : {0.0, 0.1, 0.3, 0.6}) turning.push_back(yaw_rotation(angle));
  const Eigen::MatrixXd w = angular_velocity(turning, 10.0);
  EXPECT_NEAR(w(2, 0), 1.5, 1e-12);  // as its neighbour
  EXPECT_NEAR(w(2, 1), 1.5, 1e-12);
  EXPECT_NEAR(w(2, 2), 2.5, 1e-12);
  EXPECT_NEAR(w(2, 3), 2.5, 1e-12);
  EXPECT_NEAR(angular_velocity({turning[0], turning[1]}, 10.0)(2, 1), 1.0, 1e-12);
  std::vector<Eigen::Quaterniond> flipped = turning;
  flipped[2].coeffs() *= -1.0;
  EXPECT_TRUE(angular_velocity(flipped, 10.0).isApprox(w, 1e-12));
}

TEST(RobotMotionFormat, PhcKeepsTheRootAndTheJointsAsRotationVectors) {
  const RobotMotion motion = known_motion(robot("g1"));
  const RobotMotionFile read = read_bytes(file_of(motion, "phc"), "x.pkl");
  EXPECT_THAT(read.evidence, Contains(HasSubstr("pose_aa: its root is")));
  EXPECT_THAT(read.evidence, Contains(HasSubstr("root rotation: xyzw (another array of the file says)")));
}

TEST(RobotMotionFormat, PhcIsReadAsJoblibDumpsIt) {
  const RobotMotion motion = known_motion(robot("g1"));
  const int frames = motion.frames(), joints = static_cast<int>(motion.q.rows());
  std::vector<double> trans, rotation, dof(motion.q.data(), motion.q.data() + motion.q.size());
  for (const Pose& pose : motion.root) {
    trans.insert(trans.end(), pose.p.data(), pose.p.data() + 3);
    rotation.insert(rotation.end(), pose.R.coeffs().data(), pose.R.coeffs().data() + 4);
  }
  test::PickleWriter dump;
  dump.raw("}(").text("walk").raw("}(");
  dump.text("root_trans_offset").joblib_doubles({frames, 3}, trans);
  dump.text("root_rot").joblib_doubles({frames, 4}, rotation);
  dump.text("dof").joblib_doubles({frames, joints}, dof);
  dump.text("fps").real(motion.rate_hz).raw("uu.");
  const RobotMotionFile read = read_bytes(dump.str(), "x.pkl");
  EXPECT_EQ(read.format, "phc");
  ASSERT_EQ(read.motion.frames(), frames);
  EXPECT_LT((read.motion.q - motion.q).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((read.motion.root[3].p - motion.root[3].p).norm(), 1e-12);
}

// ---- detection, and what is told

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

// ---- real files, through every writer and back

TEST(RobotMotionFormat, RealMotionsSurviveEveryFormat) {
  for (const char* name : {"twist2/walk_001.pkl", "twist2/walk_003.pkl", "twist2/walk_008.pkl", "gmt/squat.pkl",
                           "gmt/dance_waltz.pkl", "gmt/basic_walk.pkl"}) {
    const std::string path = test::shared_file(std::string("data/g1_motions/") + name);
    if (path.empty()) GTEST_SKIP() << "not run: data/g1_motions/" << name << " absent";
    const RobotMotionFile real = read_robot_motion(path, robot("g1"));
    EXPECT_EQ(real.format, "gmr");
    EXPECT_THAT(real.evidence, Contains(HasSubstr("root rotation: xyzw (as documented)"))) << name;
    EXPECT_LT(real.kinematics_error.value(), 1e-4) << name;
    for (const RobotMotionFormat& format : written_formats()) {
      const RobotMotionWriting writing{.rate_hz = real.motion.rate_hz};
      const MotionFiles files = robot_motion_files(real.motion, robot("g1"), format, writing);
      const RobotMotionFile back = read_robot_motion(source_of(files, "x" + std::string(format.ending)), robot("g1"),
                                                     {.rate_hz = real.motion.rate_hz});
      EXPECT_EQ(back.format, format.name) << name;
      EXPECT_LT(distance(back.motion, real.motion), kSame) << name << " " << format.name;
    }
  }
}

// ---- public test vectors

// What stands in examples/data/robot; DUET_WRITE_EXAMPLES=1 writes it again.
TEST(RobotMotionFormat, TheExamplesAreReadAsTheKnownMotion) {
  constexpr int kFrames = 6;
  constexpr std::uintmax_t kMostBytes = 200'000;
  const std::string folder = std::string(DUET_SOURCE_DIR) + "/examples/data/robot";
  const RobotMotion motion = known_motion(robot("g1"), kFrames);
  if (std::getenv("DUET_WRITE_EXAMPLES") != nullptr) {
    for (const RobotMotionFormat& format : written_formats())
      write_robot_motion(motion, robot("g1"), format, fmt::format("{}/{}{}", folder, format.name, format.ending),
                         {.rate_hz = 50.0, .name = "known_motion"});
    write_file(folder + "/phuma.npy", test::phuma_stand_in(motion, robot("g1")));
    write_file(folder + "/omniretarget.npz", test::omniretarget_stand_in(motion, robot("g1")));
    write_file(folder + "/locomujoco.npz", test::locomujoco_stand_in(motion, robot("g1")));
    write_file(folder + "/spider.npz", test::spider_stand_in(motion, robot("g1")));
  }
  std::uintmax_t bytes = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  EXPECT_LT(bytes, kMostBytes);
  for (const RobotMotionFormat& format : robot_motion_formats()) {
    if (std::string(format.name) == "paired") continue;  // `duet retarget` writes those
    const RobotMotionFile read =
        read_robot_motion(fmt::format("{}/{}{}", folder, format.name, format.ending), robot("g1"),
                          {.rate_hz = 50.0, .motion = std::string(format.name) == "locomujoco" ? "0" : ""});
    EXPECT_EQ(read.format, format.name);
    RobotMotion expected = motion;
    if (read.format == "phuma")
      for (const int wrist : robot("g1").roles.wrists) expected.q.row(wrist).setZero();
    EXPECT_LT(distance(read.motion, expected), kSame) << format.name;
  }
}

// ---- the table itself

TEST(RobotMotionFormat, TheTableOfTheDocumentationIsTheTable) {
  const std::string page = read_file(std::string(DUET_SOURCE_DIR) + "/docs/file-formats.md");
  EXPECT_NE(page.find(robot_motion_table()), std::string::npos) << "the table is now:\n" << robot_motion_table();
}

TEST(RobotMotionFormat, UnknownNamesAreRefusedWithTheNearest) {
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { (void)robot_motion_format("beyond_mimic"); }),
              HasSubstr("unknown robot motion format 'beyond_mimic': did you mean 'beyondmimic'?"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { (void)parse_tree_order("depth"); }), HasSubstr("depth-first"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { (void)parse_quaternion_order("xyz"); }), HasSubstr("xyzw"));
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { (void)parse_angle_unit("grad"); }), HasSubstr("rad"));
}

TEST(RobotMotionFormat, WhatCannotBeWrittenIsRefused) {
  RobotMotion motion = known_motion(robot("g1"));
  const auto refused = [&](const RobotMotion& m, const char* format) {
    return thrown_message<std::invalid_argument>(
        [&] { (void)robot_motion_files(m, robot("g1"), robot_motion_format(format)); });
  };
  EXPECT_THAT(refused(motion, "phuma"), HasSubstr("format 'phuma' is read, not written"));
  EXPECT_THAT(refused(known_motion(robot("t1")), "gmr"), HasSubstr("expected the joints of robot 'g1' in its order"));
  EXPECT_THAT(thrown_message<std::invalid_argument>(
                  [&] { (void)robot_motion_files(motion, robot("g1"), robot_motion_format("gmr"), {.rate_hz = 0.0}); }),
              HasSubstr("format 'gmr': expected a rate of 0.1 to 10000 Hz, found 0"));
  EXPECT_THAT(refused(known_motion(robot("g1"), 1), "gmr"), HasSubstr("expected at least 2 frames at 50 Hz, found 1"));
  motion.q(0, 0) = std::nan("");
  EXPECT_THAT(refused(motion, "gmr"), HasSubstr("is not finite"));
}

}  // namespace
}  // namespace duet
