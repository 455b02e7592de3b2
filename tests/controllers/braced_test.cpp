// The network of WBC-Sim that learnt with pushes, as it ships, beside the one that did not.
#include <gtest/gtest.h>

#include <numbers>

#include "duet/robots/kinematics.h"
#include "tests/backends/engine_names.h"
#include "tests/controllers/walk.h"

namespace duet {
namespace {

using test::walk;
using test::WalkSetup;

WalkSetup wbc_sim(const char* network, double seconds) {
  return {.controller = "wbc_sim", .options = {{"network", network}}, .seconds = seconds};
}

// The number of pushes that it withstands upright, of four of 80 N for a second on the trunk, one in each direction.
int pushes_stood(const char* network) {
  const auto robot = test::body("g1");
  const int torso = robot->frames[robot->track_frame("torso")].link;
  int stood = 0;
  for (int direction = 0; direction < 4; ++direction) {
    WalkSetup setup = wbc_sim(network, 5.0);
    setup.act_on = [&](int tick, Backend& backend) {
      if (tick != 50 && tick != 100) return;
      const double angle = 0.5 * std::numbers::pi * direction, force = tick == 50 ? 80.0 : 0.0;
      Kinematics kinematics(*robot);
      kinematics.update(backend.state().X_WB, backend.state().q);
      backend.push(torso, force * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0), kinematics.p_WL(torso));
    };
    stood += walk(setup).upright ? 1 : 0;
  }
  return stood;
}

TEST(Braced, StepsOutOfPushesThatTheStudentFallsBy) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  EXPECT_GE(pushes_stood("braced"), pushes_stood("student") + 2);
}

TEST(Braced, IsNearerToAReferenceThatWalks) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const auto error = [](const char* network) {
    WalkSetup setup = wbc_sim(network, 7.0);
    setup.reference = [](int tick, const Reference& neutral) {
      Reference reference = neutral;
      reference.X_WB.p.x() += 0.3 * 0.02 * std::clamp(tick - 50, 0, 250);
      return reference;
    };
    const test::Walk result = walk(setup);
    EXPECT_TRUE(result.upright) << network;
    return result.root_rms;
  };
  const double braced = error("braced");
  EXPECT_LT(braced, 0.05);
  EXPECT_LT(braced, 0.6 * error("student"));
}

}  // namespace
}  // namespace duet
