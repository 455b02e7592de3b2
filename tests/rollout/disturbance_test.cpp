#include <gtest/gtest.h>

#include <cmath>

#include "duet/experiment/suite/suite.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "tests/backends/allocation_count.h"
#include "tests/experiment/fixtures.h"

namespace duet {
namespace {

constexpr int kSteps = 10;  // of 2 ms in a tick

// An engine in which nothing moves, that keeps what it was pushed with.
class Bench final : public Backend {
 public:
  struct Push {
    int link;
    Eigen::Vector3d f_W, p_W;
  };
  explicit Bench(const std::shared_ptr<const RobotModel>& robot) : Backend(scene_of(robot)) {
    reset(robot->standing_state());
  }
  [[nodiscard]] std::string_view name() const override { return "bench"; }
  [[nodiscard]] std::string version() const override { return "1"; }
  std::vector<Push> pushes;
  std::vector<Eigen::Vector3d> kicks;

 private:
  static Scene scene_of(const std::shared_ptr<const RobotModel>& robot) {
    Scene scene;
    scene.robot = robot;
    return scene;
  }
  void do_reset() override {}
  void do_set_partner(const HumanJoints&, const HumanJoints&) override {}
  Outcome do_step(const JointCommand&) override { return Outcome::kOk; }
  void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) override {
    pushes.push_back({link, f_W, p_W});
  }
  void do_kick(const Eigen::Vector3d& dv_W) override { kicks.push_back(dv_W); }
  void do_snapshot(Snapshot&) const override {}
  void do_restore(std::span<const double>) override {}
};

struct Stage {
  std::shared_ptr<const RobotModel> robot = test::g1();
  RobotState start = robot->standing_state();

  [[nodiscard]] Disturbance disturbance(const std::string& yaml, std::uint64_t seed = 1, int acts = 1) const {
    return {test::perturbation(yaml), *robot, start, kSteps / acts, acts, 0.002, seed};
  }
  // The state whose first joint says when it was.
  [[nodiscard]] RobotState at(double time) const {
    RobotState state = start;
    state.q[0] = time;
    return state;
  }
  [[nodiscard]] JointCommand command(double value) const {
    return robot->default_command(Eigen::VectorXd::Constant(robot->dof(), value));
  }
};

TEST(Disturbance, CleanPassesStateAndCommandThrough) {
  const Stage stage;
  Disturbance clean = stage.disturbance("clean");
  const RobotState state = stage.at(1.0);
  EXPECT_EQ(&clean.seen(state), &state);
  clean.send(stage.command(0.5));
  for (int step = 0; step < kSteps; ++step) EXPECT_EQ(clean.in_effect(step).q_target[3], 0.5);
  Bench bench(stage.robot);
  for (int tick = 0; tick < 1000; ++tick) clean.act(tick, bench);
  EXPECT_TRUE(bench.pushes.empty());
}

TEST(Disturbance, DelayShowsTheStateOfTicksAgoAndTheStartBefore) {
  const Stage stage;
  Disturbance late = stage.disturbance("{delay: {ticks: 3}}");
  for (int tick = 0; tick < 20; ++tick) {
    const double expected = tick < 3 ? stage.start.q[0] : 100.0 + tick - 3;
    EXPECT_EQ(late.seen(stage.at(100.0 + tick)).q[0], expected) << tick;
  }
}

// A command of tick k is in effect from step k * kSteps + late on, whatever the latency is to a tick.
TEST(Disturbance, LatencyIsToThePhysicsStep) {
  const Stage stage;
  for (const int late : {1, 4, 10, 13, 20, 37}) {
    Disturbance lagging = stage.disturbance("{latency: {ms: " + std::to_string(2 * late) + "}}");
    for (int tick = 0; tick < 12; ++tick) {
      lagging.send(stage.command(100.0 + tick));
      for (int step = 0; step < kSteps; ++step) {
        const int since = tick * kSteps + step - late;
        const double expected = since < 0 ? stage.start.q[5] : 100.0 + since / kSteps;
        ASSERT_EQ(lagging.in_effect(step).q_target[5], expected) << late << " " << tick << " " << step;
      }
    }
  }
}

// A controller that acts twice a tick: delays are of ticks and latencies of milliseconds all the same.
TEST(Disturbance, DelaysAndLatenciesKnowHowOftenTheControllerActs) {
  const Stage stage;
  Disturbance late = stage.disturbance("{delay: {ticks: 3}}", 1, 2);
  for (int act = 0; act < 40; ++act)
    EXPECT_EQ(late.seen(stage.at(100.0 + act)).q[0], act < 6 ? stage.start.q[0] : 100.0 + act - 6) << act;
  for (const int lag : {1, 4, 5, 13}) {
    Disturbance lagging = stage.disturbance("{latency: {ms: " + std::to_string(2 * lag) + "}}", 1, 2);
    for (int act = 0; act < 12; ++act) {
      lagging.send(stage.command(100.0 + act));
      for (int step = 0; step < kSteps / 2; ++step) {
        const int since = act * kSteps / 2 + step - lag;
        const double expected = since < 0 ? stage.start.q[5] : 100.0 + since / (kSteps / 2);
        ASSERT_EQ(lagging.in_effect(step).q_target[5], expected) << lag << " " << act << " " << step;
      }
    }
  }
}

TEST(Disturbance, NoiseHasItsDeviationAndRepeatsWithItsSeed) {
  const Stage stage;
  const char* yaml = "{noise: {q: 0.01, v: 0.5, w: 0.2, gravity: 0.05}}";
  Disturbance noisy = stage.disturbance(yaml), again = stage.disturbance(yaml), other = stage.disturbance(yaml, 2);
  double q = 0.0, v = 0.0, w = 0.0, tilt = 0.0;
  constexpr int kTicks = 2000;
  for (int tick = 0; tick < kTicks; ++tick) {
    const RobotState& seen = noisy.seen(stage.start);
    q += (seen.q - stage.start.q).squaredNorm() / stage.robot->dof();
    v += seen.v.squaredNorm() / stage.robot->dof();
    w += seen.w_WB_B.squaredNorm() / 3.0;
    tilt += seen.X_WB.R.angularDistance(stage.start.X_WB.R) * seen.X_WB.R.angularDistance(stage.start.X_WB.R) / 2.0;
    EXPECT_EQ(seen.X_WB.p, stage.start.X_WB.p);
    EXPECT_EQ(seen.q, again.seen(stage.start).q);
    EXPECT_NE(seen.q, other.seen(stage.start).q);
  }
  // The deviation of a sample of n has the relative error 1 / sqrt(2 n): 5 % is over three of them for n = 4000.
  EXPECT_NEAR(std::sqrt(q / kTicks), 0.01, 0.0005);
  EXPECT_NEAR(std::sqrt(v / kTicks), 0.5, 0.025);
  EXPECT_NEAR(std::sqrt(w / kTicks), 0.2, 0.01);
  EXPECT_NEAR(std::sqrt(tilt / kTicks), 0.05, 0.0025);
}

TEST(Disturbance, NoiseTurnsTheBaseAboutLevelAxesOfItsOwn) {
  const Stage stage;
  Disturbance noisy = stage.disturbance("{noise: {gravity: 0.05}}");
  const Eigen::Quaterniond turn = stage.start.X_WB.R.conjugate() * noisy.seen(stage.start).X_WB.R;
  EXPECT_NEAR(turn.z(), 0.0, 1e-15);
  EXPECT_GT(turn.vec().norm(), 0.0);
}

TEST(Disturbance, PushesBeginAfterHalfTheirPeriodAndEnd) {
  const Stage stage;
  Bench bench(stage.robot);
  Disturbance pushing = stage.disturbance("{push: {force: 50, duration: 0.5, every: 2}}");
  std::vector<int> ticks;
  for (int tick = 0; tick < 280; ++tick) {
    const size_t before = bench.pushes.size();
    pushing.act(tick, bench);
    if (bench.pushes.size() > before) ticks.push_back(tick);
  }
  EXPECT_EQ(ticks, (std::vector<int>{50, 75, 150, 175, 250, 275}));
  const int link = stage.robot->frames[stage.robot->frame_index("torso_link")].link;
  Kinematics kinematics(*stage.robot);
  kinematics.update(bench.state().X_WB, bench.state().q);
  const Eigen::Vector3d com = kinematics.X_WL(link) * stage.robot->links[link].com;
  for (size_t i = 0; i < bench.pushes.size(); ++i) {
    EXPECT_EQ(bench.pushes[i].link, link);
    EXPECT_NEAR(bench.pushes[i].f_W.norm(), i % 2 == 0 ? 50.0 : 0.0, 1e-12);
    EXPECT_EQ(bench.pushes[i].f_W.z(), 0.0);
    EXPECT_LT((bench.pushes[i].p_W - com).norm(), 1e-12);
  }
  EXPECT_GT((bench.pushes[0].f_W - bench.pushes[2].f_W).norm(), 1.0);  // each push its own direction
}

TEST(Disturbance, KicksComeAtTheirTimeEachInADirectionOfItsOwn) {
  const Stage stage;
  Bench bench(stage.robot);
  Disturbance kicking = stage.disturbance("{kick: {speed: 0.7, first: 1, from: 2, to: 3}}");
  std::vector<int> ticks;
  for (int tick = 0; tick < 2000; ++tick) {
    const size_t before = bench.kicks.size();
    kicking.act(tick, bench);
    if (bench.kicks.size() > before) ticks.push_back(tick);
  }
  ASSERT_GT(ticks.size(), 12U);
  EXPECT_EQ(ticks[0], 50);
  for (size_t i = 1; i < ticks.size(); ++i) {
    EXPECT_GE(ticks[i] - ticks[i - 1], 100);
    EXPECT_LE(ticks[i] - ticks[i - 1], 150);
  }
  for (const Eigen::Vector3d& kick : bench.kicks) {
    EXPECT_NEAR(kick.norm(), 0.7, 1e-12);
    EXPECT_EQ(kick.z(), 0.0);
  }
  EXPECT_GT((bench.kicks[0] - bench.kicks[1]).norm(), 1e-3);
  EXPECT_TRUE(bench.pushes.empty());
}

TEST(Disturbance, NothingAllocatesAfterConstruction) {
  const Stage stage;
  Disturbance all =
      stage.disturbance("{name: all, delay: {ticks: 2}, latency: {ms: 30}, noise: {q: 0.1, gravity: 0.1}, push: {}}");
  Bench bench(stage.robot);
  bench.pushes.reserve(100);
  const RobotState state = stage.start;
  const JointCommand command = stage.command(0.0);
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: allocations are not counted under the sanitizer";
  const long before = test::allocation_count();
  for (int tick = 0; tick < 500; ++tick) {
    all.seen(state);
    all.send(command);
    static_cast<void>(all.in_effect(tick % kSteps));
    all.act(tick, bench);
  }
  EXPECT_EQ(test::allocation_count(), before);
}

}  // namespace
}  // namespace duet
