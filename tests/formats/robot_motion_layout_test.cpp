// The documented layout of each format of robot motions.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <numbers>

#include "duet/formats/motion_support.h"
#include "duet/formats/robot_motion_format.h"
#include "tests/archives/pickle_bytes.h"
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
using test::source_of;
using ::testing::Contains;
using ::testing::HasSubstr;

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
  EXPECT_THAT(read.evidence, Contains(HasSubstr("root rotation: xyzw (the file says)")));
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

}  // namespace
}  // namespace duet
