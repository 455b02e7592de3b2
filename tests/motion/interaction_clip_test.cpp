#include "duet/motion/interaction_clip.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>

#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/motion/paired_motion.h"
#include "duet/motion/synthesis/synthesis.h"
#include "tests/motion/npz_edit.h"
#include "tests/motion/people.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::edited;
using test::thrown_message;
using test::two_people;
using test::with_number;
using test::without_key;

void expect_same(const HumanMotion& a, const HumanMotion& b) {
  EXPECT_EQ(a.rate_hz, b.rate_hz);
  EXPECT_EQ(a.joints, b.joints);
  ASSERT_EQ(a.rotations.size(), b.rotations.size());
  for (std::size_t i = 0; i < a.rotations.size(); ++i) EXPECT_EQ(a.rotations[i].coeffs(), b.rotations[i].coeffs());
}

void expect_same(const InteractionClip& a, const InteractionClip& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.task, b.task);
  expect_same(a.a, b.a);
  expect_same(a.b, b.b);
  EXPECT_EQ(a.phases, b.phases);
  EXPECT_EQ(a.reactor, b.reactor);
  EXPECT_EQ(a.contacts, b.contacts);
  EXPECT_EQ(a.source, b.source);
}

TEST(InteractionClip, FileGivesBackEveryBit) {
  const test::ScratchFolder folder;
  const InteractionClip clip = two_people();
  save_clip(clip, folder / "clip.npz");
  expect_same(load_clip(folder / "clip.npz"), clip);
  EXPECT_EQ(clip_bytes(load_clip(folder / "clip.npz")), read_file(folder / "clip.npz"));
}

TEST(InteractionClip, RotationsContactsAndSourceMayBeAbsent) {
  InteractionClip clip = two_people();
  clip.a.rotations.clear();
  clip.contacts.clear();
  clip.source.clear();
  expect_same(parse_clip(clip_bytes(clip), "x"), clip);
}

TEST(InteractionClip, RolesFollowTheReactor) {
  InteractionClip clip = two_people();
  EXPECT_EQ(&clip.reactor_motion(), &clip.a);
  EXPECT_EQ(&clip.actor_motion(), &clip.b);
  clip.reactor = Person::kB;
  EXPECT_EQ(&clip.reactor_motion(), &clip.b);
  EXPECT_EQ(&clip.actor_motion(), &clip.a);
}

// A file whose columns come in another order: the names decide, for positions, rotations and contacts.
TEST(InteractionClip, JointsAreBoundByName) {
  const InteractionClip clip = two_people();
  const std::string bytes = edited(clip_bytes(clip), [&](Npz& npz) {
    std::vector<int> reversed;
    for (int j = kSmplJoints - 1; j >= 0; --j) reversed.push_back(j);
    std::vector<std::string> names;
    for (const int j : reversed) names.emplace_back(kSmplNames[j]);
    npz.set("human_joint_names", names);
    for (const std::string who : {"a", "b"}) {
      npz.set(who + "_joints", npz.tracks(who + "_joints", kSmplJoints).select(reversed));
      const std::vector<double> stored = npz.numbers(who + "_rotations_wxyz", {-1, kSmplJoints, 4});
      std::vector<double> turned;
      for (std::size_t t = 0; t < 20; ++t)
        for (const int j : reversed)
          turned.insert(turned.end(), &stored[4 * (kSmplJoints * t + j)], &stored[4 * (kSmplJoints * t + j)] + 4);
      npz.set(who + "_rotations_wxyz", turned, {20, kSmplJoints, 4});
    }
    const std::int64_t last = kSmplJoints - 1;
    npz.set("contacts", std::vector<std::int64_t>{6, 8, last - kRightHand, last - kLeftHand}, {1, 4});
  });
  expect_same(parse_clip(bytes, "reversed"), clip);
}

TEST(InteractionClip, MirroringTwiceIsTheClip) {
  const InteractionClip clip = two_people();
  expect_same(mirrored(mirrored(clip)), clip);
}

TEST(InteractionClip, MirroringReflectsTheWorldAndExchangesSides) {
  const InteractionClip clip = two_people();
  const InteractionClip image = mirrored(clip);
  EXPECT_NO_THROW(validate(image));
  const Eigen::Vector3d left = clip.a.joints.at(3, kLeftHand);
  EXPECT_EQ(image.a.joints.at(3, kRightHand), Eigen::Vector3d(left.x(), -left.y(), left.z()));
  EXPECT_EQ(image.contacts[0].joint_a, kLeftHand);
  EXPECT_EQ(image.contacts[0].joint_b, kRightHand);
  EXPECT_NEAR(heading(image.a.joints, 4), -heading(clip.a.joints, 4), 1e-14);
}

// The person of the tests is rigid: every bone is its rotation times the bone of the reference posture, and the
// reference posture is its own mirror image.
TEST(InteractionClip, MirroredRotationsTurnMirroredBones) {
  InteractionClip clip = two_people();
  const Eigen::Quaterniond tilt(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.3, 0.5, -0.8).normalized()));
  for (int t = 0; t < clip.frames(); ++t)
    for (int j = 0; j < kSmplJoints; ++j) {
      clip.a.joints.at(t, j) = tilt * Eigen::Vector3d(clip.a.joints.at(t, j));
      clip.a.rotations[t * kSmplJoints + j] = tilt * clip.a.rotations[t * kSmplJoints + j];
    }
  const InteractionClip image = mirrored(clip);
  for (int t = 0; t < image.frames(); ++t)
    for (int j = 1; j < kSmplJoints; ++j) {
      const int parent = kSmplParents[j];
      const Eigen::Vector3d bone = test::reference_posture().col(j) - test::reference_posture().col(parent);
      EXPECT_LT(
          (image.a.joints.at(t, j) - image.a.joints.at(t, parent) - image.a.rotations[t * kSmplJoints + parent] * bone)
              .norm(),
          1e-14);
    }
}

TEST(InteractionClip, ValidationNamesClipAndFault) {
  const std::vector<std::function<void(InteractionClip&)>> spoils = {
      [](InteractionClip& c) { c.b = slice(c.b, 0, 1); },    [](InteractionClip& c) { c.b = slice(c.b, 0, 19); },
      [](InteractionClip& c) { c.b.rate_hz = 60.0; },        [](InteractionClip& c) { c.phases.act_end = 21; },
      [](InteractionClip& c) { c.phases.act_begin = 13; },   [](InteractionClip& c) { c.phases.act_begin = -1; },
      [](InteractionClip& c) { c.contacts[0].begin = 8; },   [](InteractionClip& c) { c.contacts[0].end = 21; },
      [](InteractionClip& c) { c.contacts[0].joint_b = 24; }};
  for (const auto& spoil : spoils) {
    InteractionClip clip = two_people();
    spoil(clip);
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { validate(clip); }));
    const test::ScratchFolder folder;
    EXPECT_THROW(save_clip(clip, folder / "clip.npz"), std::invalid_argument);
  }
}

TEST(InteractionClip, ReadingNamesFileKeyAndFault) {
  const std::string good = clip_bytes(two_people());
  const auto with_text = [&](const std::string& key, const std::string& value) {
    return edited(good, [&](Npz& npz) { npz.set_text(key, value); });
  };
  const auto with_integers = [&](const std::string& key, std::vector<std::int64_t> values,
                                 std::vector<std::size_t> shape) {
    return edited(good, [&](Npz& npz) { npz.set(key, std::move(values), std::move(shape)); });
  };
  const auto with_joint = [&](int joint, const std::string& name) {
    return edited(good, [&](Npz& npz) {
      std::vector<std::string> names(kSmplNames.begin(), kSmplNames.end());
      names[joint] = name;
      npz.set("human_joint_names", names);
    });
  };
  const auto with_frames = [&](int begin, int end) {
    return edited(good, [&](Npz& npz) { npz.set("b_joints", npz.tracks("b_joints", 24).slice(begin, end)); });
  };
  const std::vector<std::string> files = {
      with_text("schema", "other"),
      with_integers("schema_version", {2}, {}),
      with_text("id", ""),
      with_text("id", "two\nlines"),
      with_text("id", std::string(201, 'x')),
      with_number(good, "rate_hz", 0, 0.1),
      with_text("fase", "x"),
      with_text("phase", "x"),
      with_text("task", "hugg"),
      with_text("reactor", "C"),
      with_number(good, "rate_hz", 0, 0.0),
      with_integers("phases", {-3, 4}, {2}),
      with_integers("phases", {3, 40}, {2}),
      with_integers("contacts", {1, 2, 3, 24}, {1, 4}),
      with_integers("contacts", {4, 2, 3, 3}, {1, 4}),
      with_joint(kLeftKnee, "left_kne"),
      with_joint(kLeftKnee, "head"),
      edited(good,
             [&](Npz& npz) {
               PointTracks joints = npz.tracks("a_joints", 24);
               joints.at(0, kLeftHip) = joints.at(0, kPelvis);
               npz.set("a_joints", joints);
             }),
      with_number(good, "a_rotations_wxyz", 1, 0.9),
      edited(without_key(good, "b_rotations_wxyz"),
             [&](Npz& npz) { npz.set("b_joints", npz.tracks("b_joints", 24).slice(0, 1)); }),
      without_key(with_frames(0, 19), "b_rotations_wxyz"),
      with_frames(0, 19),
      with_number(good, "a_joints", 4, std::nan("")),
      without_key(good, "source_values")};
  for (const std::string& bytes : files)
    EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)parse_clip(bytes, "bad.npz"); }));
}

TEST(InteractionClip, EveryMissingKeyIsNamed) {
  const std::string good = clip_bytes(two_people());
  for (const std::string key :
       {"schema", "schema_version", "id", "task", "reactor", "rate_hz", "human_joint_names", "a_joints", "b_joints"})
    EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)parse_clip(without_key(good, key), "part.npz"); }));
}

// A clip of which either person was replaced is two clips, in one run too.
TEST(InteractionClip, AnotherReactorIsAnotherIdAndBackAgain) {
  InteractionClip clip = two_people();
  clip.reactor = Person::kB;
  clip.id = "pair_7";
  set_reactor(clip, Person::kB);
  EXPECT_EQ(clip.id, "pair_7");
  set_reactor(clip, Person::kA);
  EXPECT_EQ(clip.id, "pair_7-A");
  EXPECT_EQ(clip.reactor, Person::kA);
  set_reactor(clip, Person::kB);
  EXPECT_EQ(clip.id, "pair_7");
}

TEST(InteractionClip, EmptyAndTruncatedFilesAreRefused) {
  const std::string good = clip_bytes(two_people());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)parse_clip("", "empty.npz"); }));
  for (std::size_t size = 0; size < good.size(); size += 1 + size / 8)
    EXPECT_THROW((void)parse_clip(good.substr(0, size), "cut.npz"), InputError) << size;
  const test::ScratchFolder folder;
  EXPECT_SENTENCE(thrown_message<InputError>([&] { (void)load_clip(folder / "absent.npz"); }));
}

TEST(InteractionClip, PaddingHoldsTheFirstAndTheLastFrame) {
  const InteractionClip clip = synthesize(Task::kHandshake, {.seed = 5});
  const InteractionClip longer = padded(clip, 1.0, 0.5);
  EXPECT_NO_THROW(validate(longer));
  ASSERT_EQ(longer.frames(), clip.frames() + 75);
  EXPECT_EQ(longer.a.joints.frame(0), clip.a.joints.frame(0));
  EXPECT_EQ(longer.a.joints.frame(50), clip.a.joints.frame(0));
  EXPECT_EQ(longer.b.joints.frame(57), clip.b.joints.frame(7));
  EXPECT_EQ(longer.b.joints.frame(longer.frames() - 1), clip.b.joints.frame(clip.frames() - 1));
  EXPECT_EQ(longer.a.rotations.size(), static_cast<std::size_t>(longer.frames()) * kSmplJoints);
  EXPECT_EQ(longer.phases.act_begin, clip.phases.act_begin + 50);
  EXPECT_EQ(longer.phases.act_end, clip.phases.act_end + 50);
  ASSERT_FALSE(clip.contacts.empty());
  EXPECT_EQ(longer.contacts[0].begin, clip.contacts[0].begin + 50);
  EXPECT_THROW(padded(clip, -1.0, 0.0), std::invalid_argument);
  EXPECT_THROW(padded(clip, 0.0, std::nan("")), std::invalid_argument);
}

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
