#include "duet/metrics/motion_windows.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/motion/synthesis/synthesis.h"
#include "tests/support.h"

namespace duet {
namespace {

InteractionClip wave() { return synthesize(Task::kWave, {.rate_hz = 30.0, .like = Likeness::kVaried, .still = true}); }

double feature(const std::vector<double>& window, const std::string& name) {
  const std::vector<std::string>& names = window_feature_names();
  return window.at(std::ranges::find(names, name) - names.begin());
}

TEST(MotionWindows, HaveARowAWindowAndPersonAndAColumnAName) {
  const InteractionClip clip = wave();
  const std::vector<std::vector<double>> windows = motion_windows(clip);
  const double seconds = clip.frames() / clip.rate_hz();
  EXPECT_NEAR(static_cast<double>(windows.size()), 2.0 * (seconds - kWindowSeconds) / kWindowStep, 4.0);
  for (const std::vector<double>& window : windows) EXPECT_EQ(window.size(), window_feature_names().size());
}

// The frame is the person's own: where in the world the two stand and how they are turned says nothing.
TEST(MotionWindows, AreTheSameWhereverTheTwoStand) {
  const InteractionClip clip = wave();
  InteractionClip moved = clip;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.1, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  for (HumanMotion* person : {&moved.a, &moved.b})
    for (int t = 0; t < person->frames(); ++t)
      for (int j = 0; j < kSmplJoints; ++j)
        person->joints.at(t, j) = turn * person->joints.at(t, j) + Eigen::Vector3d(3.0, -2.0, 0.0);
  const std::vector<std::vector<double>> one = motion_windows(clip), other = motion_windows(moved);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i)
    for (std::size_t k = 0; k < one[i].size(); ++k) EXPECT_NEAR(one[i][k], other[i][k], 1e-9);
}

TEST(MotionWindows, SayWhereTheOtherIs) {
  const InteractionClip clip = wave();
  const int at = 4 * 2;  // the fifth frame at 15 Hz, the middle of the first window
  const double apart = (clip.a.joints.at(at, kPelvis) - clip.b.joints.at(at, kPelvis)).head<2>().norm();
  EXPECT_NEAR(feature(motion_windows(clip).front(), "distance of the other"), apart, 0.05);
  EXPECT_LT(std::abs(feature(motion_windows(clip).front(), "direction of the other")), std::numbers::pi / 2);
}

// One frame, shown for the whole clip, as beside recordings of one person.
TEST(MotionWindows, APictureOfAPersonHasNone) {
  InteractionClip clip = wave();
  const std::size_t both = motion_windows(clip).size();
  for (int t = 1; t < clip.frames(); ++t) clip.b.joints.frame(t) = clip.b.joints.frame(0);
  EXPECT_EQ(motion_windows(clip).size(), both / 2);
}

}  // namespace
}  // namespace duet
