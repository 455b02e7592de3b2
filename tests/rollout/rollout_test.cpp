#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/execution/runner.h"
#include "duet/experiment/suite/profile.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/rollout/act_episode.h"
#include "duet/scoring/scoring.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

struct Parts {
  std::shared_ptr<const RobotModel> robot = test::g1();
  PairedMotion clip = test::paired(Task::kWave, *robot);
  std::shared_ptr<const Experiment> experiment;
  EpisodeSpec spec;

  explicit Parts(Suite suite = test::playback_suite())
      : experiment(test::experiment_of(std::move(suite), {clip})), spec(test::first_of(*experiment)) {}
  [[nodiscard]] RolloutSetup setup() const { return experiment->setup(spec); }
};

Rollout roll(const Parts& parts, const RolloutSetup& setup, const std::string& policy = "replay") {
  const auto maker = make_policy(policy, parts.robot);
  return play_back(setup, *maker);
}

TEST(Rollout, PlaybackOfReplayFollowsTheRetargetedMotion) {
  const Parts parts;
  const RolloutSetup setup = parts.setup();
  const Rollout rollout = roll(parts, setup);
  ASSERT_EQ(rollout.recording.frames(), parts.clip.frames());
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk);
  // Anchors 0.5 s apart are densified linearly: within the second difference of the motion over half an anchor's
  // spacing.
  double worst = 0.0;
  for (int t = 50; t < rollout.recording.frames(); ++t)
    worst = std::max(worst, (rollout.recording.reference[t].X_WB.p - parts.clip.robot.root[t].p).norm());
  EXPECT_LT(worst, 0.12);
  // Playback is one tick behind the reference it follows, exactly.
  for (int t = 1; t < rollout.recording.frames(); t += 17)
    EXPECT_EQ(rollout.recording.robot[t].q, rollout.recording.reference[t - 1].q) << t;
}

TEST(Rollout, ASuiteMayHandPlansOverAtOnce) {
  const Parts parts;
  const Rollout slowly = roll(parts, parts.setup());
  Suite suite = test::playback_suite();
  suite.fuse_ticks = 1;
  const Parts others(suite);
  const Rollout at_once = roll(others, others.setup());
  const int wave = parts.clip.phases.act_begin + 4;  // within the fuse of a plan
  EXPECT_NE(slowly.recording.reference[wave].q, at_once.recording.reference[wave].q);
}

TEST(Rollout, SameEpisodeGivesTheSameHash) {
  const Parts parts;
  const RolloutSetup setup = parts.setup();
  EXPECT_EQ(roll(parts, setup).state_hash, roll(parts, setup).state_hash);
  EXPECT_NE(roll(parts, setup).state_hash, roll(parts, setup, "null").state_hash);
}

TEST(Rollout, PartnerIsTheClipsOwnAtEveryTick) {
  const Parts parts;
  const RolloutSetup setup = parts.setup();
  const Rollout rollout = roll(parts, setup);
  for (int t = 0; t < rollout.recording.frames(); t += 31)
    EXPECT_EQ(rollout.recording.partner.at(t, kHead), parts.clip.partner.joints.at(t, kHead)) << t;
}

TEST(Rollout, PartnerVelocityLeadsToTheNextFrame) {
  const Parts parts;
  const PointTracks& joints = parts.clip.partner.joints;
  const HumanJoints next = partner_joints(joints, 10) + partner_velocities(joints, 10, 50.0) / 50.0;
  EXPECT_LT((next - partner_joints(joints, 11)).norm(), 1e-12);
  EXPECT_EQ(partner_velocities(joints, joints.frames() - 1, 50.0).norm(), 0.0);
  EXPECT_EQ(partner_joints(joints, joints.frames() + 5), partner_joints(joints, joints.frames() - 1));
}

TEST(Rollout, WallLimitEndsAsTimedOut) {
  const Parts parts;
  RolloutSetup setup = parts.setup();
  setup.wall_limit = 1e-9;
  const Rollout rollout = roll(parts, setup);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kTimedOut);
  EXPECT_EQ(rollout.recording.frames(), 1);
  EXPECT_NE(rollout.recording.message.find("wall-clock limit"), std::string::npos);
  EXPECT_FALSE(rollout.interrupted);
}

// A clock that a test moves on with each look of the episode.
EpisodeClock clock_of(double& wall, double& computed, double wall_step, double computed_step) {
  return {.wall = [&wall, wall_step] { return wall += wall_step; },
          .computed = [&computed, computed_step] { return computed += computed_step; }};
}

TEST(Rollout, AnEpisodeWhoseProcessWasStoppedLosesNothing) {
  const Parts parts;
  RolloutSetup setup = parts.setup();
  const Rollout expected = roll(parts, setup);
  double wall = 0.0, computed = 0.0;
  setup.clock = clock_of(wall, computed, 9.0, 1e-6);  // stopped between any two looks for three times the limit
  setup.wall_limit = 3.0;
  const Rollout stopped = roll(parts, setup);
  EXPECT_GT(wall, 1000.0);
  EXPECT_EQ(stopped.recording.outcome, expected.recording.outcome);
  EXPECT_EQ(stopped.state_hash, expected.state_hash);
}

TEST(Rollout, AnEpisodeThatComputesForLongOrWaitsForMuchLongerTimesOut) {
  const Parts parts;
  RolloutSetup setup = parts.setup();
  setup.wall_limit = 3.0;
  double wall = 0.0, computed = 0.0;
  setup.clock = clock_of(wall, computed, 1e-6, 0.5);
  EXPECT_EQ(roll(parts, setup).recording.outcome, Outcome::kTimedOut);
  wall = computed = 0.0;
  setup.clock = clock_of(wall, computed, 0.9, 1e-6);
  EXPECT_EQ(roll(parts, setup).recording.outcome, Outcome::kTimedOut);
  EXPECT_GT(wall, kWaitingShare * setup.wall_limit);
}

TEST(Rollout, StopRequestMarksTheEpisodeInterrupted) {
  const Parts parts;
  RolloutSetup setup = parts.setup();
  setup.stop_asked = [] { return true; };
  EXPECT_TRUE(roll(parts, setup).interrupted);
}

// Holds the start pose and says that it met faults; keeps what it was shown.
class FaultyController final : public Controller {
 public:
  explicit FaultyController(const RobotModel& robot) : robot_(robot) {}
  [[nodiscard]] std::string_view name() const override { return "faulty"; }
  void reset(const RobotState&) override {}
  void act(const RobotState& state, const Reference&, JointCommand& command) override {
    seen.push_back(state.X_WB.p.x());
    command = robot_.default_command(robot_.neutral);
  }
  [[nodiscard]] ControllerFaults faults() const override { return {3, 2, true}; }
  [[nodiscard]] int acts_per_tick() const override { return acts; }
  std::vector<double> seen;
  int acts = 1;

 private:
  const RobotModel& robot_;
};

TEST(Rollout, FaultsAndTheDelayedStateAreTheControllers) {
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  const Parts parts(suite);
  RolloutSetup setup = parts.setup();
  setup.perturbation.delay_ticks = 2;
  const auto backend = make_backend("mujoco", parts.experiment->scene(parts.spec));
  FaultyController controller(*parts.robot);
  const auto policy = make_policy("replay", parts.robot);
  const Rollout rollout = roll_out(setup, *backend, controller, *policy);
  EXPECT_EQ(rollout.faults.observations, 3);
  EXPECT_EQ(rollout.faults.actions, 2);
  EXPECT_TRUE(rollout.faults.stopped);
  ASSERT_EQ(controller.seen.size(), rollout.recording.robot.size());
  for (size_t t = 2; t < controller.seen.size(); ++t)
    ASSERT_EQ(controller.seen[t], rollout.recording.robot[t - 2].X_WB.p.x()) << t;
  EXPECT_EQ(controller.seen[1], setup.start.X_WB.p.x());
}

TEST(Rollout, AControllerActsAsOftenInATickAsItSaysAndSeesWhatIsBetween) {
  if (!is_available("mujoco")) GTEST_SKIP() << "not run: mujoco absent";
  Suite suite = test::playback_suite();
  suite.engines = {"mujoco"};
  const Parts parts(suite);
  const RolloutSetup setup = parts.setup();
  const auto policy = make_policy("replay", parts.robot);
  const auto roll_with = [&](int acts) {
    const auto backend = make_backend("mujoco", parts.experiment->scene(parts.spec));
    FaultyController controller(*parts.robot);
    controller.acts = acts;
    const Rollout rollout = roll_out(setup, *backend, controller, *policy);
    return std::pair(controller.seen, rollout.recording.robot);
  };
  const auto [seen, recorded] = roll_with(2);
  ASSERT_EQ(seen.size(), 2 * recorded.size());
  int between = 0;
  for (size_t t = 0; t + 1 < recorded.size(); ++t) {
    const double now = recorded[t].X_WB.p.x(), next = recorded[t + 1].X_WB.p.x();
    ASSERT_EQ(seen[2 * t], now) << t;
    between += (seen[2 * t + 1] - now) * (next - seen[2 * t + 1]) > 0.0 ? 1 : 0;
  }
  EXPECT_GT(between, static_cast<int>(recorded.size()) / 2);
  EXPECT_EQ(roll_with(1).first.size(), roll_with(1).second.size());
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { roll_with(3); }));
}

// Gives the replay's plans, but the second one.
class MissingPlan final : public Policy {
 public:
  explicit MissingPlan(std::unique_ptr<Policy> replay) : replay_(std::move(replay)) {}
  [[nodiscard]] std::string_view name() const override { return "missing"; }
  void reset(const EpisodeContext& context) override { replay_->reset(context); }
  Anchors act(const Observation& observation) override { return replay_->act(observation); }
  std::vector<Reference> plan(const Observation& observation) override {
    if (observation.tick == kTicksPerPlan) return {};
    return Policy::plan(observation);
  }
  [[nodiscard]] PolicyFaults faults() const override { return {1, 0, false, "no plan in time"}; }

 private:
  std::unique_ptr<Policy> replay_;
};

TEST(Rollout, APlanThatDoesNotComeIsLateAndAFaultOfThePolicy) {
  const Parts parts;
  const RolloutSetup setup = parts.setup();
  MissingPlan policy(make_policy("replay", parts.robot));
  const Rollout rollout = play_back(setup, policy);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk);
  EXPECT_EQ(rollout.late_plans, kTicksPerPlan);
  EXPECT_EQ(rollout.policy_faults.late, 1);
  EXPECT_EQ(rollout.policy_faults.message, "no plan in time");
  EXPECT_GE(rollout.plan_times.max, rollout.plan_times.p95);
  EXPECT_GE(rollout.plan_times.p95, rollout.plan_times.p50);
  EpisodeRow row;
  score_rollout(rollout, setup, {}, *parts.robot, row);
  EXPECT_EQ(row.policy_faults.late, 1);
  EXPECT_EQ(row.policy_ms.max, rollout.plan_times.max);
}

// Half of a plan's period late, each plan counts for the other half; what it was made of is not moved by it.
TEST(Rollout, APlanArrivesItsSimulatedLatencyLater) {
  const Parts parts;
  RolloutSetup setup = parts.setup();
  const int ticks = roll(parts, setup).recording.frames();
  setup.perturbation = default_perturbation("plan_latency");
  ASSERT_EQ(setup.perturbation.plan_latency_ms, 100.0);
  const Rollout late = roll(parts, setup);
  const std::vector<Reference>& reference = late.recording.reference;
  for (int t = 0; t < 5; ++t) EXPECT_EQ(reference[t].q, setup.start.q) << t;
  EXPECT_NE(reference[6].q, setup.start.q);
  EXPECT_EQ(reference[14].q, reference[9].q);  // the plan of tick 0 is old at tick 10, that of tick 10 comes at 15
  EXPECT_NE(reference[16].q, reference[14].q);
  int expected = 0;
  for (int t = 0; t < ticks; ++t) expected += t % kTicksPerPlan < 5 ? 1 : 0;
  EXPECT_EQ(late.late_plans, expected);
  setup.perturbation.plan_latency_ms = 9.0;  // to the nearest tick: none
  EXPECT_EQ(roll(parts, setup).late_plans, 0);
}

// Dead from its second plan on.
class DyingPolicy final : public Policy {
 public:
  explicit DyingPolicy(std::unique_ptr<Policy> replay) : replay_(std::move(replay)) {}
  [[nodiscard]] std::string_view name() const override { return "dying"; }
  void reset(const EpisodeContext& context) override { replay_->reset(context); }
  Anchors act(const Observation& observation) override {
    dead_ = observation.tick > 0;
    return replay_->act(observation);
  }
  [[nodiscard]] PolicyFaults faults() const override { return {0, 0, dead_, dead_ ? "its process ended" : ""}; }

 private:
  std::unique_ptr<Policy> replay_;
  bool dead_ = false;
};

TEST(Rollout, ADeadPolicyEndsTheEpisodeAsAnErrorNotAsAFailureToAct) {
  const Parts parts;
  const RolloutSetup setup = parts.setup();
  DyingPolicy policy(make_policy("replay", parts.robot));
  const Rollout rollout = play_back(setup, policy);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kError);
  EXPECT_SENTENCE(rollout.recording.message);
  EXPECT_EQ(rollout.recording.frames(), kTicksPerPlan);
  const PolicyMaker maker = [&] { return std::make_unique<DyingPolicy>(make_policy("replay", parts.robot)); };
  const EpisodeRow row = parts.experiment->run(parts.spec, {.policy = maker});
  EXPECT_EQ(row.outcome, Outcome::kError);
  EXPECT_SENTENCE(row.message);
  EXPECT_TRUE(row.policy_faults.dead);
  EXPECT_EQ(row.success, false);
  EXPECT_TRUE(row.verdicts.empty());
  EXPECT_EQ(row.state_hash, "");
}

// Waits longer for each plan than the whole episode may take.
class SlowPolicy final : public Policy {
 public:
  explicit SlowPolicy(std::unique_ptr<Policy> replay) : replay_(std::move(replay)) {}
  [[nodiscard]] std::string_view name() const override { return "slow"; }
  void reset(const EpisodeContext& context) override { replay_->reset(context); }
  Anchors act(const Observation& observation) override {
    if (observation.tick == 0) std::this_thread::sleep_for(std::chrono::duration<double>(2.5));
    return replay_->act(observation);
  }

 private:
  std::unique_ptr<Policy> replay_;
};

TEST(Rollout, WaitingForPlansIsNotHeldAgainstTheWallLimit) {
  const Parts parts;
  RolloutSetup setup = parts.setup();
  const Rollout expected = roll(parts, setup);
  setup.wall_limit = 2.0;  // playback takes some milliseconds
  SlowPolicy policy(make_policy("replay", parts.robot));
  const Rollout rollout = play_back(setup, policy);
  EXPECT_EQ(rollout.recording.outcome, Outcome::kOk);
  EXPECT_EQ(rollout.state_hash, expected.state_hash);
}

// The onset of a wave is the hand's, in the act; the policy's view of the partner changes nothing that is recorded.
TEST(Rollout, ADisturbedViewIsThePolicysAlone) {
  const Parts parts;
  RolloutSetup setup = parts.setup();
  const Rollout clean = roll(parts, setup);
  setup.perturbation = default_perturbation("jitter");
  setup.perturbation.perception.vanish = 1.0;
  const Rollout disturbed = roll(parts, setup);
  EXPECT_EQ(disturbed.recording.partner, clean.recording.partner);
  EXPECT_EQ(disturbed.state_hash, clean.state_hash);
}

// A robot that stands presses on the ground with its weight, over a tick never by less than that for long, and never by
// many times of it.
TEST(Rollout, TheGroundCarriesTheRobotAndThePeakIsOfOneTick) {
  const Parts parts;
  for (const EngineInfo& engine : engines()) {
    if (!engine.available) continue;
    RolloutSetup setup = parts.setup();
    int ticks = 0;
    setup.stop_asked = [&ticks] { return ++ticks > 50; };
    Scene scene;
    scene.robot = parts.robot;
    scene.human = make_human_body(bone_lengths(parts.clip.partner));
    const auto backend = make_backend(engine.name, scene);
    const auto controller = make_controller("pd", parts.robot);
    const auto policy = make_policy("null", parts.robot);
    const GroundForce ground = roll_out(setup, *backend, *controller, *policy).ground;
    const double weight = 9.81 * parts.robot->total_mass();
    EXPECT_GT(ground.mean, 0.5 * weight) << engine.name;
    EXPECT_LT(ground.mean, 1.5 * weight) << engine.name;
    EXPECT_GT(ground.peak, ground.mean) << engine.name;
    EXPECT_LT(ground.peak, 20.0 * weight) << engine.name;
  }
}

}  // namespace
}  // namespace duet
