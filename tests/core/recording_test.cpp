#include "duet/core/recording.h"

#include <functional>
#include <limits>
#include <numeric>

#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

RobotMotion valid_motion() {
  return {.rate_hz = 50.0,
          .joint_names = {"left_knee", "right_knee"},
          .root = std::vector<Pose>(3),
          .q = Eigen::MatrixXd::Zero(2, 3)};
}

std::string message_after(const std::function<void(RobotMotion&)>& change) {
  RobotMotion motion = valid_motion();
  change(motion);
  return test::thrown_message<std::invalid_argument>([&] { validate(motion, "walk.npz"); });
}

TEST(RobotMotion, ValidOnesPass) {
  EXPECT_NO_THROW(validate(valid_motion(), "m"));
  EXPECT_NO_THROW(validate({}, "m"));
  RobotMotion motion = valid_motion();
  motion.root[1].R.coeffs() *= 1.0 + 5e-7;  // inside the tolerance
  EXPECT_NO_THROW(validate(motion, "m"));
}

TEST(RobotMotion, ReferenceIsAFrame) {
  RobotMotion motion = valid_motion();
  motion.q.col(1) << 0.1, 0.2;
  motion.root[1].p.x() = 3.0;
  EXPECT_EQ(motion.reference(1).q, Eigen::Vector2d(0.1, 0.2));
  EXPECT_EQ(motion.reference(1).X_WB.p.x(), 3.0);
}

TEST(RobotMotion, RefusesEachKindOfFault) {
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.rate_hz = 0.0; }));
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.rate_hz = kNan; }));
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.root.pop_back(); }));
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.joint_names.pop_back(); }));
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.root[1].p.z() = kNan; }));
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.root[2].R.coeffs() *= 2.0; }));
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.root[2].R.x() = kNan; }));
  EXPECT_SENTENCE(message_after([](RobotMotion& m) { m.q(1, 2) = std::numeric_limits<double>::infinity(); }));
}

RobotMotion ramp(int frames, double rate_hz) {
  RobotMotion motion;
  motion.rate_hz = rate_hz;
  motion.joint_names = {"knee"};
  motion.q.resize(1, frames);
  for (int t = 0; t < frames; ++t) {
    const double time = t / rate_hz;
    motion.root.push_back(
        {Eigen::Quaterniond(Eigen::AngleAxisd(time, Eigen::Vector3d::UnitZ())), {2.0 * time, 0.0, 0.7}});
    motion.q(0, t) = 3.0 * time;
  }
  return motion;
}

TEST(RobotMotion, ResamplingAConstantVelocityIsExact) {
  for (const double rate : {30.0, 29.97, 50.0, 120.0}) {
    const RobotMotion result = resample(ramp(61, rate), 50.0);
    EXPECT_EQ(result.rate_hz, 50.0);
    EXPECT_NEAR((result.frames() - 1) / 50.0, 60.0 / rate, 0.02) << rate;
    for (int t = 0; t < result.frames(); ++t) {
      EXPECT_NEAR(result.q(0, t), 3.0 * t / 50.0, 1e-9) << rate << " Hz, frame " << t;
      EXPECT_NEAR(result.root[static_cast<std::size_t>(t)].p.x(), 2.0 * t / 50.0, 1e-9);
      EXPECT_NEAR(yaw_of(result.root[static_cast<std::size_t>(t)].R), t / 50.0, 1e-9);
    }
  }
}

TEST(RobotMotion, ResamplingToItsOwnRateChangesNothing) {
  const RobotMotion motion = ramp(20, 50.0);
  const RobotMotion result = resample(motion, 50.0);
  EXPECT_EQ(result.q, motion.q);
  EXPECT_EQ(result.frames(), motion.frames());
}

TEST(RobotMotion, ResamplingRefusesNonsense) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { resample(ramp(3, 50.0), 0.0); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { resample(RobotMotion(), 50.0); }));
}

PointTracks counted(int frames, int points) {
  std::vector<double> data(static_cast<std::size_t>(frames * points * 3));
  std::iota(data.begin(), data.end(), 0.0);
  return {frames, points, data};
}

TEST(PointTracks, LieAsNumPyWouldLayThem) {
  const PointTracks tracks = counted(4, 5);
  for (int t = 0; t < 4; ++t)
    for (int k = 0; k < 5; ++k) {
      const Eigen::Vector3d expected = Eigen::Vector3d(0, 1, 2).array() + 3.0 * (5 * t + k);
      EXPECT_EQ(tracks.at(t, k), expected);
      EXPECT_EQ(tracks.frame(t).col(k), expected);
    }
}

TEST(PointTracks, FramesAreWrittenInPlace) {
  PointTracks tracks(2, 3);
  EXPECT_EQ(tracks.frame(1).norm(), 0.0);
  tracks.frame(1).col(2) << 1, 2, 3;
  EXPECT_EQ(tracks.at(1, 2), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(tracks.data()[17], 3.0);
}

TEST(PointTracks, EmptyIsASize) {
  EXPECT_TRUE(PointTracks().empty());
  EXPECT_TRUE(PointTracks(0, 24).empty());
  EXPECT_EQ(PointTracks(0, 24).points(), 24);
  EXPECT_EQ(PointTracks(3, 0).frames(), 3);
}

TEST(PointTracks, SelectKeepsTheOrderGiven) {
  const PointTracks tracks = counted(3, 4);
  const PointTracks chosen = tracks.select({3, 0, 3});
  ASSERT_EQ(chosen.points(), 3);
  for (int t = 0; t < 3; ++t) {
    EXPECT_EQ(chosen.at(t, 0), tracks.at(t, 3));
    EXPECT_EQ(chosen.at(t, 1), tracks.at(t, 0));
    EXPECT_EQ(chosen.at(t, 2), tracks.at(t, 3));
  }
  EXPECT_EQ(tracks.select({}).points(), 0);
}

TEST(PointTracks, SlicesJoinToTheWhole) {
  const PointTracks tracks = counted(5, 2);
  EXPECT_EQ(tracks.slice(0, 5), tracks);
  std::vector<double> joined = tracks.slice(0, 2).data();
  const std::vector<double> rest = tracks.slice(2, 5).data();
  joined.insert(joined.end(), rest.begin(), rest.end());
  EXPECT_EQ(joined, tracks.data());
  EXPECT_EQ(tracks.slice(3, 3).frames(), 0);
}

TEST(PointTracks, RefuseWhatDoesNotFit) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { PointTracks(-1, 2); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { PointTracks(1, 2, std::vector<double>(5)); }));
  const PointTracks tracks = counted(3, 4);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)tracks.select({1, 4}); }));
  EXPECT_THROW((void)tracks.select({-1}), std::invalid_argument);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { (void)tracks.slice(1, 4); }));
  EXPECT_THROW((void)tracks.slice(-1, 2), std::invalid_argument);
  EXPECT_THROW((void)tracks.slice(2, 1), std::invalid_argument);
}

}  // namespace
}  // namespace duet
