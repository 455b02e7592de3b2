#include "duet/formats/robot_motion_format.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/recording.h"
#include "duet/core/require.h"
#include "tests/formats/known_motion.h"
#include "tests/formats/motion_files.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::distance;
using test::known_motion;
using test::kSame;
using test::read_bytes;
using test::robot;
using test::source_of;
using test::thrown_message;
using test::written_formats;
using ::testing::Contains;
using ::testing::HasSubstr;

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
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read_bytes(bytes, "x.npz"); }));
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)read_bytes(bytes, "x.npz", {.motion = "2"}); }));
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

// The files in examples/data/robot; DUET_WRITE_EXAMPLES=1 writes them again.
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

TEST(RobotMotionFormat, TheLayoutIsSaidAsDocumented) {
  EXPECT_EQ(documented_layout(robot_motion_format("gmr")), "xyzw, depth-first, rad, m; rate inside");
  EXPECT_EQ(documented_layout(robot_motion_format("phc")), "xyzw, depth-first, rad, m; rate inside, else 30 Hz");
  EXPECT_EQ(documented_layout(robot_motion_format("bones")), "turns xyz, depth-first, deg, 0.01 m; 120 Hz");
}

TEST(RobotMotionFormat, UnknownNamesAreRefusedWithTheNearest) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)robot_motion_format("beyond_mimic"); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)parse_tree_order("depth"); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)parse_quaternion_order("xyz"); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { (void)parse_angle_unit("grad"); }));
}

TEST(RobotMotionFormat, WhatCannotBeWrittenIsRefused) {
  RobotMotion motion = known_motion(robot("g1"));
  const auto refused = [&](const RobotMotion& m, const char* format) {
    return thrown_message<std::invalid_argument>(
        [&] { (void)robot_motion_files(m, robot("g1"), robot_motion_format(format)); });
  };
  EXPECT_SENTENCE(refused(motion, "phuma"));
  EXPECT_SENTENCE(refused(known_motion(robot("t1")), "gmr"));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [&] { (void)robot_motion_files(motion, robot("g1"), robot_motion_format("gmr"), {.rate_hz = 0.0}); }));
  EXPECT_SENTENCE(refused(known_motion(robot("g1"), 1), "gmr"));
  motion.q(0, 0) = std::nan("");
  EXPECT_SENTENCE(refused(motion, "gmr"));
}

}  // namespace
}  // namespace duet
