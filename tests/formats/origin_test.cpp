// Motions in files have the origin of the robot's URDF, whatever its card calls the pelvis.
#include <gtest/gtest.h>

#include "duet/formats/robot_motion_format.h"
#include "duet/robots/robot_model.h"
#include "tests/robots/moved_t1.h"

namespace duet {
namespace {

using test::MovedT1;

TEST(Origin, MotionsInFilesAreOfTheUrdfsOrigin) {
  const MovedT1 moved({0.1, 0.0, 0.7});
  const RobotModel robot = load_robot(moved.card);
  RobotMotion motion{.rate_hz = 50.0, .joint_names = robot.joint_names(), .root = {}, .q = {}};
  motion.q = robot.neutral.replicate(1, 4);
  for (int t = 0; t < 4; ++t)
    motion.root.push_back(
        {Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * t, Eigen::Vector3d::UnitZ())), {0.1 * t, 0, 0.6}});
  write_robot_motion(motion, robot, robot_motion_format("gmr"), moved.folder / "m.pkl");
  const RobotMotion read = read_robot_motion(moved.folder / "m.pkl", robot, {}, "gmr").motion;
  const RobotMotion raw =
      read_robot_motion(moved.folder / "m.pkl", with_origin_at(robot, urdf_origin(robot)), {}, "gmr").motion;
  for (int t = 0; t < 4; ++t) {
    EXPECT_LT((read.root[t].p - motion.root[t].p).norm(), 1e-6);
    EXPECT_LT((raw.root[t].p - motion.root[t] * urdf_origin(robot)).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace duet
