// Laws of contacts in every engine: friction per pair, the sign and the sum of forces, links that touch.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/backends/contact_scene.h"

namespace duet {
namespace {

using test::force_of;
using test::kMass;

// Where engines truly differ.
struct Bounds {
  double spin_change = 0.0;      // of a free body [rad/s]
  double cone = 1.05;            // tangential force over friction times normal force
  double slowing_speed = 0.01;   // error of the speed over friction [m/s]
  double sliding_force = 0.01;   // relative
  double slipping_speed = 0.02;  // relative
  double slipping_aside = 1e-3;  // [m/s]
  double tongs_drift = 2e-4;     // the step's own error while the arms swing [m/s]
};

Bounds bounds_of(const std::string& engine) {
  // Its cone is convex: a body that is suddenly given a sliding speed, or slips, also hops (README).
  if (engine == "mujoco")
    return {.slowing_speed = 0.06, .sliding_force = 0.02, .slipping_speed = 0.25, .slipping_aside = 0.02};
  // It keeps the spin in W, so that ours is rounded; its friction is a pyramid; its bodies each have all six degrees of
  // freedom, so that arms that swing move the whole less.
  if (engine == "ode") return {.spin_change = 1e-12, .cone = std::sqrt(2.0) * 1.001, .tongs_drift = 1e-6};
  return {};
}

struct EngineContact : test::ContactScene, ::testing::WithParamInterface<std::string> {
  EngineContact() : ContactScene(GetParam()) {}
  const Bounds bounds = bounds_of(GetParam());
};
INSTANTIATE_TEST_SUITE_P(Engines, EngineContact, ::testing::ValuesIn(test::engine_names()), test::engine_of);

TEST_P(EngineContact, RestingForceIsTheWeightAndPointsUp) {
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

TEST_P(EngineContact, SlidingForceIsTheFrictionOfThePairTimesTheNormalForce) {
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

TEST_P(EngineContact, SlidingSlowsDownByFrictionTimesGravity) {
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
      EXPECT_NEAR(backend->state().v_WB.dot(along), 0.8 * mu - mu * kGravity * 0.05, bounds.slowing_speed * mu)
          << mu << " " << angle;
      const Eigen::Vector3d force = force_of(*backend, ContactSide::kGround);
      EXPECT_NEAR(-force.dot(along), mu * force.z(), bounds.sliding_force * mu * force.z()) << mu;
      run(0.2);
      EXPECT_LT(backend->state().v_WB.norm(), 1e-4) << mu;
    }
  }
}

// On an incline of slope tan: friction mu holds below it and not above.
TEST_P(EngineContact, InclineSlipsAtTheAngleOfFrictionAlongXAndYAndBetween) {
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

// On an incline, along its sides and its diagonal: slips beyond the angle of friction, holds below it.
TEST_P(EngineContact, SlipsAtTheAngleOfFrictionInEveryDirection) {
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
      EXPECT_NEAR(backend->state().v_WB.dot(along), expected, bounds.slipping_speed * expected + 1e-4)
          << along.transpose();
      EXPECT_NEAR((backend->state().v_WB - along * along.dot(backend->state().v_WB)).norm(), 0.0,
                  bounds.slipping_aside);
    }
  }
}

TEST_P(EngineContact, PushBelowFrictionHoldsAndAboveItMoves) {
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

TEST_P(EngineContact, PushActsAtItsPointOfTheLinkAndEndsWithZero) {
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
  EXPECT_NEAR(backend->state().w_WB_B.x(), spin.x(), bounds.spin_change);
}

// A touch-down breaks what was foreseen to stick and throws it at the ground again: never a pull.
TEST_P(EngineContact, NeverPulls) {
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
      EXPECT_LE(contact.f_W.head<2>().norm(), 0.6 * bounds.cone * contact.f_W.z() + 1e-6) << backend->time();
    }
  }
  EXPECT_TRUE(touched);
  EXPECT_NEAR(force_of(*backend, ContactSide::kGround).z(), kMass * kGravity, 1e-3 * kMass * kGravity);
}

TEST_P(EngineContact, ContactsComeInTheOrderOfShapes) {
  start(rest);
  run(0.5);
  ASSERT_EQ(backend->contacts().size(), 4U);
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d foot = backend->state().X_WB * scene.robot->shapes[i].X_LS.p;
    EXPECT_NEAR((backend->contacts()[i].p_WC - foot).head<2>().norm(), 0.0, 1e-3);
  }
}

TEST_P(EngineContact, ACapsuleLyingOnTheGroundTouchesAtBothEnds) {
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

TEST_P(EngineContact, ALinkWithoutShapesFallsThroughTheGround) {
  auto robot = std::make_shared<RobotModel>(*test::sledge());
  robot->shapes.clear();
  robot->feet.clear();
  scene.robot = robot;
  start(rest);
  run(1.0);
  EXPECT_LT(backend->state().X_WB.p.z(), -4.0);
  EXPECT_TRUE(backend->contacts().empty());
}

// Two arms of one robot.
std::shared_ptr<RobotModel> tongs() {
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
  return robot;
}

// In flight the arms are driven together.
TEST_P(EngineContact, LinksThatTouchHoldOneAnotherAndKeepMomentum) {
  const auto robot = tongs();
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
    // Equal and opposite: nothing moves the whole, but for the step's own error along x while the arms swung.
    EXPECT_NEAR(backend->state().v_WB.x(), 0.0, bounds.tongs_drift);
    EXPECT_NEAR(backend->state().v_WB.tail<2>().norm(), 0.0, 1e-9);
    EXPECT_NEAR(backend->state().w_WB_B.norm(), 0.0, 1e-9);
  }
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

TEST_P(EngineContact, LinksOfADeclaredPairHoldOneAnotherEquallyAndOppositely) {
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

// The rim's ball is driven against a ball of the base, declared as touching.
TEST_P(EngineContact, DeclaredPairHoldsAndIsReportedFromItsFirstShape) {
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

}  // namespace
}  // namespace duet
