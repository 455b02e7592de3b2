#include "duet/motion/paired_motion.h"

#include <cmath>

#include "duet/core/require.h"
#include "tests/motion/npz_edit.h"
#include "tests/motion/people.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::edited;
using test::thrown_message;
using test::with_number;
using test::without_key;

constexpr int kFrames = 6;

PairedMotion example() {
  PairedMotion motion;
  motion.clip_id = "pair_7";
  motion.task = Task::kBend;
  motion.phases = {.act_begin = 2, .act_end = 4};
  motion.reactor = Person::kA;
  motion.robot.joint_names = {"left_hip_pitch_joint", "waist_yaw_joint", "right_wrist_yaw_joint"};
  motion.robot.q = Eigen::MatrixXd(3, kFrames);
  for (int t = 0; t < kFrames; ++t) {
    motion.robot.root.push_back({.R = yaw_rotation(0.1 * t), .p = {0.1 * t, -0.2, 0.79}});
    motion.robot.q.col(t) = Eigen::Vector3d(0.01 * t, -0.3, 1.0 / (t + 3.0));
  }
  motion.partner = test::moving_person(kFrames, 50.0, {1, 0, 0}, {1, 0, 0}, 3.0);
  motion.source_partner = test::moving_person(kFrames, 50.0, {1, 0.1, 0}, {1, 0, 0}, 3.0);
  motion.source_reactor = test::moving_person(kFrames, 50.0, {0, 0, 0}, {0.5, 0, 0});
  motion.source_reactor.rotations.clear();
  motion.reshaped = PointTracks(kFrames, 16);
  for (std::size_t i = 0; i < motion.reshaped.data().size(); ++i) motion.reshaped.data()[i] = std::sin(0.1 * i);
  motion.loss = {{"total", {3.0, 2.5, 2.25}}, {"kin", {1.0, 0.5, 0.25}}, {"pose", {}}};
  motion.settings = {{"mode", "paper"}, {"iterations", "200"}};
  return motion;
}

void expect_same(const HumanMotion& a, const HumanMotion& b) {
  EXPECT_EQ(a.rate_hz, b.rate_hz);
  EXPECT_EQ(a.joints, b.joints);
  ASSERT_EQ(a.rotations.size(), b.rotations.size());
  for (std::size_t i = 0; i < a.rotations.size(); ++i) EXPECT_EQ(a.rotations[i].coeffs(), b.rotations[i].coeffs());
}

TEST(PairedMotion, FileGivesBackEveryBit) {
  const test::ScratchFolder folder;
  const PairedMotion motion = example();
  save_paired_motion(motion, folder / "out/pair.npz");
  const PairedMotion read = load_paired_motion(folder / "out/pair.npz");
  EXPECT_EQ(read.clip_id, motion.clip_id);
  EXPECT_EQ(read.task, motion.task);
  EXPECT_EQ(read.phases, motion.phases);
  EXPECT_EQ(read.reactor, motion.reactor);
  EXPECT_EQ(read.robot.rate_hz, 50.0);
  EXPECT_EQ(read.robot.joint_names, motion.robot.joint_names);
  EXPECT_EQ(read.robot.q, motion.robot.q);
  for (int t = 0; t < kFrames; ++t) {
    EXPECT_EQ(read.robot.root[t].p, motion.robot.root[t].p);
    EXPECT_EQ(read.robot.root[t].R.coeffs(), motion.robot.root[t].R.coeffs());
  }
  expect_same(read.partner, motion.partner);
  expect_same(read.source_partner, motion.source_partner);
  expect_same(read.source_reactor, motion.source_reactor);
  EXPECT_EQ(read.reshaped, motion.reshaped);
  EXPECT_EQ(read.loss, motion.loss);
  EXPECT_EQ(read.settings, motion.settings);
}

// The arrays that a Python user sees: (T, joints) of angles and w first in the quaternions.
TEST(PairedMotion, ArraysHaveTheDocumentedShapes) {
  const PairedMotion motion = example();
  const Npz npz = Npz::parse(paired_motion_bytes(motion), "x");
  const std::vector<double> q = npz.numbers("robot_q", {kFrames, 3});
  EXPECT_EQ(q[3 * 4 + 2], motion.robot.q(2, 4));
  const std::vector<double> quat_wxyz = npz.numbers("robot_root_quat_wxyz", {kFrames, 4});
  EXPECT_EQ(quat_wxyz[4 * 5], std::cos(0.25));
  EXPECT_EQ(npz.numbers("partner_rotations_wxyz", {kFrames, 24, 4}).size(), kFrames * 24 * 4u);
  EXPECT_EQ(npz.numbers("loss_total", {3}), (std::vector<double>{3.0, 2.5, 2.25}));
}

TEST(PairedMotion, SavingRefusesPartsThatDisagree) {
  PairedMotion motion = example();
  motion.partner = slice(motion.partner, 0, 5);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)paired_motion_bytes(motion); }));
  motion = example();
  motion.source_reactor.rate_hz = 30.0;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)paired_motion_bytes(motion); }));
  motion = example();
  motion.reshaped = PointTracks(5, 16);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)paired_motion_bytes(motion); }));
  motion = example();
  motion.phases.act_end = 7;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)paired_motion_bytes(motion); }));
}

TEST(PairedMotion, ReadingNamesFileKeyAndFault) {
  const std::string good = paired_motion_bytes(example());
  const auto expect_refused = [](const std::string& bytes) {
    EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)parse_paired_motion(bytes, "bad.npz"); }));
  };
  expect_refused(edited(good, [](Npz& npz) { npz.set_text("schema", "duet.interaction_clip"); }));
  expect_refused(edited(good, [](Npz& npz) { npz.set_text("robot_jont_names", "x"); }));
  expect_refused(edited(good, [](Npz& npz) { npz.set("robot_joint_names", std::vector<std::string>{"a", "b"}); }));
  expect_refused(with_number(good, "robot_root_quat_wxyz", 0, 0.5));
  expect_refused(with_number(good, "robot_q", 2, std::nan("")));
  expect_refused(edited(good, [](Npz& npz) { npz.set("reshaped", PointTracks(5, 16)); }));
  expect_refused(without_key(good, "settings_names"));
  for (const std::string key : {"clip_id", "robot_joint_names", "robot_root_position", "robot_root_quat_wxyz",
                                "robot_q", "partner_joints", "source_partner_joints", "source_reactor_joints"})
    expect_refused(without_key(good, key));
}

TEST(PairedMotion, TruncatedFilesAreRefused) {
  const std::string good = paired_motion_bytes(example());
  for (std::size_t size = 0; size < good.size(); size += 1 + size / 8)
    EXPECT_THROW((void)parse_paired_motion(good.substr(0, size), "cut.npz"), InputError) << size;
}

}  // namespace
}  // namespace duet
