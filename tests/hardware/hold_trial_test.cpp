// A robot that is held stays on its feet, whatever held it: the twin's body in an engine, no rope.
#include "duet/hardware/episodes/hold_trial.h"

#include <gtest/gtest.h>

#include "duet/backends/engine_module.h"
#include "duet/hardware/twin/lock_step.h"
#include "tests/backends/engine_names.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

void expect_to_stand(const std::string& walker, const ControllerOptions& options, const HoldTrialSetup& setup) {
  const auto make_walker = Walker::load(walker, options, test::g1());
  for (const StopCause cause : causes_of_holds()) {
    const HoldTrial trial = run_hold_trial(cause, setup, make_walker(), 7);
    EXPECT_TRUE(trial.held) << stop_cause_name(cause) << ": " << trial.said;
    EXPECT_FALSE(trial.fell || trial.damped) << stop_cause_name(cause) << ": " << trial.said;
    EXPECT_TRUE(trial.ran_again) << stop_cause_name(cause);
    EXPECT_LT(trial.tilt, 0.4) << stop_cause_name(cause);
  }
}

TEST(HoldTrial, HomieThatWalkedStandsThroughEveryHold) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  const std::string network = test::shared_file("models/homie_deploy.onnx");
  if (network.empty()) GTEST_SKIP() << "not run: homie_deploy.onnx absent";
  expect_to_stand("homie", {{"network", network}}, {.seconds = 8.0});
}

TEST(HoldTrial, WbcSimStandsThroughEveryHold) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  expect_to_stand("wbc_sim", {}, {.forward = 0.0, .seconds = 8.0});
}

// What the trials would see if a hold still damped.
TEST(HoldTrial, ARobotThatIsDampedFalls) {
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  TwinInProcess twin(test::twin_guard(), {.engine = "mujoco"},
                     std::make_unique<Walker>("wbc_sim", ControllerOptions{}, test::g1()), nullptr);
  PlannerMessage plan;
  plan.command.q = test::g1()->neutral;
  plan.command.root.height = HardwareLimits{}.height;
  GuardReport report;
  const auto go_on = [&](double seconds) {
    for (const double end = twin.twin().time() + seconds; twin.twin().time() < end;) {
      ++plan.sequence;
      plan.command.stamp = twin.twin().time();
      twin.send(plan);
      twin.next(report);
    }
  };
  go_on(10.0);
  ASSERT_EQ(report.state, SafetyState::kRun);
  EXPECT_FALSE(has_fallen(twin.twin().physics()->state(), test::g1()->fall));
  twin.stop();
  go_on(3.0);
  EXPECT_TRUE(has_fallen(twin.twin().physics()->state(), test::g1()->fall));
}

}  // namespace
}  // namespace duet
