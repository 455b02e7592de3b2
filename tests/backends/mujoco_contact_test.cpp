// MuJoCo's contacts: friction per pair, the sign and the sum of forces, the skin of the human.
#include <cmath>

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

struct MujocoContact : ::testing::Test {
  void SetUp() override {
    if (!engines()[1].available) GTEST_SKIP() << "not run: " << engines()[1].reason;
    scene.robot = test::sledge();
    scene.human = hand();
    scene.partner = PartnerMode::kNone;
    rest = test::state_of(*scene.robot, {0.0, 0.0, 0.1});
  }
  void start(const RobotState& state) {
    backend = make_backend("mujoco", scene);
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

TEST_F(MujocoContact, RestingForceIsTheWeightAndPointsUp) {
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

// MuJoCo's cone is convex: a body that is suddenly given a sliding speed also hops (README). The ratio of the forces
// and the momentum are exact all the same.
TEST_F(MujocoContact, SlidingForceIsTheFrictionOfThePairTimesTheNormalForce) {
  for (const double mu : {0.1, 0.3, 0.8}) {
    scene.friction = {.robot_ground = mu, .robot_human = 0.9, .robot_robot = 0.7};
    start(rest);
    run(0.5);
    RobotState moving = backend->state();
    moving.v_WB.x() = 0.8 * mu;
    backend->reset(moving);
    double impulse = 0.0;
    while (backend->state().v_WB.x() > 0.2 * mu) {
      run(scene.dt);
      for (const Contact& contact : backend->contacts()) {
        EXPECT_NEAR(-contact.f_W.x(), mu * contact.f_W.z(), 1e-3 * mu * contact.f_W.z()) << mu;
        impulse += contact.f_W.x() * scene.dt;
      }
    }
    EXPECT_NEAR(impulse, kMass * (backend->state().v_WB.x() - moving.v_WB.x()), 1e-9) << mu;
  }
}

TEST_F(MujocoContact, PushBelowFrictionHoldsAndAboveItMoves) {
  scene.friction.robot_ground = 0.5;
  for (const double share : {0.9, 1.1}) {
    start(rest);
    run(0.5);
    const double x = backend->state().X_WB.p.x();
    backend->push(0, {share * 0.5 * kMass * kGravity, 0.0, 0.0}, {x, 0.0, 0.01});
    run(1.0);
    const double moved = backend->state().X_WB.p.x() - x;
    if (share < 1.0)
      EXPECT_LT(moved, 0.01);
    else
      EXPECT_NEAR(moved, 0.5 * 0.1 * 0.5 * kGravity, 0.05);
  }
}

TEST_F(MujocoContact, PushActsAtItsPointOfTheLinkAndEndsWithZero) {
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

TEST_F(MujocoContact, GhostTouchesNothing) {
  scene.partner = PartnerMode::kGhost;
  start(rest);
  backend->set_partner(hand_before_sledge(rest, -0.02), HumanJoints::Zero());
  run(0.1);
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman), Eigen::Vector3d::Zero());
  EXPECT_NEAR(backend->state().X_WB.p.x(), 0.0, 1e-6);
}

TEST_F(MujocoContact, SkinIsTheSpringOfTheSceneAtRest) {
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

TEST_F(MujocoContact, SkinIsThatOfTheCapsuleInEverySolverAndCone) {
  scene.partner = PartnerMode::kSolid;
  scene.friction.robot_ground = 10.0;
  for (const double stiffness : {1e4, 7.5e4})
    for (const char* solver : {"newton", "cg", "pgs"})
      for (const char* cone : {"elliptic", "pyramidal"}) {
        scene.options = {{"solver", solver}, {"cone", cone}, {"iterations", "500"}, {"tolerance", "1e-12"}};
        scene.human.capsules[0].skin.stiffness = stiffness;
        start(rest);
        run(0.2);
        backend->set_partner(hand_before_sledge(backend->state(), -0.001), HumanJoints::Zero());
        run(0.5);
        int touching = 0;
        for (const Contact& contact : backend->contacts()) {
          if (contact.side != ContactSide::kHuman) continue;
          ++touching;
          EXPECT_NEAR(-contact.f_W.x(), stiffness * contact.depth, 0.01 * stiffness * contact.depth)
              << solver << " " << cone;
        }
        EXPECT_EQ(touching, 2);
      }
}

TEST_F(MujocoContact, SkinOfTwoPointsOfOneCapsuleIsOneSkin) {
  scene.partner = PartnerMode::kSolid;
  scene.friction.robot_ground = 10.0;
  auto robot = test::sledge();
  RobotShape bar;
  bar.kind = ShapeKind::kCapsule;
  bar.radius = 0.02;
  bar.half_length = 0.2;
  bar.X_LS = {Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitY()), {0.25, 0, 0}};
  robot->shapes.push_back(bar);
  scene.robot = robot;
  start(rest);
  run(0.2);
  HumanJoints joints = HumanJoints::Zero();
  const Eigen::Vector3d middle = backend->state().X_WB * Eigen::Vector3d(0.25 + 0.07 - 0.001, 0.0, 0.0);
  joints.col(20) = middle + backend->state().X_WB.R * Eigen::Vector3d(0.0, 0.4, 0.0);
  joints.col(22) = middle - backend->state().X_WB.R * Eigen::Vector3d(0.0, 0.4, 0.0);
  backend->set_partner(joints, HumanJoints::Zero());
  run(0.3);
  double depth = 0.0;
  int points = 0;
  for (const Contact& contact : backend->contacts()) {
    if (contact.side != ContactSide::kHuman) continue;
    depth += contact.depth;
    ++points;
  }
  ASSERT_GE(points, 1);
  const double expected = scene.human.capsules[0].skin.stiffness * depth / points;
  EXPECT_NEAR(-force_of(*backend, ContactSide::kHuman).x(), expected, 0.02 * expected);
}

// A sphere on the rim of the wheel, 0.3 m from the axle, is met at 0.3 m/s: one mass of I / r^2 on K and D.
TEST_F(MujocoContact, PeakOfABlowOnAMovingLinkDoesNotDependOnTheStep) {
  constexpr double kArm = 0.3, kSpeed = 0.3;
  const double mass = (test::kWheelInertia + test::kWheelArmature) / (kArm * kArm);
  const Skin skin = scene.human.capsules[0].skin;
  double expected = 0.0, gap = 0.0, v = -kSpeed, h = 1e-6;
  for (int i = 0; i < 100000; ++i) {
    const double f = std::max(0.0, -skin.stiffness * gap - skin.damping * v);
    expected = std::max(expected, f);
    v += h * f / mass;
    gap += h * v;
  }
  auto robot = test::wheel();
  RobotShape ball;
  ball.link = 1;
  ball.X_LS.p.x() = kArm;
  ball.radius = 0.02;
  robot->shapes = {ball};
  scene.robot = robot;
  scene.partner = PartnerMode::kSolid;
  scene.gravity.setZero();
  for (const double dt : {0.0005, 0.001, 0.002}) {
    scene.dt = dt;
    start(test::state_of(*robot, {0.0, 0.0, 10.0}));
    HumanJoints joints = HumanJoints::Zero(), velocities = HumanJoints::Zero();
    joints.col(20) = Eigen::Vector3d(kArm - 0.2, -0.0701, 10.0);
    joints.col(22) = Eigen::Vector3d(kArm + 0.2, -0.0701, 10.0);
    velocities.row(1).setConstant(kSpeed);
    backend->set_partner(joints, velocities);
    double peak = 0.0;
    for (int i = 0; i < std::lround(0.05 / dt); ++i) {
      run(dt);
      peak = std::max(peak, force_of(*backend, ContactSide::kHuman).norm());
    }
    RecordProperty("peak_over_expected_at_" + std::to_string(std::lround(1e6 * dt)) + "_us",
                   std::to_string(peak / expected));
    EXPECT_NEAR(peak, expected, 0.1 * expected) << dt;
  }
}

// The rim's ball is driven against a ball of the base, declared as touching.
TEST_F(MujocoContact, DeclaredPairHoldsAndIsReportedFromItsFirstShape) {
  auto robot = test::wheel();
  RobotShape ball;
  ball.radius = 0.05;
  ball.X_LS.p = {0.3, 0.15, 0.0};
  robot->shapes.push_back(ball);
  ball.link = 1;
  ball.X_LS.p = {0.3, 0.0, 0.0};
  robot->shapes.push_back(ball);
  scene.robot = robot;
  scene.gravity.setZero();
  const RobotState state = test::state_of(*robot, {0.0, 0.0, 10.0});
  JointCommand command = test::no_torque(*robot);
  command.tau_ff[0] = 2.0;
  command.kd[0] = 0.5;
  for (const bool reversed : {false, true}) {
    robot->self_collision = {reversed ? std::pair(1, 0) : std::pair(0, 1)};
    start(state);
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
    ASSERT_EQ(backend->contacts().size(), 1U);
    const Contact& contact = backend->contacts()[0];
    EXPECT_EQ(contact.side, ContactSide::kRobot);
    EXPECT_EQ(contact.link, reversed ? 1 : 0);
    EXPECT_EQ(contact.other, reversed ? 0 : 1);
    EXPECT_LT(contact.depth, 0.002);
    const Eigen::Vector3d f_W = reversed ? contact.f_W : Eigen::Vector3d(-contact.f_W);  // on the rim
    EXPECT_NEAR((contact.p_WC - backend->state().X_WB.p).cross(f_W).z(), -2.0, 0.02);
    EXPECT_LT(backend->state().q[0], 0.25);
  }
  scene.self_collision = false;
  start(state);
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
  EXPECT_TRUE(backend->contacts().empty());
  EXPECT_GT(backend->state().q[0], 0.9);
}

TEST_F(MujocoContact, SkinIsTheDamperOfTheSceneInMotion) {
  // A free sledge, hit by the hand at 0.5 m/s: two contacts of K, D in parallel, taken linearly implicitly, move it as
  // m a = f, f = -2 (K r + (D + dt K) v_rel + (dt D + dt^2 K) a).
  scene.partner = PartnerMode::kSolid;
  RobotState flying = rest;
  flying.X_WB.p.z() = 100.0;
  start(flying);
  HumanJoints velocities = HumanJoints::Zero();
  velocities.row(0).setConstant(-0.5);
  backend->set_partner(hand_before_sledge(flying, 0.0005), velocities);
  double impulse = 0.0;
  for (int i = 0; i < 25; ++i) {
    backend->step(test::no_torque(*scene.robot));
    impulse += force_of(*backend, ContactSide::kHuman).x() * scene.dt;
  }
  EXPECT_LT(impulse, -1.0);
  EXPECT_NEAR(impulse, kMass * backend->state().v_WB.x(), 1e-6 * kMass);
}

TEST_F(MujocoContact, PartnerMovesOnBetweenCallsAndGoesWithReset) {
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

TEST_F(MujocoContact, FrictionWithTheHumanIsThatOfThePairNotOfTheGround) {
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

TEST_F(MujocoContact, ContinuesBitwiseFromASnapshotWhileTheHumanPushes) {
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

TEST_F(MujocoContact, ContactsComeInTheOrderOfShapes) {
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
