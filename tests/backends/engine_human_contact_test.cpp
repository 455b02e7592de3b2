// Laws of contacts with the human in every engine: the skin, the friction and the motion of the partner.
#include <algorithm>
#include <cmath>

#include "tests/backends/contact_scene.h"

namespace duet {
namespace {

using test::force_of;
using test::hand_before_sledge;
using test::kMass;

// Whether nothing but the skin acts on the held sledge. Sticking friction with the hand may bear weight beside it, and
// no law says how much: in Bullet always, in DART and Simbody where the hand came before the ground had taken the
// weight.
bool only_the_skin_acts(const std::string& engine, bool settled_first) {
  if (engine == "bullet") return false;
  if (engine == "dart" || engine == "simbody") return settled_first;
  return true;
}

struct EngineHumanContact : test::ContactScene, ::testing::WithParamInterface<std::string> {
  EngineHumanContact() : ContactScene(GetParam()) {}
};
INSTANTIATE_TEST_SUITE_P(Engines, EngineHumanContact, ::testing::ValuesIn(test::engine_names()), test::engine_of);

TEST_P(EngineHumanContact, GhostTouchesNothing) {
  scene.partner = PartnerMode::kGhost;
  start(rest);
  backend->set_partner(hand_before_sledge(rest, -0.02), HumanJoints::Zero());
  run(0.1);
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman), Eigen::Vector3d::Zero());
  EXPECT_NEAR(backend->state().X_WB.p.x(), 0.0, 1e-6);
}

TEST_P(EngineHumanContact, SkinIsTheSpringOfTheSceneAtRest) {
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
    const double expected = scene.human.capsules[contact.other].skin.stiffness * contact.depth;
    EXPECT_NEAR(-contact.f_W.x(), expected, 0.01 * -contact.f_W.x());
    if (only_the_skin_acts(engine, true)) {
      EXPECT_NEAR(contact.f_W.norm(), expected, 0.01 * contact.f_W.norm());
    }
    force += contact.f_W;
  }
  EXPECT_LT(force.x(), -10.0);                                                               // away from the hand
  EXPECT_NEAR(force_of(*backend, ContactSide::kGround).x(), -force.x(), 0.03 * -force.x());  // balance of momentum
}

TEST_P(EngineHumanContact, SkinIsTheDamperOfTheSceneInMotion) {
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

// The hand runs into the free sledge at 0.5 m/s: two springs K and dampers D side by side on 10 kg.
TEST_P(EngineHumanContact, SkinIsTheDampedSpringOfTheSceneInMotionWhateverTheStep) {
  scene.partner = PartnerMode::kSolid;
  RobotState flying = rest;
  flying.X_WB.p.z() = 100.0;
  for (const double dt : {0.0005, 0.001, 0.002}) {
    scene.dt = dt;
    start(flying);
    HumanJoints velocities = HumanJoints::Zero();
    velocities.row(0).setConstant(-0.5);
    backend->set_partner(hand_before_sledge(flying, 0.0), velocities);
    const ContactCompliance skin = scene.human.capsules[0].skin;
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

// The hand moves on against a held sledge until it is 1 mm deep: force K depth, whatever the step.
TEST_P(EngineHumanContact, SkinIsTheSameAtEveryStep) {
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
      const double expected = scene.human.capsules[0].skin.stiffness * contact.depth;
      EXPECT_NEAR(-contact.f_W.x(), expected, 0.01 * -contact.f_W.x());
      if (only_the_skin_acts(engine, false)) {
        EXPECT_NEAR(contact.f_W.norm(), expected, 0.01 * contact.f_W.norm());
      }
    }
  }
  for (const double peak : peaks) EXPECT_NEAR(peak, peaks[0], 0.15 * peaks[0]);
}

TEST_P(EngineHumanContact, SkinOfTwoPointsOfOneCapsuleIsOneSkin) {
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
TEST_P(EngineHumanContact, PeakOfABlowOnAMovingLinkDoesNotDependOnTheStep) {
  constexpr double kArm = 0.3, kSpeed = 0.3;
  const double mass = (test::kWheelInertia + test::kWheelArmature) / (kArm * kArm);
  const ContactCompliance skin = scene.human.capsules[0].skin;
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

// A human's hand held against the chest of the G1, which stands by its feet's friction alone for that time.
TEST_P(EngineHumanContact, TheG1FeelsAHandWithTheSameForceAtTwoTimeSteps) {
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

TEST_P(EngineHumanContact, PartnerMovesOnBetweenCallsAndGoesWithReset) {
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

// Bullet takes a kinematic body's velocity from its transforms, so that a teleport makes meganewtons; here only the
// partner's own velocity counts.
TEST_P(EngineHumanContact, PartnerThatIsTeleportedTouchesAsOneThatWasThere) {
  scene.partner = PartnerMode::kSolid;
  scene.friction.robot_ground = 10.0;
  start(rest);
  backend->set_partner(hand_before_sledge(rest, 2.0), HumanJoints::Zero());
  run(0.5);
  EXPECT_EQ(force_of(*backend, ContactSide::kHuman).norm(), 0.0);
  const double depth = 0.001;
  backend->set_partner(hand_before_sledge(backend->state(), -depth), HumanJoints::Zero());
  run(scene.dt);
  const ContactCompliance& skin = scene.human.capsules[0].skin;
  EXPECT_LT(force_of(*backend, ContactSide::kHuman).norm(), 3.0 * skin.stiffness * depth);  // two spheres
  EXPECT_GT(force_of(*backend, ContactSide::kHuman).norm(), skin.stiffness * depth);
}

TEST_P(EngineHumanContact, FrictionWithTheHumanIsThatOfThePairNotOfTheGround) {
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

TEST_P(EngineHumanContact, ContinuesBitwiseFromASnapshotWhileTheHumanPushes) {
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

}  // namespace
}  // namespace duet
