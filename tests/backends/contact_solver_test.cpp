// Contacts of one step against closed forms and against the laws they must keep, on the sledge and the G1.
#include "duet/backends/contact_solver.h"

#include <cmath>

#include "duet/robots/dynamics.h"
#include "tests/backends/allocation_count.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kDt = 0.002;
constexpr int kSweeps = 200;
constexpr double kSettled = 2e-4;  // what that many sweeps leave where contacts slide [m/s]
constexpr double kBlow = 1e-3;     // and where eight contacts of two stiff legs open and slide in one blow [m/s]
constexpr ConstraintSoftness kRigid = {.erp = 0.5, .cfm = 1e-6};

// A robot over the ground, its mass matrix factored, its contacts added.
struct Step {
  Step(const std::shared_ptr<const RobotModel>& robot_, RobotState state_, double friction)
      : robot(robot_),
        state(std::move(state_)),
        dynamics(*robot),
        factor(*robot),
        solver(*robot, 64, kDt, kSweeps),
        narrow(scene(robot, friction)) {
    dynamics.update(state);
    factor.compute(dynamics.mass(), armature());
    points = narrow.collide(dynamics.kinematics(), {});
    for (const ContactPoint& point : points) solver.add(point, kRigid, rotations(), positions());
  }
  static Scene scene(const std::shared_ptr<const RobotModel>& robot, double friction) {
    Scene scene;
    scene.robot = robot;
    scene.friction.robot_ground = friction;
    return scene;
  }
  [[nodiscard]] Eigen::VectorXd armature() const {
    Eigen::VectorXd values(robot->dof());
    for (int i = 0; i < robot->dof(); ++i) values[i] = robot->joints[i].armature;
    return values;
  }
  [[nodiscard]] std::span<const Eigen::Matrix3d> rotations() const { return dynamics.kinematics().rotations(); }
  [[nodiscard]] std::span<const Eigen::Vector3d> positions() const { return dynamics.kinematics().positions(); }
  [[nodiscard]] Eigen::Vector3d velocity_at(const ContactPoint& point, const Eigen::VectorXd& v) const {
    Eigen::MatrixXd J(3, v.size()), J_other = Eigen::MatrixXd::Zero(3, v.size());
    dynamics.kinematics().point_jacobian(point.link, point.p_W, J);
    if (point.side == ContactSide::kRobot) dynamics.kinematics().point_jacobian(point.other, point.p_W, J_other);
    return (J - J_other) * v;
  }
  // The laws in the head of contact_solver.h, to `tolerance` [m/s] and [N s].
  void expect_laws(const Eigen::VectorXd& v, double tolerance) const {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const ContactPoint& point = points[i];
      const Eigen::Vector3d p = solver.impulse(i), u = velocity_at(point, v) - point.v_other_W;
      const double p_n = p.dot(point.n_W);
      const double row = u.dot(point.n_W) + kRigid.cfm * p_n / kDt - kRigid.erp * point.depth / kDt;
      EXPECT_GE(p_n, 0.0);
      EXPECT_GE(row, -tolerance);
      EXPECT_LE(std::min(p_n, row), tolerance);
      const Eigen::Vector3d p_t = p - p_n * point.n_W, u_t = u - u.dot(point.n_W) * point.n_W;
      EXPECT_LE(p_t.norm(), point.friction * p_n + 1e-12);
      if (p_t.norm() < point.friction * p_n - tolerance) {
        EXPECT_LE(u_t.norm(), tolerance);
      } else if (u_t.norm() > 100.0 * tolerance) {
        EXPECT_NEAR(p_t.dot(u_t), -point.friction * p_n * u_t.norm(), tolerance);  // against the slip
      }
    }
  }
  std::shared_ptr<const RobotModel> robot;
  RobotState state;
  Dynamics dynamics;
  TreeFactor factor;
  ContactSolver solver;
  NarrowPhase narrow;
  std::span<const ContactPoint> points;
};

RobotState sunk_sledge() { return test::state_of(*test::sledge(), {0.0, 0.0, 0.1 - 1e-5}); }

TEST(ContactSolver, SpringAndDamperAreTakenImplicitly) {
  const ConstraintSoftness soft = spring_damper(25000.0, 200.0, kDt);
  EXPECT_DOUBLE_EQ(soft.erp, 50.0 / 250.0);
  EXPECT_DOUBLE_EQ(soft.cfm, 1.0 / 250.0);
}

TEST(ContactSolver, NeitherSpringNorDamperIsSoftAndFinite) {
  const ConstraintSoftness nothing = spring_damper(0.0, 0.0, kDt);
  EXPECT_EQ(nothing.erp, 0.0);
  EXPECT_GT(nothing.cfm, 1e8);
  EXPECT_LT(nothing.cfm, 1e10);
}

TEST(ContactSolver, WithoutContactNothingChanges) {
  Step step(test::sledge(), test::state_of(*test::sledge(), {0.0, 0.0, 1.0}), 0.5);
  Eigen::VectorXd v = Eigen::VectorXd::LinSpaced(6, -1.0, 1.0);
  const Eigen::VectorXd before = v;
  step.solver.solve(step.factor, v);
  EXPECT_EQ(v, before);
  EXPECT_EQ(step.solver.size(), 0U);
}

TEST(ContactSolver, ASledgeThatFallsStopsAndKeepsItsMomentumBalance) {
  Step step(test::sledge(), sunk_sledge(), 0.5);
  Eigen::VectorXd v = Eigen::VectorXd::Zero(6);
  v[2] = -0.3;
  step.solver.solve(step.factor, v);
  EXPECT_NEAR(v[2], kRigid.erp * 1e-5 / kDt - kRigid.cfm * 10.0 * 0.3 / 4.0 / kDt, 1e-5);
  EXPECT_NEAR(step.solver.generalized_impulse()[2], 10.0 * (v[2] + 0.3), 1e-9);
  step.expect_laws(v, 1e-6);
}

TEST(ContactSolver, NothingPullsASledgeThatRises) {
  Step step(test::sledge(), sunk_sledge(), 0.5);
  Eigen::VectorXd v = Eigen::VectorXd::Zero(6);
  v[2] = 0.3;
  step.solver.solve(step.factor, v);
  EXPECT_EQ(v[2], 0.3);
  EXPECT_EQ(step.solver.generalized_impulse().norm(), 0.0);
}

TEST(ContactSolver, FrictionIsAConeInAllDirections) {
  // Pressed down by 1 N s and moved along: where friction does not hold, it slows down by mu / m against the motion.
  const double mu = 0.4, pressed = 0.1;
  for (const double angle : {0.0, 0.3, 0.785, 1.571, 2.5}) {
    for (const double speed : {0.02, 0.2}) {
      Step step(test::sledge(), sunk_sledge(), mu);
      Eigen::VectorXd v = Eigen::VectorXd::Zero(6);
      v[0] = speed * std::cos(angle);
      v[1] = speed * std::sin(angle);
      v[2] = -pressed;
      step.solver.solve(step.factor, v);
      const double stopped = mu * (v[2] + pressed);
      const double expected = std::max(0.0, speed - stopped);
      // Tipping is part of it: the friction acts below the centre of mass, but all four keep touching.
      EXPECT_NEAR(v.head<2>().norm(), expected, 0.02 * speed) << angle << " " << speed;
      if (expected > 0.0) {
        EXPECT_NEAR(std::atan2(v[1], v[0]), angle, 1e-3);
      }
      step.expect_laws(v, kSettled);
    }
  }
}

TEST(ContactSolver, AStopTakesTheVelocityAndReturnsTheRest) {
  Step step(test::wheel(), test::state_of(*test::wheel(), {0.0, 0.0, 10.0}), 0.5);
  Eigen::VectorXd v = Eigen::VectorXd::Zero(7);
  v[6] = 3.0;
  step.solver.add_stop(0, -1.0, 1e-3, {.erp = 0.5, .cfm = 0.0});
  step.solver.solve(step.factor, v);
  EXPECT_NEAR(v[6], -0.5 * 1e-3 / kDt, 1e-6);
  EXPECT_NEAR(step.solver.stop_impulse(0), (test::kWheelInertia + test::kWheelArmature) * 3.25, 1e-5);
  v[6] = 3.0;  // a gap of 1 mrad may be closed
  step.solver.clear();
  step.solver.add_stop(0, -1.0, -1e-3, {.erp = 0.5, .cfm = 0.0});
  step.solver.solve(step.factor, v);
  EXPECT_NEAR(v[6], 1e-3 / kDt, 1e-6);
  v[6] = -3.0;  // and a stop does not hold back
  step.solver.solve(step.factor, v);
  EXPECT_EQ(v[6], -3.0);
}

TEST(ContactSolver, TheLawsHoldForTheG1InEveryMixOfSlipAndLift) {
  const auto robot = test::g1();
  RobotState state = robot->standing_state();
  state.X_WB.p.z() -= 1.5e-3;  // toes and heels
  for (int trial = 0; trial < 8; ++trial) {
    Step step(robot, state, 0.6);
    ASSERT_EQ(step.points.size(), 8U);
    Eigen::VectorXd v = Eigen::VectorXd::Zero(6 + robot->dof());
    v[2] = -0.1;
    v[trial % 6] += 0.2 * (trial < 6 ? 1.0 : -1.0);
    v[6 + trial] = 1.0;
    step.solver.solve(step.factor, v);
    step.expect_laws(v, kBlow);
  }
}

TEST(ContactSolver, ForcesBetweenLinksAreEqualAndOpposite) {
  // Two rims on one base, pressed on each other along x: the momentum of the whole stays.
  auto robot = test::wheel();
  robot->links.push_back(robot->links[1]);
  robot->joints.push_back(robot->joints[0]);
  robot->neutral = Eigen::VectorXd::Zero(2);
  robot->links[1].X_PL.p = {0.0, 0.5, 0.0};
  robot->links[2].X_PL.p = {0.0, -0.5, 0.0};
  Step step(robot, test::state_of(*robot, {0.0, 0.0, 10.0}), 0.5);
  ContactPoint point;
  point.link = 1;
  point.other = 2;
  point.side = ContactSide::kRobot;
  point.p_W = {0.0, 0.0, 10.0};
  point.n_W = Eigen::Vector3d::UnitX();
  point.friction = 0.5;
  step.solver.add(point, kRigid, step.rotations(), step.positions());
  Eigen::VectorXd v = Eigen::VectorXd::Zero(8);
  v[6] = -1.0;  // the point moves by +0.5 v[6] with link 1 and by -0.5 v[7] with link 2: towards each other
  v[7] = -2.0;
  step.solver.solve(step.factor, v);
  EXPECT_GT(step.solver.impulse(0).x(), 0.0);
  EXPECT_NEAR(step.solver.generalized_impulse().head<6>().norm(), 0.0, 1e-12);
  EXPECT_NEAR(step.velocity_at(point, v).x(), 0.0, 1e-3);
}

TEST(ContactSolver, AllocatesNothingWhetherContactsStickSlideOrAreMany) {
  const auto robot = test::g1();
  RobotState state = robot->standing_state();
  for (const double depth : {1.5e-3, 0.5}) {  // on its feet; sunk to the thighs
    state.X_WB.p.z() = robot->standing_height - depth;
    Step step(robot, state, 0.6);
    for (const double speed : {0.0, 0.5}) {
      Eigen::VectorXd v = Eigen::VectorXd::Zero(6 + robot->dof());
      v.head<3>() << speed, 0.1 * speed, -0.1;
      const long before = test::allocation_count();
      step.solver.clear();
      for (const ContactPoint& point : step.points) step.solver.add(point, kRigid, step.rotations(), step.positions());
      step.solver.solve(step.factor, v);
      EXPECT_EQ(test::allocation_count(), before) << depth << " " << speed;
    }
  }
}

TEST(ContactSolver, EqualInputGivesEqualBitsWhateverCameBefore) {
  const auto robot = test::g1();
  RobotState state = robot->standing_state();
  state.X_WB.p.z() -= 1e-4;
  Step step(robot, state, 0.3);
  Eigen::VectorXd start = Eigen::VectorXd::Zero(6 + robot->dof());
  start.head<3>() << 0.4, 0.1, -0.2;
  Eigen::VectorXd first = start, again = start;
  step.solver.solve(step.factor, first);
  step.solver.clear();
  step.solver.add_stop(3, 1.0, 0.01, kRigid);
  Eigen::VectorXd other = start;
  step.solver.solve(step.factor, other);
  step.solver.clear();
  for (const ContactPoint& point : step.points) step.solver.add(point, kRigid, step.rotations(), step.positions());
  step.solver.solve(step.factor, again);
  EXPECT_EQ(first, again);
}

}  // namespace
}  // namespace duet
