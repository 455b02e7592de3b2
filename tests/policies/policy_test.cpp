#include "duet/policies/policy.h"

#include "duet/policies/catalogue/registry.h"
#include "duet/policies/scheduler.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::kAlgebra;
using test::swinging_motion;
using test::thrown_message;

bool same(const Reference& a, const Reference& b) {
  return a.q == b.q && a.X_WB.p == b.X_WB.p && a.X_WB.R.coeffs() == b.X_WB.R.coeffs();
}

ObservationFrame random_frame(Random& random) {
  ObservationFrame frame;
  for (double& value : frame.partner.reshaped()) value = random.normal();
  const Reference reference = test::random_reference(random, 29);
  frame.robot = {reference.X_WB, Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(4, 5, 6), reference.q, 2.0 * reference.q};
  return frame;
}

TEST(ToVector, HasTheLayoutOfTheSupplement) {
  Random random(1, 1);
  const ObservationFrame frame = random_frame(random);
  const RobotState& robot = frame.robot;
  const Eigen::Vector3d start(0.1, 0.2, 0.3);
  const Eigen::VectorXd vector = to_vector(frame, start);
  ASSERT_EQ(vector.size(), kObservationSize);
  EXPECT_EQ(vector.segment<3>(0), frame.partner.col(0));
  for (int j = 0; j < 24; ++j) EXPECT_EQ(vector.segment<3>(3 + 3 * j), frame.partner.col(j));
  EXPECT_NEAR((robot.X_WB.R * vector.segment<3>(75) - robot.v_WB).norm(), 0.0, kAlgebra);
  EXPECT_EQ(vector.segment<3>(78), robot.w_WB_B);
  EXPECT_NEAR((robot.X_WB.R * vector.segment<3>(81) + Eigen::Vector3d::UnitZ()).norm(), 0.0, kAlgebra);
  EXPECT_EQ(vector.segment<29>(84), robot.q);
  EXPECT_EQ(vector.segment<29>(113), robot.v);
  EXPECT_EQ(vector.segment<3>(142), robot.X_WB.p - start);
  EXPECT_NEAR(std::abs(vector.segment<4>(145).dot(
                  Eigen::Vector4d(robot.X_WB.R.w(), robot.X_WB.R.x(), robot.X_WB.R.y(), robot.X_WB.R.z()))),
              1.0, kAlgebra);
  EXPECT_GE(vector[145], 0.0);
}

TEST(ToVector, IsTheSameForBothSignsOfAQuaternion) {
  Random random(2, 1);
  for (int i = 0; i < 10; ++i) {
    ObservationFrame frame = random_frame(random);
    const Eigen::VectorXd vector = to_vector(frame, {0, 0, 0});
    frame.robot.X_WB.R.coeffs() *= -1.0;
    EXPECT_NEAR((to_vector(frame, {0, 0, 0}) - vector).norm(), 0.0, kAlgebra);
  }
}

TEST(MakePolicy, KnowsItsNamesAndRefusesOthers) {
  EXPECT_EQ(policy_names(), (std::vector<std::string>{"replay", "replay_dense", "null", "dstar", "dp", "retrieval",
                                                      "omni", "canned", "servo", "raised", "walker", "forward",
                                                      "patient", "mirror", "waiting", "vendor"}));
  for (const std::string name : {"replay", "replay_dense", "null"}) EXPECT_EQ(make_policy(name, g1())->name(), name);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_policy("nul", g1()); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_policy("null", nullptr); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_policy("replay", nullptr); }));
}

TEST(NullPolicy, StandsWhereItStarts) {
  Random random(3, 1);
  const auto policy = make_policy("null", g1());
  EpisodeContext context;
  context.start.X_WB = {test::random_upright(random, 0.4), {1.0, -2.0, 0.6}};
  policy->reset(context);
  for (const int tick : {0, 10, 1000})
    for (const Reference& anchor : policy->act({.history = {}, .tick = tick})) {
      EXPECT_EQ(anchor.q, g1()->neutral);
      EXPECT_EQ(anchor.X_WB.p, Eigen::Vector3d(1.0, -2.0, g1()->standing_height));
      EXPECT_NEAR(anchor.X_WB.R.angularDistance(yaw_rotation(yaw_of(context.start.X_WB.R))), 0.0, 1e-7);
    }
}

TEST(ReplayPolicy, ReturnsTheMotionAheadAndStopsAtItsEnd) {
  const RobotMotion motion = swinging_motion(200, 1);
  const auto policy = make_policy("replay", g1());
  EpisodeContext context;
  context.hindsight = &motion;
  policy->reset(context);
  for (const int tick : {0, 10, 99, 150, 199, 500}) {
    const Anchors anchors = policy->act({.history = {}, .tick = tick});
    for (int i = 0; i < kAnchors; ++i)
      EXPECT_TRUE(same(anchors[static_cast<std::size_t>(i)], motion.reference(std::min(tick + 25 * i, 199))));
  }
}

TEST(ReplayPolicy, RefusesWhatItCannotReplay) {
  const auto policy = make_policy("replay", g1());
  const auto message = [&](const RobotMotion* motion) {
    EpisodeContext context;
    context.hindsight = motion;
    return thrown_message<std::invalid_argument>([&] { policy->reset(context); });
  };
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { policy->act({}); }));
  EXPECT_SENTENCE(message(nullptr));
  RobotMotion motion = swinging_motion(10, 1);
  motion.rate_hz = 30.0;
  EXPECT_SENTENCE(message(&motion));
  motion = swinging_motion(10, 1);
  std::swap(motion.joint_names[0], motion.joint_names[1]);
  EXPECT_EQ(message(&motion),
            "policy 'replay': expected the 29 joints of robot '" + g1()->name + "' in its order, found 29 others");
  motion = swinging_motion(10, 1);
  motion.q(3, 4) = std::nan("");
  EXPECT_EQ(message(&motion),
            "policy 'replay': angle of joint '" + motion.joint_names[3] + "' in frame 4 is not finite");
  motion = {.rate_hz = 50.0, .joint_names = g1()->joint_names(), .root = {}, .q = Eigen::MatrixXd(29, 0)};
  EXPECT_SENTENCE(message(&motion));
}

// Anchors and fusion keep what is linear in time: that is what the chain can reproduce exactly.
TEST(ReplayThroughTheScheduler, KeepsALinearMotion) {
  RobotMotion motion = swinging_motion(300, 1);
  const Eigen::VectorXd speed = Eigen::VectorXd::LinSpaced(29, -0.3, 0.3);
  for (int t = 0; t < 300; ++t) {
    motion.q.col(t) = t / 50.0 * speed;
    motion.root[static_cast<std::size_t>(t)] = {yaw_rotation(0.2 * t / 50.0), {0.5 * t / 50.0, 0.0, 0.8}};
  }
  const auto policy = make_policy("replay", g1());
  EpisodeContext context;
  context.hindsight = &motion;
  policy->reset(context);
  Scheduler scheduler;
  scheduler.reset(motion.reference(0));
  for (int tick = 0; tick < 190; ++tick) {
    if (tick % kTicksPerPlan == 0) scheduler.push(policy->act({.history = {}, .tick = tick}), tick);
    const Reference& reference = scheduler.at(tick);
    if (tick < kTicksPerPlan) continue;  // the start fades out
    EXPECT_NEAR((reference.q - motion.q.col(tick)).norm(), 0.0, kAlgebra);
    EXPECT_NEAR((reference.X_WB.p - motion.root[static_cast<std::size_t>(tick)].p).norm(), 0.0, kAlgebra);
    EXPECT_NEAR(yaw_of(reference.X_WB.R), 0.2 * tick / 50.0, kAlgebra);
  }
  EXPECT_EQ(scheduler.late_ticks(), 0);
}

// Amplitude that is left of a swing of joint 0 at `rate_hz` after policy and scheduler.
double swing_left(const std::string& name, double rate_hz) {
  constexpr int kTicks = 1000;
  RobotMotion motion{50.0, g1()->joint_names(), std::vector<Pose>(kTicks), Eigen::MatrixXd::Zero(29, kTicks)};
  const auto angle = [rate_hz](int t) { return 2.0 * std::numbers::pi * rate_hz * t / 50.0; };
  for (int t = 0; t < kTicks; ++t) motion.q(0, t) = std::sin(angle(t));
  const auto policy = make_policy(name, g1());
  EpisodeContext context;
  context.hindsight = &motion;
  policy->reset(context);
  Scheduler scheduler;
  scheduler.reset(motion.reference(0));
  double sine = 0.0, cosine = 0.0;
  for (int tick = 0; tick < 900; ++tick) {
    if (tick % kTicksPerPlan == 0) scheduler.push(policy->plan({.history = {}, .tick = tick}), tick);
    const double value = scheduler.at(tick).q[0];
    if (tick < 100) continue;  // 800 ticks: whole periods of the rates asked for
    sine += value * std::sin(angle(tick)) / 400.0;
    cosine += value * std::cos(angle(tick)) / 400.0;
  }
  return std::hypot(sine, cosine);
}

// The price of five anchors half a second apart, as docs/deviations.md states it.
TEST(ReplayThroughTheScheduler, LosesTheSwingsThatAnchorsCannotHold) {
  EXPECT_NEAR(swing_left("replay", 0.25), 0.94, 0.01);
  EXPECT_NEAR(swing_left("replay", 0.5), 0.75, 0.01);
  EXPECT_NEAR(swing_left("replay", 1.0), 0.23, 0.01);
}

TEST(DenseReplay, LosesNothing) {
  for (const double rate_hz : {0.5, 1.0, 3.0}) EXPECT_NEAR(swing_left("replay_dense", rate_hz), 1.0, kAlgebra);
}

// Two plans that begin at one tick end at one tick, whether made of anchors or of ticks.
TEST(DenseReplay, PlansAsFarAheadAsFiveAnchorsReach) {
  const RobotMotion motion = swinging_motion(300, 1);
  const auto sparse = make_policy("replay", g1()), dense = make_policy("replay_dense", g1());
  EpisodeContext context;
  context.hindsight = &motion;
  sparse->reset(context);
  dense->reset(context);
  for (const int tick : {0, 40}) {
    const std::vector<Reference> plan = dense->plan({.history = {}, .tick = tick});
    EXPECT_EQ(plan.size(), sparse->plan({.history = {}, .tick = tick}).size());
    EXPECT_TRUE(same(plan.front(), motion.reference(tick)));
    EXPECT_TRUE(same(plan.back(), motion.reference(tick + static_cast<int>(plan.size()) - 1)));
  }
}

TEST(Observation, IsFiniteWhereEveryNumberOfItIs) {
  const auto finite = [](const auto& spoil) {
    std::vector<ObservationFrame> frames(3);
    for (ObservationFrame& frame : frames) {
      frame.partner.setZero();
      frame.robot = g1()->standing_state(Pose{});
    }
    spoil(frames.back());
    return is_finite(Observation{.history = frames, .tick = 0});
  };
  const double nan = std::nan("");
  EXPECT_TRUE(finite([](ObservationFrame&) {}));
  EXPECT_FALSE(finite([&](ObservationFrame& frame) { frame.partner(2, 23) = nan; }));
  EXPECT_FALSE(finite([&](ObservationFrame& frame) { frame.robot.X_WB.p.z() = nan; }));
  EXPECT_FALSE(finite([&](ObservationFrame& frame) { frame.robot.X_WB.R.x() = nan; }));
  EXPECT_FALSE(finite([&](ObservationFrame& frame) { frame.robot.v_WB.x() = nan; }));
  EXPECT_FALSE(finite([&](ObservationFrame& frame) { frame.robot.w_WB_B.y() = nan; }));
  EXPECT_FALSE(finite([&](ObservationFrame& frame) { frame.robot.q[0] = nan; }));
  EXPECT_FALSE(finite([&](ObservationFrame& frame) { frame.robot.v[28] = nan; }));
}

ObservationFrame numbered(double number) {
  ObservationFrame frame;
  frame.partner.setConstant(number);
  frame.robot.q = frame.robot.v = Eigen::VectorXd::Constant(29, number);
  return frame;
}

TEST(ObservationHistory, RepeatsTheFirstFrameUntilThereAreEnough) {
  ObservationHistory history;
  for (int tick = 0; tick < 30; ++tick) {
    history.add(numbered(tick));
    const Observation observation = history.at(tick);
    ASSERT_EQ(observation.history.size(), 12u);
    EXPECT_EQ(observation.tick, tick);
    EXPECT_EQ(observation.now().robot.q[0], tick);
    for (int i = 0; i < 12; ++i)
      EXPECT_EQ(observation.history[static_cast<std::size_t>(i)].partner(0, 0), std::max(0, tick - 11 + i));
  }
}

TEST(ObservationHistory, ForgetsOnReset) {
  ObservationHistory history;
  history.add(numbered(1));
  history.reset();
  history.add(numbered(2));
  EXPECT_EQ(history.at(0).history.front().partner(0, 0), 2.0);
}

TEST(ObservationHistory, RefusesToBeAskedBeforeTheFirstFrame) {
  const ObservationHistory history;
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)history.at(0); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { to_matrix({}, {}); }));
}

TEST(ObservationHistory, BecomesOneColumnPerFrame) {
  ObservationHistory history;
  for (int tick = 0; tick < 20; ++tick) history.add(numbered(tick));
  const Eigen::Vector3d start(1, 2, 3);
  const Eigen::MatrixXd matrix = to_matrix(history.at(19), start);
  ASSERT_EQ(matrix.rows(), kObservationSize);
  ASSERT_EQ(matrix.cols(), kHistoryFrames);
  for (int i = 0; i < kHistoryFrames; ++i) EXPECT_EQ(matrix.col(i), to_vector(numbered(8 + i), start));
}

}  // namespace
}  // namespace duet
