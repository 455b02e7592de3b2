// ODE's contacts: friction per pair, the sign and the sum of forces, the skin of the human, links that touch.
#include <algorithm>
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

struct OdeContact : ::testing::Test {
  void SetUp() override {
    const auto known = engines();
    if (std::ranges::none_of(known, [](const EngineInfo& info) { return info.name == "ode" && info.available; }))
      GTEST_SKIP() << "not run: engine ode absent";
    scene.robot = test::sledge();
    scene.human = hand();
    scene.partner = PartnerMode::kNone;
    rest = test::state_of(*scene.robot, {0.0, 0.0, 0.1});
  }
  void start(const RobotState& state) {
    backend = make_backend("ode", scene);
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

TEST_F(OdeContact, RestingForceIsTheWeightAndPointsUp) {
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

TEST_F(OdeContact, SlidingForceIsTheFrictionOfThePairTimesTheNormalForce) {
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

TEST_F(OdeContact, PushBelowFrictionHoldsAndAboveItMoves) {
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

TEST_F(OdeContact, PushActsAtItsPointOfTheLinkAndEndsWithZero) {
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
  EXPECT_NEAR(backend->state().w_WB_B.x(), spin.x(), 1e-12);
}

TEST_F(OdeContact, GhostTouchesNothing) {
  scene.partner = PartnerMode::kGhost;
  start(rest);
  backend->set_partner(hand_before_sledge(rest, -0.02), HumanJoints::Zero());
  run(0.1);
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman), Eigen::Vector3d::Zero());
  EXPECT_NEAR(backend->state().X_WB.p.x(), 0.0, 1e-6);
}

TEST_F(OdeContact, SkinIsTheSpringOfTheSceneAtRest) {
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

TEST_F(OdeContact, SkinIsTheDamperOfTheSceneInMotion) {
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

TEST_F(OdeContact, PartnerMovesOnBetweenCallsAndGoesWithReset) {
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

TEST_F(OdeContact, FrictionWithTheHumanIsThatOfThePairNotOfTheGround) {
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

TEST_F(OdeContact, ContinuesBitwiseFromASnapshotWhileTheHumanPushes) {
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

TEST_F(OdeContact, ContactsComeInTheOrderOfShapes) {
  start(rest);
  run(0.5);
  ASSERT_EQ(backend->contacts().size(), 4U);
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d foot = backend->state().X_WB * scene.robot->shapes[i].X_LS.p;
    EXPECT_NEAR((backend->contacts()[i].p_WC - foot).head<2>().norm(), 0.0, 1e-3);
  }
}

// On an incline, along its sides and its diagonal: slips beyond the angle of friction, holds below it.
TEST_F(OdeContact, SlipsAtTheAngleOfFrictionInEveryDirection) {
  const double mu = 0.5;
  scene.friction.robot_ground = mu;
  for (const Eigen::Vector3d& along : {Eigen::Vector3d(1.0, 0.0, 0.0), Eigen::Vector3d(0.0, 1.0, 0.0),
                                       Eigen::Vector3d(std::sqrt(0.5), std::sqrt(0.5), 0.0)}) {
    for (const double share : {0.98, 1.02}) {
      const double angle = share * std::atan(mu);
      scene.gravity = kGravity * (std::sin(angle) * along - std::cos(angle) * Eigen::Vector3d::UnitZ());
      start(rest);
      run(1.0);
      const double expected = std::max(0.0, kGravity * (std::sin(angle) - mu * std::cos(angle)));
      EXPECT_NEAR(backend->state().v_WB.dot(along), expected, 0.02 * expected + 1e-4) << along.transpose();
      EXPECT_NEAR((backend->state().v_WB - along * along.dot(backend->state().v_WB)).norm(), 0.0, 1e-3);
    }
  }
}

TEST_F(OdeContact, BoundedFrictionGivesTheSameForcesAsActive) {
  start(rest);
  backend->push(0, {20.0, 0.0, 0.0}, rest.X_WB.p);
  run(0.2);
  const std::vector<Contact> active(backend->contacts().begin(), backend->contacts().end());
  scene.options = {{"friction", "bounded"}};
  start(rest);
  backend->push(0, {20.0, 0.0, 0.0}, rest.X_WB.p);
  run(0.2);
  ASSERT_EQ(backend->contacts().size(), active.size());
  Eigen::Vector3d a = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < active.size(); ++i) {
    EXPECT_NEAR(active[i].f_W.z(), backend->contacts()[i].f_W.z(), 0.01);
    a += active[i].f_W;
  }
  EXPECT_NEAR((a - force_of(*backend, ContactSide::kGround)).norm(), 0.0, 0.01);
}

// A touch-down breaks what was foreseen to stick and throws it at the ground again: never a pull.
TEST_F(OdeContact, NeverPulls) {
  RobotState falling = rest;
  falling.X_WB.p.z() = 0.3;
  falling.X_WB.R = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, 0.5, 0.0).normalized());
  falling.v_WB = {1.0, 0.3, 0.0};
  scene.friction.robot_ground = 0.6;
  start(falling);
  bool touched = false;
  for (int i = 0; i < 1000; ++i) {
    run(scene.dt);
    for (const Contact& contact : backend->contacts()) {
      touched = true;
      EXPECT_GE(contact.f_W.z(), -1e-9);
      EXPECT_LE(contact.f_W.head<2>().norm(), std::sqrt(2.0) * 0.6 * 1.001 * contact.f_W.z() + 1e-6);  // a pyramid
    }
  }
  EXPECT_TRUE(touched);
  EXPECT_NEAR(force_of(*backend, ContactSide::kGround).z(), kMass * kGravity, 1e-3 * kMass * kGravity);
}

// The hand moves on against a held sledge until it is 1 mm deep: force K depth, whatever the step.
TEST_F(OdeContact, SkinIsTheSameAtEveryStep) {
  scene.partner = PartnerMode::kSolid;
  scene.friction.robot_ground = 10.0;
  std::vector<double> peaks;
  for (const double dt : {0.0005, 0.001, 0.002}) {
    scene.dt = dt;
    start(rest);
    HumanJoints velocities = HumanJoints::Zero();
    velocities.row(0).setConstant(-0.2);
    const HumanJoints joints = hand_before_sledge(rest, 0.001);
    backend->set_partner(joints, velocities);
    double peak = 0.0;
    for (int i = 0; i < static_cast<int>(std::lround(0.01 / dt)); ++i) {
      run(dt);
      peak = std::max(peak, force_of(*backend, ContactSide::kHuman).norm());
    }
    peaks.push_back(peak);
    backend->set_partner(hand_before_sledge(rest, -0.001), HumanJoints::Zero());
    run(0.5);
    for (const Contact& contact : backend->contacts()) {
      if (contact.side != ContactSide::kHuman) continue;
      EXPECT_NEAR(contact.f_W.norm(), scene.human.capsules[0].skin.stiffness * contact.depth,
                  0.01 * contact.f_W.norm());
    }
  }
  for (const double peak : peaks) EXPECT_NEAR(peak, peaks[0], 0.15 * peaks[0]);
}

// Two arms of one robot, in flight, are driven together.
TEST_F(OdeContact, LinksThatTouchHoldOneAnotherAndKeepMomentum) {
  auto robot = std::make_shared<RobotModel>();
  robot->name = "tongs";
  RobotLink base = test::box_link("base", 10.0);
  robot->links = {base};
  robot->neutral = Eigen::VectorXd::Zero(2);
  for (const double side : {1.0, -1.0}) {
    RobotLink arm = test::box_link("arm", 1.0);
    arm.parent = 0;
    arm.inertia *= 0.05;
    arm.com = {0.2, 0.0, 0.0};
    arm.X_PL.p = {0.0, 0.2 * side, 0.0};
    RobotShape finger;
    finger.link = static_cast<int>(robot->links.size());
    finger.X_LS.p = {0.4, 0.0, 0.0};
    finger.radius = 0.05;
    robot->links.push_back(arm);
    robot->shapes.push_back(finger);
    RobotJoint joint;
    joint.name = side > 0.0 ? "left" : "right";
    joint.lower = -1.5;
    joint.upper = 1.5;
    joint.effort = 5.0;
    joint.velocity = 10.0;
    joint.armature = 0.01;
    robot->joints.push_back(joint);
  }
  robot->self_collision = {{0, 1}};
  scene.robot = robot;
  scene.gravity.setZero();
  for (const bool touching : {true, false}) {
    scene.self_collision = touching;
    start(test::state_of(*robot, {0.0, 0.0, 50.0}));
    JointCommand command = test::no_torque(*robot);
    command.q_target = Eigen::Vector2d(-1.0, 1.0);
    command.kp.setConstant(20.0);
    command.kd.setConstant(1.0);
    for (int i = 0; i < 1000; ++i) ASSERT_EQ(backend->step(command), Outcome::kOk);
    if (!touching) {
      EXPECT_TRUE(backend->contacts().empty());
      EXPECT_NEAR(backend->state().q[0], -1.0, 1e-3);
      continue;
    }
    ASSERT_EQ(backend->contacts().size(), 1U);
    const Contact& contact = backend->contacts()[0];
    EXPECT_EQ(contact.side, ContactSide::kRobot);
    EXPECT_EQ(contact.link, 1);
    EXPECT_EQ(contact.other, 2);
    EXPECT_GT(contact.f_W.y(), 1.0);  // away from the other arm
    EXPECT_LT(contact.depth, 1e-4);
    EXPECT_NEAR(backend->state().v_WB.norm(), 0.0, 1e-6);  // equal and opposite: nothing moves the whole
    EXPECT_NEAR(backend->state().w_WB_B.norm(), 0.0, 1e-6);
  }
}

}  // namespace
}  // namespace duet
