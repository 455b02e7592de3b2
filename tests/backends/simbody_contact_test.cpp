// Contacts around Simbody: friction per pair, the sign and the sum of forces, the skin of the human, self-collision.
#include <cmath>
#include <numbers>

#include "backends/factory.h"
#include "robots/dynamics.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kMass = 10.0;  // of the sledge

// A human of one capsule, the left hand: joint 20 to joint 22.
HumanBody hand() {
  HumanBody human;
  HumanCapsule capsule;
  capsule.name = "left_hand";
  capsule.region = "hand";
  capsule.joint_a = 20;
  capsule.joint_b = 22;
  capsule.radius = 0.05;
  human.capsules = {capsule};
  return human;
}

// The hand across the way of the sledge's front spheres, `gap` before them.
HumanJoints hand_before_sledge(const RobotState& state, double gap) {
  HumanJoints joints = HumanJoints::Zero();
  const Eigen::Vector3d middle = state.X_WB.p + Eigen::Vector3d(0.2 + 0.02 + 0.05 + gap, 0.0, -0.08);
  joints.col(20) = middle + Eigen::Vector3d(0.0, 0.4, 0.0);
  joints.col(22) = middle - Eigen::Vector3d(0.0, 0.4, 0.0);
  return joints;
}

Eigen::Vector3d force_of(const Backend& backend, ContactSide side) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Contact& contact : backend.contacts())
    if (contact.side == side) sum += contact.f_W;
  return sum;
}

struct SimbodyContact : ::testing::Test {
  void SetUp() override {
    for (const EngineInfo& engine : engines())
      if (engine.name == "simbody" && !engine.available)
        GTEST_SKIP() << "not run: engine simbody absent: " << engine.reason;
    scene.robot = test::sledge();
    scene.human = hand();
    scene.partner = PartnerMode::kNone;
    rest = test::state_of(*scene.robot, {0.0, 0.0, 0.1});
  }
  void start(const RobotState& state) {
    backend = make_backend("simbody", scene);
    backend->reset(state);
  }
  void run(double seconds) {
    const int steps = static_cast<int>(std::lround(seconds / scene.dt));
    for (int i = 0; i < steps; ++i) ASSERT_EQ(backend->step(test::no_torque(*scene.robot)), Outcome::kOk);
  }
  Scene scene;
  RobotState rest;
  std::unique_ptr<Backend> backend;
};

TEST_F(SimbodyContact, RestingForceIsTheWeightAndPointsUp) {
  start(rest);
  run(1.0);
  ASSERT_EQ(backend->contacts().size(), 4U);
  EXPECT_NEAR(force_of(*backend, ContactSide::kGround).z(), kMass * kGravity, 1e-3 * kMass * kGravity);
  for (const Contact& contact : backend->contacts()) {
    EXPECT_EQ(contact.link, 0);
    EXPECT_EQ(contact.other, -1);
    EXPECT_GT(contact.f_W.z(), 0.0);
    EXPECT_NEAR(contact.p_WC.z(), 0.0, 1e-3);
    EXPECT_GE(contact.depth, 0.0);
    EXPECT_LT(contact.depth, 2e-3);
  }
}

TEST_F(SimbodyContact, SlidingSlowsDownByFrictionTimesGravity) {
  for (const double mu : {0.1, 0.3, 0.8}) {
    for (const double angle : {0.0, 0.7, 1.5708}) {
      scene.friction = {.robot_ground = mu, .robot_human = 0.9, .robot_robot = 0.7};
      start(rest);
      run(0.5);
      RobotState moving = backend->state();
      const Eigen::Vector3d along(std::cos(angle), std::sin(angle), 0.0);
      moving.v_WB = 0.8 * mu * along;
      backend->reset(moving);
      run(0.05);
      EXPECT_NEAR(backend->state().v_WB.dot(along), 0.8 * mu - mu * kGravity * 0.05, 0.01 * mu) << mu << " " << angle;
      const Eigen::Vector3d force = force_of(*backend, ContactSide::kGround);
      EXPECT_NEAR(-force.dot(along), mu * force.z(), 1e-2 * mu * force.z()) << mu;
      run(0.2);
      EXPECT_LT(backend->state().v_WB.norm(), 1e-4) << mu;
    }
  }
}

// On an incline of slope tan: friction mu holds below it and not above.
TEST_F(SimbodyContact, InclineSlipsAtTheAngleOfFrictionAlongXAndYAndBetween) {
  scene.friction.robot_ground = 0.5;
  for (const double dt : {0.0005, 0.002, 0.004}) {
    scene.dt = dt;
    for (const double angle : {0.0, 0.785398, 1.570796}) {
      for (const double slope : {0.98 * 0.5, 1.02 * 0.5}) {
        const Eigen::Vector3d down(std::cos(angle), std::sin(angle), 0.0);
        scene.gravity = kGravity / std::hypot(1.0, slope) * (slope * down - Eigen::Vector3d::UnitZ());
        start(rest);
        run(0.5);
        const double before = backend->state().X_WB.p.dot(down);
        run(0.5);
        const double speed = backend->state().v_WB.dot(down), moved = backend->state().X_WB.p.dot(down) - before;
        if (slope < 0.5)
          EXPECT_LT(std::abs(moved), 0.5 * 1e-4) << angle << " " << dt;  // far less than 1 mm/s
        else
          EXPECT_GT(speed, 0.5 * 0.01 * 0.5 * kGravity) << angle << " " << dt;
      }
    }
  }
}

TEST_F(SimbodyContact, PushBelowFrictionHoldsAndAboveItMoves) {
  scene.friction.robot_ground = 0.5;
  for (const double share : {0.9, 1.1}) {
    start(rest);
    run(0.5);
    const double x = backend->state().X_WB.p.x();
    backend->push(0, {share * 0.5 * kMass * kGravity, 0.0, 0.0}, {x, 0.0, 0.01});
    run(1.0);
    const double moved = backend->state().X_WB.p.x() - x;
    if (share < 1.0)
      EXPECT_LT(std::abs(moved), 1e-4);
    else
      EXPECT_NEAR(moved, 0.5 * 0.1 * 0.5 * kGravity, 0.05);
  }
}

TEST_F(SimbodyContact, PushActsAtItsPointOfTheLinkAndEndsWithZero) {
  RobotState flying = rest;
  flying.X_WB.p.z() = 100.0;
  start(flying);
  backend->push(0, {0.0, 0.0, 6.0}, flying.X_WB.p + Eigen::Vector3d(0.0, 0.1, 0.0));
  run(0.01);
  // Torque 0.6 N m about x over I_xx = 0.4; the arm turns away by less than 1e-5.
  EXPECT_NEAR(backend->state().w_WB_B.x(), 0.6 / 0.4 * 0.01, 1e-6);
  EXPECT_NEAR(backend->state().v_WB.z(), (6.0 / kMass - kGravity) * 0.01, 1e-9);
  backend->push(0, Eigen::Vector3d::Zero(), flying.X_WB.p);
  const Eigen::Vector3d spin = backend->state().w_WB_B;
  run(0.01);
  EXPECT_EQ(backend->state().w_WB_B.x(), spin.x());
}

TEST_F(SimbodyContact, GhostTouchesNothing) {
  scene.partner = PartnerMode::kGhost;
  start(rest);
  backend->set_partner(hand_before_sledge(rest, -0.02), HumanJoints::Zero());
  run(0.1);
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman), Eigen::Vector3d::Zero());
  EXPECT_NEAR(backend->state().X_WB.p.x(), 0.0, 1e-6);
}

TEST_F(SimbodyContact, SkinIsTheSpringOfTheSceneAtRest) {
  scene.partner = PartnerMode::kSolid;
  scene.friction.robot_ground = 10.0;  // holds the sledge
  start(rest);
  run(0.5);
  const double depth = 0.001;
  backend->set_partner(hand_before_sledge(backend->state(), -depth), HumanJoints::Zero());
  run(1.0);
  Eigen::Vector3d force = Eigen::Vector3d::Zero();
  for (const Contact& contact : backend->contacts()) {
    if (contact.side != ContactSide::kHuman) continue;
    EXPECT_EQ(contact.other, 0);
    EXPECT_EQ(contact.link, 0);
    EXPECT_NEAR(contact.f_W.norm(), scene.human.capsules[contact.other].skin.stiffness * contact.depth,
                0.01 * contact.f_W.norm());
    force += contact.f_W;
  }
  EXPECT_LT(force.x(), -10.0);                                                               // away from the hand
  EXPECT_NEAR(force_of(*backend, ContactSide::kGround).x(), -force.x(), 0.03 * -force.x());  // balance of momentum
}

// The hand runs into the free sledge at 0.5 m/s: two springs K and dampers D side by side on 10 kg.
TEST_F(SimbodyContact, SkinIsTheDampedSpringOfTheSceneInMotionWhateverTheStep) {
  scene.partner = PartnerMode::kSolid;
  RobotState flying = rest;
  flying.X_WB.p.z() = 100.0;
  for (const double dt : {0.0005, 0.001, 0.002}) {
    scene.dt = dt;
    start(flying);
    HumanJoints velocities = HumanJoints::Zero();
    velocities.row(0).setConstant(-0.5);
    backend->set_partner(hand_before_sledge(flying, 0.0), velocities);
    const Skin skin = scene.human.capsules[0].skin;
    double impulse = 0.0, peak = 0.0, expected_peak = 0.0, x = 0.0, v = 0.5;  // depth and its rate, fine steps
    for (int i = 0; i < static_cast<int>(std::lround(0.03 / dt)); ++i) {
      backend->step(test::no_torque(*scene.robot));
      const double force = -force_of(*backend, ContactSide::kHuman).x();
      EXPECT_GE(force, 0.0);  // never pulls
      impulse += force * dt;
      peak = std::max(peak, force);
    }
    for (double t = 0.0; t < 0.03; t += 1e-6) {
      const double force = std::max(0.0, 2.0 * (skin.stiffness * x + skin.damping * v));
      v -= 1e-6 * force * (1.0 / kMass + 0.08 * 0.08 / 0.5);  // the centre of mass is 0.08 m above
      x += 1e-6 * v;
      expected_peak = std::max(expected_peak, force);
    }
    EXPECT_NEAR(impulse, -kMass * backend->state().v_WB.x(), 1e-6 * kMass);
    EXPECT_NEAR(peak, expected_peak, 0.15 * expected_peak) << dt;  // it is first seen after up to a step
  }
}

TEST_F(SimbodyContact, PartnerMovesOnBetweenCallsAndGoesWithReset) {
  scene.partner = PartnerMode::kSolid;
  start(rest);
  HumanJoints velocities = HumanJoints::Zero();
  velocities.row(0).setConstant(-0.1);
  const HumanJoints joints = hand_before_sledge(rest, 0.01);
  backend->set_partner(joints, velocities);
  run(0.09);
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman).norm(), 0.0);
  run(0.05);
  EXPECT_GT(force_of(*backend, ContactSide::kHuman).norm(), 0.0);
  backend->reset(rest);
  run(0.2);
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman).norm(), 0.0);
}

TEST_F(SimbodyContact, FrictionWithTheHumanIsThatOfThePairNotOfTheGround) {
  // The hand, pressed on from below the free sledge, is dragged along y: friction force over normal force.
  for (const double mu : {0.2, 0.6}) {
    scene.partner = PartnerMode::kSolid;
    scene.friction = {.robot_ground = 0.05, .robot_human = mu, .robot_robot = 0.9};
    start(rest);
    run(0.5);
    HumanJoints velocities = HumanJoints::Zero();
    velocities.row(1).setConstant(1.0);
    backend->set_partner(hand_before_sledge(backend->state(), -0.001), velocities);
    run(0.004);
    const Eigen::Vector3d force = force_of(*backend, ContactSide::kHuman);
    EXPECT_NEAR(force.y(), mu * -force.x(), 0.03 * mu * -force.x()) << mu;  // along the hand's motion
  }
}

TEST_F(SimbodyContact, ContinuesBitwiseFromASnapshotWhileTheHumanPushes) {
  scene.partner = PartnerMode::kSolid;
  start(rest);
  HumanJoints velocities = HumanJoints::Zero();
  velocities.row(0).setConstant(-0.3);
  backend->set_partner(hand_before_sledge(rest, 0.001), velocities);
  run(0.05);
  ASSERT_GT(force_of(*backend, ContactSide::kHuman).norm(), 0.0);
  const Snapshot snapshot = backend->snapshot();
  run(0.2);
  const RobotState first = backend->state();
  const Eigen::Vector3d force = force_of(*backend, ContactSide::kHuman);
  backend->restore(snapshot);
  EXPECT_TRUE(backend->contacts().empty());
  run(0.2);
  EXPECT_TRUE(test::same(backend->state(), first));
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman), force);
}

// Simbody has no capsules; those of the narrow phase are duet's.
TEST_F(SimbodyContact, ACapsuleLyingOnTheGroundTouchesAtBothEnds) {
  auto robot = std::make_shared<RobotModel>(*test::sledge());
  RobotShape capsule;
  capsule.kind = ShapeKind::kCapsule;
  capsule.radius = 0.1;
  capsule.half_length = 0.3;
  capsule.X_LS.R = Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitY());
  robot->shapes = {capsule};
  scene.robot = robot;
  start(rest);
  run(1.0);
  ASSERT_EQ(backend->contacts().size(), 2U);
  for (const Contact& contact : backend->contacts())
    EXPECT_NEAR(contact.f_W.z(), 0.5 * kMass * kGravity, 1e-3 * kMass * kGravity);
  EXPECT_NEAR((backend->contacts()[0].p_WC - backend->contacts()[1].p_WC).norm(), 0.6, 1e-3);
}

TEST_F(SimbodyContact, ALinkWithoutShapesFallsThroughTheGround) {
  auto robot = std::make_shared<RobotModel>(*test::sledge());
  robot->shapes.clear();
  robot->feet.clear();
  scene.robot = robot;
  start(rest);
  run(1.0);
  EXPECT_LT(backend->state().X_WB.p.z(), -4.0);
  EXPECT_TRUE(backend->contacts().empty());
}

// Two arms of a flying base, driven into one another.
std::shared_ptr<RobotModel> scissors() {
  auto robot = test::wheel();
  robot->name = "scissors";
  robot->links.push_back(robot->links[1]);
  robot->joints.push_back(robot->joints[0]);
  robot->neutral = Eigen::VectorXd::Zero(2);
  for (const int i : {0, 1}) {
    robot->links[1 + i].X_PL.p = {0.0, i == 0 ? 0.1 : -0.1, 0.0};
    RobotShape blade;
    blade.kind = ShapeKind::kCapsule;
    blade.link = 1 + i;
    blade.radius = 0.03;
    blade.half_length = 0.2;
    blade.X_LS.p = {0.2, 0.0, 0.0};
    blade.X_LS.R = Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d::UnitY());
    robot->shapes.push_back(blade);
  }
  robot->self_collision = {{0, 1}};
  return robot;
}

TEST_F(SimbodyContact, LinksOfADeclaredPairHoldOneAnotherEquallyAndOppositely) {
  scene.robot = scissors();
  JointCommand command = test::no_torque(*scene.robot);
  command.tau_ff << -5.0, 5.0;
  for (const bool on : {true, false}) {
    scene.self_collision = on;
    start(test::state_of(*scene.robot, {0.0, 0.0, 1000.0}));
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
    if (!on) {
      EXPECT_NEAR(backend->state().q[0], -1.0, 1e-3);  // at its stop, through the other
      continue;
    }
    ASSERT_EQ(backend->contacts().size(), 1U);
    const Contact& contact = backend->contacts()[0];
    EXPECT_EQ(contact.side, ContactSide::kRobot);
    EXPECT_EQ(contact.link, 1);
    EXPECT_EQ(contact.other, 2);
    EXPECT_GT(contact.f_W.y(), 0.0);  // away from the other
    EXPECT_LT(contact.depth, 1e-3);
    EXPECT_GT(backend->state().q[0], -0.6);
    EXPECT_NEAR(backend->state().q[0], -backend->state().q[1], 1e-3);
    EXPECT_LT(backend->state().v.norm(), 1e-3);
    const Eigen::Vector3d arm = contact.p_WC - (backend->state().X_WB * Eigen::Vector3d(0.0, 0.1, 0.0));
    EXPECT_NEAR(arm.cross(contact.f_W).z(), 5.0, 0.05);  // what the joint gives
  }
}

// A human's hand held against the chest of the G1, which stands by its feet's friction alone for that time.
TEST_F(SimbodyContact, TheG1FeelsAHandWithTheSameForceAtTwoTimeSteps) {
  scene.robot = std::make_shared<const RobotModel>(load_robot(default_card_path()));
  scene.partner = PartnerMode::kSolid;
  const RobotState standing = scene.robot->standing_state();
  double peaks[2] = {0.0, 0.0};
  for (const int k : {0, 1}) {
    scene.dt = k == 0 ? 0.001 : 0.002;
    start(standing);
    HumanJoints joints = HumanJoints::Zero(), velocities = HumanJoints::Zero();
    const Eigen::Vector3d middle = standing.X_WB.p + Eigen::Vector3d(0.20, 0.0, 0.2);
    joints.col(20) = middle + Eigen::Vector3d(0.0, 0.3, 0.0);
    joints.col(22) = middle - Eigen::Vector3d(0.0, 0.3, 0.0);
    velocities.row(0).setConstant(-0.2);
    backend->set_partner(joints, velocities);
    const JointCommand command = scene.robot->default_command(scene.robot->neutral);
    for (int i = 0; i < static_cast<int>(std::lround(0.6 / scene.dt)); ++i) {
      ASSERT_EQ(backend->step(command), Outcome::kOk);
      peaks[k] = std::max(peaks[k], force_of(*backend, ContactSide::kHuman).norm());
    }
  }
  EXPECT_GT(peaks[0], 20.0);
  EXPECT_NEAR(peaks[0], peaks[1], 0.05 * peaks[0]);
}

TEST_F(SimbodyContact, ContactsComeInTheOrderOfShapes) {
  start(rest);
  run(0.5);
  ASSERT_EQ(backend->contacts().size(), 4U);
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d foot = backend->state().X_WB * scene.robot->shapes[i].X_LS.p;
    EXPECT_NEAR((backend->contacts()[i].p_WC - foot).head<2>().norm(), 0.0, 1e-3);
  }
}

}  // namespace
}  // namespace duet
