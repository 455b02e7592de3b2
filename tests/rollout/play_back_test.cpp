#include <gtest/gtest.h>

#include <numbers>

#include "duet/rollout/world.h"
#include "tests/backends/small_robots.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Parts {
  std::shared_ptr<const RobotModel> robot = test::g1();
  PairedMotion clip = test::paired(Task::kWave, *robot);
};

Reference reference(double x, double yaw, double q) {
  return {{yaw_rotation(yaw), {x, -x, 1.0}}, Eigen::VectorXd::Constant(1, q)};
}

TEST(KinematicFollower, IsExactlyAtItsReference) {
  KinematicFollower follower(test::state_of(*test::wheel(), {0.0, 0.0, 1.0}));
  const Reference target = reference(0.3, 0.4, -0.7);
  follower.go_to(target, 0.02);
  EXPECT_EQ(follower.state().X_WB.p, target.X_WB.p);
  EXPECT_EQ(follower.state().X_WB.R.coeffs(), target.X_WB.R.coeffs());
  EXPECT_EQ(follower.state().q, target.q);
  EXPECT_EQ(follower.state().v_WB, Eigen::Vector3d::Zero());
}

TEST(KinematicFollower, VelocitiesAreThoseOfTheWay) {
  KinematicFollower follower(test::state_of(*test::wheel(), {0.0, 0.0, 1.0}));
  follower.go_to(reference(0.3, 3.1, -0.7), 0.02);
  follower.go_to(reference(0.31, -3.1, -0.6), 0.02);  // over the seam of yaw: the short way round
  EXPECT_NEAR(follower.state().v_WB.x(), 0.01 / 0.02, 1e-12);
  EXPECT_NEAR(follower.state().v_WB.y(), -0.01 / 0.02, 1e-12);
  EXPECT_NEAR(follower.state().v[0], 0.1 / 0.02, 1e-12);
  EXPECT_NEAR(follower.state().w_WB_B.z(), 2.0 * (std::numbers::pi - 3.1) / 0.02, 1e-9);
}

TEST(Playback, RecordsTheMotionAsItIs) {
  const Parts parts;
  const Recording recording =
      play_back(parts.clip.robot, parts.clip.partner.joints, Task::kWave, parts.clip.phases, parts.robot);
  ASSERT_EQ(recording.frames(), parts.clip.frames());
  for (int t = 0; t < recording.frames(); t += 13) {
    EXPECT_EQ(recording.robot[t].q, parts.clip.robot.q.col(t)) << t;
    EXPECT_EQ(recording.robot[t].X_WB.p, parts.clip.robot.root[t].p) << t;
  }
  EXPECT_NE(test::thrown_message<std::invalid_argument>([&] {
              play_back(parts.clip.robot, parts.clip.partner.joints.slice(0, 5), Task::kWave, {}, parts.robot);
            }).find("5 of the partner"),
            std::string::npos);
}

// The robot stands on the first frame already, so that its first step is the second frame's; a first step has no
// velocity (world.h), later ones have that of the frames.
TEST(Playback, TakesItsFirstStepToTheSecondFrame) {
  const Parts parts;
  const PointTracks nobody;
  const Recording recording = play_back(parts.clip.robot, nobody, Task::kWave, parts.clip.phases, parts.robot);
  ASSERT_EQ(recording.frames(), parts.clip.frames());
  EXPECT_EQ(recording.robot[0].v.norm(), 0.0);
  EXPECT_EQ(recording.robot[1].v.norm(), 0.0);
  for (const int t : {2, 3, 50})
    EXPECT_EQ(recording.robot[t].v,
              (parts.clip.robot.q.col(t) - parts.clip.robot.q.col(t - 1)) / (1.0 / parts.clip.robot.rate_hz))
        << t;
}

}  // namespace
}  // namespace duet
