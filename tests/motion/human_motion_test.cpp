#include "duet/motion/human_motion.h"

#include <functional>
#include <limits>
#include <numbers>

#include "tests/motion/people.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::moving_person;
using test::reference_posture;
using test::thrown_message;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kAlgebra = 64 * kEpsilon;  // a few operations on numbers of the size of 1

TEST(HumanMotion, BoneLengthsAreThoseOfTheFigureHoweverItMoves) {
  const HumanMotion motion = moving_person(30, 50.0, {3.0, -2.0, 0.0}, {1.0, 0.5, 0.0}, 0.4, 2.0);
  const std::array<double, kSmplJoints> lengths = bone_lengths(motion);
  EXPECT_EQ(lengths[0], 0.0);
  for (int j = 1; j < kSmplJoints; ++j)
    EXPECT_NEAR(lengths[j], (reference_posture().col(j) - reference_posture().col(kSmplParents[j])).norm(), kAlgebra);
}

TEST(HumanMotion, HeadingIsTheYawOfTheFigure) {
  for (const double yaw : {0.0, 1e-9, 1.0, std::numbers::pi / 2, 3.0, -3.0, -1e-3}) {
    const HumanMotion motion = moving_person(1, 50.0, {1.0, 2.0, 0.0}, Eigen::Vector3d::Zero(), yaw);
    EXPECT_NEAR(heading(motion.joints, 0), yaw, kAlgebra) << yaw;
  }
}

TEST(HumanMotion, HeadingOfAPersonOnTheSideIsRefused) {
  HumanMotion motion = moving_person(2, 50.0, Eigen::Vector3d::Zero());
  const Eigen::Quaterniond on_the_side(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitX()));
  for (int j = 0; j < kSmplJoints; ++j) motion.joints.at(1, j) = on_the_side * Eigen::Vector3d(motion.joints.at(1, j));
  const std::string message = thrown_message<std::invalid_argument>([&] { (void)heading(motion.joints, 1); });
  EXPECT_SENTENCE(message);
}

TEST(HumanMotion, ResamplingToTheSameRateChangesNoBit) {
  const HumanMotion motion = moving_person(17, 29.97, {0.3, 0.1, 0.0}, {1.0, 2.0, 0.0}, 0.3, 1.0);
  const HumanMotion same = resample(motion, 29.97);
  EXPECT_EQ(same.joints, motion.joints);
  ASSERT_EQ(same.rotations.size(), motion.rotations.size());
  for (std::size_t i = 0; i < same.rotations.size(); ++i)
    EXPECT_EQ(same.rotations[i].coeffs(), motion.rotations[i].coeffs());
}

TEST(HumanMotion, ResamplingIsExactWhereInstantsCoincide) {
  // 120 -> 50 Hz: output frame 5 k is source frame 12 k.
  const HumanMotion motion = moving_person(121, 120.0, {0.3, 0.1, 0.0}, {1.0, 2.0, 0.0}, 0.3, 4.0);
  const HumanMotion result = resample(motion, 50.0);
  ASSERT_EQ(result.frames(), 51);
  for (int k = 0; k <= 10; ++k) {
    EXPECT_EQ(result.joints.slice(5 * k, 5 * k + 1), motion.joints.slice(12 * k, 12 * k + 1));
    EXPECT_EQ(result.rotations[5 * k * kSmplJoints].coeffs(), motion.rotations[12 * k * kSmplJoints].coeffs());
  }
}

TEST(HumanMotion, ResamplingKeepsUniformMotionUniform) {
  const Eigen::Vector3d velocity(1.0, -0.5, 0.25);
  const HumanMotion slow = moving_person(31, 30.0, Eigen::Vector3d::Zero(), velocity);
  const HumanMotion fast = resample(slow, 50.0);
  ASSERT_EQ(fast.frames(), 51);
  for (int t = 0; t < fast.frames(); ++t)
    EXPECT_LT((fast.joints.at(t, kPelvis) - slow.joints.at(0, kPelvis) - t / 50.0 * velocity).norm(), kAlgebra);
}

TEST(HumanMotion, ResamplingKeepsUniformTurningUniform) {
  const HumanMotion slow =
      moving_person(31, 30.0, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 2.0, 5.0);  // past the seam at pi
  const HumanMotion fast = resample(slow, 50.0);
  for (int t = 0; t < fast.frames(); ++t) {
    const Eigen::Quaterniond& R = fast.rotations[t * kSmplJoints + kHead];
    EXPECT_LT(R.angularDistance(yaw_rotation(2.0 + 5.0 * t / 50.0)), 1e-7);  // acos near 1 keeps half the digits
    EXPECT_NEAR(R.norm(), 1.0, kAlgebra);
  }
}

TEST(HumanMotion, ResamplingTakesTheShorterArcBetweenOppositeSigns) {
  HumanMotion motion = moving_person(2, 1.0, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), 0.0, 0.2);
  for (int j = 0; j < kSmplJoints; ++j) motion.rotations[kSmplJoints + j].coeffs() *= -1.0;
  const HumanMotion result = resample(motion, 2.0);
  ASSERT_EQ(result.frames(), 3);
  EXPECT_LT(result.rotations[kSmplJoints].angularDistance(yaw_rotation(0.1)), 1e-7);
}

TEST(HumanMotion, ResampledFramesEndAtTheLastInstantInside) {
  EXPECT_EQ(resampled_frames(303, 120.0, 50.0), 126);  // 2.5167 s
  EXPECT_EQ(resampled_frames(301, 120.0, 50.0), 126);  // 2.5 s exactly
  EXPECT_EQ(resampled_frames(300, 120.0, 50.0), 125);
  EXPECT_EQ(resampled_frames(1, 120.0, 50.0), 1);
  EXPECT_EQ(resampled_frames(2, 1.0, 1000.0), 1001);
  for (int frames = 1; frames < 400; ++frames) EXPECT_EQ(resampled_frames(3 * frames - 2, 150.0, 50.0), frames);
}

TEST(HumanMotion, AnInstantIsAFramesToABillionthOfAPeriod) {
  for (const double off : {-1e-10, 0.0, 1e-10})
    for (const int frame : {0, 1, 3}) {
      const FrameBetween at = frame_between(frame + off, 5);
      EXPECT_EQ(at.frame, frame) << off;
      EXPECT_EQ(at.part, 0.0) << off;
    }
  const FrameBetween between = frame_between(2.25, 5);
  EXPECT_EQ(between.frame, 2);
  EXPECT_EQ(between.part, 0.25);
}

TEST(HumanMotion, ResampleRefusesRatesThatAreNoRates) {
  const HumanMotion motion = moving_person(3, 50.0, Eigen::Vector3d::Zero());
  for (const double rate_hz : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)resample(motion, rate_hz); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)resample(motion, 1e12); }));
}

TEST(HumanMotion, SliceKeepsPositionsAndRotationsTogether) {
  const HumanMotion motion = moving_person(10, 50.0, {0, 0, 0}, {1, 0, 0}, 0.0, 1.0);
  const HumanMotion part = slice(motion, 3, 7);
  EXPECT_EQ(part.frames(), 4);
  EXPECT_EQ(part.joints, motion.joints.slice(3, 7));
  ASSERT_EQ(part.rotations.size(), 4u * kSmplJoints);
  EXPECT_EQ(part.rotations[0].coeffs(), motion.rotations[3 * kSmplJoints].coeffs());
  EXPECT_THROW((void)slice(motion, 7, 3), std::invalid_argument);
  EXPECT_THROW((void)slice(motion, 0, 11), std::invalid_argument);
}

TEST(HumanMotion, ValidationNamesPlaceAndFault) {
  const std::vector<std::function<void(HumanMotion&)>> spoils = {
      [](HumanMotion& m) { m.rate_hz = 0.0; },
      [](HumanMotion& m) { m.joints = PointTracks(4, 22); },
      [](HumanMotion& m) { m = slice(m, 0, 1); },
      [](HumanMotion& m) { m.joints.at(2, kLeftKnee).y() = std::nan(""); },
      [](HumanMotion& m) { m.joints.at(1, kHead).x() = std::numeric_limits<double>::infinity(); },
      [](HumanMotion& m) { m.joints.at(0, kNeck) = m.joints.at(0, kSpine3); },
      [](HumanMotion& m) { m.rotations.pop_back(); },
      [](HumanMotion& m) {
        m.rotations[3 * kSmplJoints + kRightHand] = {1.1, 0.0, 0.0, 0.0};
      },
      [](HumanMotion& m) { m.rotations[0].x() = std::nan(""); }};
  HumanMotion good = moving_person(4, 50.0, Eigen::Vector3d::Zero());
  EXPECT_NO_THROW(validate(good, "person A"));
  for (const auto& spoil : spoils) {
    HumanMotion motion = good;
    spoil(motion);
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { validate(motion, "person A"); }));
  }
}

TEST(HumanMotion, ABoneOfOneMillimetreIsTheShortest) {
  HumanMotion motion = moving_person(2, 50.0, Eigen::Vector3d::Zero());
  for (int t = 0; t < 2; ++t)
    motion.joints.at(t, kLeftHand) = motion.joints.at(t, kLeftWrist) + Eigen::Vector3d(0, 0.00101, 0);
  EXPECT_NO_THROW(validate(motion, "x"));
  motion.joints.at(1, kLeftHand) = motion.joints.at(1, kLeftWrist) + Eigen::Vector3d(0, 0.00099, 0);
  EXPECT_THROW(validate(motion, "x"), std::invalid_argument);
}

}  // namespace
}  // namespace duet
