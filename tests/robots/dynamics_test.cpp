#include "duet/robots/dynamics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/robots/explicit_step.h"
#include "tests/robots/allocations.h"
#include "tests/robots/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::generalised_velocity;
using test::random_state;

// Forces of the G1 reach 1e4 N in the random states; sums of 30 bodies lose some digits of 1e-16 relative.
constexpr double kAlgebra = 1e-9;

Eigen::VectorXd random_acceleration(const RobotModel& model, Random& random) {
  Eigen::VectorXd a(6 + model.dof());
  for (int k = 0; k < a.size(); ++k) a[k] = random.uniform(-10.0, 10.0);
  return a;
}

double kinetic_energy(const RobotModel& model, const RobotState& state) {
  Kinematics kinematics(model);
  kinematics.update(state.X_WB, state.q);
  const Eigen::VectorXd u = generalised_velocity(state);
  Eigen::MatrixXd J(3, u.size());
  double energy = 0.0;
  for (int i = 0; i < static_cast<int>(model.links.size()); ++i) {
    const RobotLink& link = model.links[i];
    kinematics.point_jacobian(i, kinematics.X_WL(i) * link.com, J);
    const Eigen::Vector3d v = J * u;
    kinematics.angular_jacobian(i, J);
    const Eigen::Vector3d w_L = kinematics.R_WL(i).transpose() * (J * u);
    energy += 0.5 * link.mass * v.squaredNorm() + 0.5 * w_L.dot(link.inertia * w_L);
  }
  for (int j = 0; j < model.dof(); ++j) energy += 0.5 * model.joints[j].armature * state.v[j] * state.v[j];
  return energy;
}

double potential_energy(const RobotModel& model, const RobotState& state) {
  Kinematics kinematics(model);
  kinematics.update(state.X_WB, state.q);
  return model.total_mass() * kGravity * kinematics.center_of_mass().z();
}

class DynamicsLaws : public testing::TestWithParam<int> {
 protected:
  const RobotModel model_ = GetParam() == 0 ? g1() : test::load_small();
  Random random_{11, static_cast<std::uint64_t>(GetParam())};
};

TEST_P(DynamicsLaws, MassMatrixIsSymmetricPositiveDefinite) {
  for (int k = 0; k < 10; ++k) {
    Eigen::MatrixXd M(6 + model_.dof(), 6 + model_.dof());
    mass_matrix(model_, random_state(model_, random_), M);
    EXPECT_EQ((M - M.transpose()).cwiseAbs().maxCoeff(), 0.0);
    EXPECT_EQ(M.llt().info(), Eigen::Success);
  }
}

TEST_P(DynamicsLaws, InverseDynamicsIsMassTimesAccelerationPlusBias) {
  for (int k = 0; k < 10; ++k) {
    const RobotState state = random_state(model_, random_);
    const Eigen::VectorXd a = random_acceleration(model_, random_);
    Eigen::MatrixXd M(a.size(), a.size());
    Eigen::VectorXd bias(a.size()), tau(a.size());
    mass_matrix(model_, state, M);
    bias_forces(model_, state, bias);
    inverse_dynamics(model_, state, a, tau);
    EXPECT_LT((tau - M * a - bias).cwiseAbs().maxCoeff(), kAlgebra);
  }
}

TEST_P(DynamicsLaws, KineticEnergyOfTheMatrixIsThatOfTheBodies) {
  for (int k = 0; k < 10; ++k) {
    const RobotState state = random_state(model_, random_);
    const Eigen::VectorXd u = generalised_velocity(state);
    Eigen::MatrixXd M(u.size(), u.size());
    mass_matrix(model_, state, M);
    EXPECT_NEAR(0.5 * u.dot(M * u), kinetic_energy(model_, state), kAlgebra);
  }
}

TEST_P(DynamicsLaws, GravityForcesAreTheGradientOfThePotential) {
  RobotState state = random_state(model_, random_);
  state.v_WB.setZero();
  state.w_WB_B.setZero();
  state.v.setZero();
  Eigen::VectorXd bias(6 + model_.dof());
  bias_forces(model_, state, bias);
  constexpr double kStep = 1e-5;  // error of the quotient: h^2 and energy * epsilon / h, both below 1e-7
  for (int k = 0; k < bias.size(); ++k) {
    const Eigen::VectorXd u = Eigen::VectorXd::Unit(bias.size(), k);
    const double slope = (potential_energy(model_, test::moved(state, u, kStep)) -
                          potential_energy(model_, test::moved(state, u, -kStep))) /
                         (2.0 * kStep);
    EXPECT_NEAR(bias[k], slope, 1e-6) << "coordinate " << k;
  }
}

// The work of the generalised forces is the gain of energy: u . tau = d(T + V)/dt along the motion with acceleration a.
TEST_P(DynamicsLaws, PowerBalances) {
  for (int k = 0; k < 5; ++k) {
    const RobotState state = random_state(model_, random_);
    const Eigen::VectorXd u = generalised_velocity(state), a = random_acceleration(model_, random_);
    Eigen::VectorXd tau(u.size());
    inverse_dynamics(model_, state, a, tau);
    const auto energy = [&](double h) {
      RobotState later = test::moved(state, u + 0.5 * h * a, h);
      later.v_WB += h * a.head<3>();
      later.w_WB_B += h * a.segment<3>(3);
      later.v += h * a.tail(model_.dof());
      return kinetic_energy(model_, later) + potential_energy(model_, later);
    };
    constexpr double kStep = 1e-5;
    const double gain = (energy(kStep) - energy(-kStep)) / (2.0 * kStep);
    EXPECT_NEAR(u.dot(tau), gain, 1e-6 * (1.0 + std::abs(gain)));
  }
}

TEST_P(DynamicsLaws, WorkspaceGivesWhatTheFunctionsGive) {
  const RobotState state = random_state(model_, random_);
  const Eigen::VectorXd a = random_acceleration(model_, random_);
  Dynamics dynamics(model_);
  Eigen::VectorXd one(a.size()), two(a.size());
  dynamics.bias_forces(random_state(model_, random_), one);  // leaves nothing behind
  dynamics.inverse_dynamics(state, a, one);
  inverse_dynamics(model_, state, a, two);
  EXPECT_EQ(one, two);
  dynamics.bias_forces(state, one);
  bias_forces(model_, state, two);
  EXPECT_EQ(one, two);
  EXPECT_EQ(dynamics.kinematics().p_WL(0), state.X_WB.p);
}

INSTANTIATE_TEST_SUITE_P(Robots, DynamicsLaws, testing::Values(0, 1),
                         [](const testing::TestParamInfo<int>& info) { return info.param == 0 ? "G1" : "SkewAxis"; });

TEST(Dynamics, TotalWeightAtRest) {
  const RobotState state = g1().standing_state();
  Eigen::VectorXd bias(35);
  bias_forces(g1(), state, bias);
  EXPECT_NEAR(bias[0], 0.0, kAlgebra);
  EXPECT_NEAR(bias[1], 0.0, kAlgebra);
  EXPECT_NEAR(bias[2], g1().total_mass() * kGravity, kAlgebra);
}

TEST(Dynamics, FreeFallNeedsNoForce) {
  Random random(12, 1);
  RobotState state = random_state(g1(), random);
  state.w_WB_B.setZero();
  state.v.setZero();
  Eigen::VectorXd a = Eigen::VectorXd::Zero(35), tau(35);
  a[2] = -kGravity;
  inverse_dynamics(g1(), state, a, tau);
  EXPECT_LT(tau.cwiseAbs().maxCoeff(), kAlgebra);
}

TEST(Dynamics, NothingActsAtRestWithoutGravity) {
  Random random(13, 1);
  RobotState state = random_state(g1(), random);
  state.w_WB_B.setZero();
  state.v.setZero();
  Eigen::VectorXd bias(35);
  Dynamics(g1(), Eigen::Vector3d::Zero()).bias_forces(state, bias);
  EXPECT_EQ(bias.cwiseAbs().maxCoeff(), 0.0);  // uniform motion costs nothing
}

// A rigid body spinning without torque obeys Euler's equations: with the joints held, the base's moment is w x I w.
TEST(Dynamics, SpinningRigidRobotObeysEulersEquations) {
  RobotState state = g1().standing_state();
  state.w_WB_B = {0.3, -1.2, 2.0};
  Eigen::VectorXd bias(35);
  Eigen::MatrixXd M(35, 35);
  Dynamics dynamics(g1(), Eigen::Vector3d::Zero());
  dynamics.bias_forces(state, bias);
  dynamics.mass_matrix(state, M);
  const Eigen::Matrix3d I_B = M.block<3, 3>(3, 3);  // about the base's origin
  EXPECT_LT((bias.segment<3>(3) - state.w_WB_B.cross(I_B * state.w_WB_B)).norm(), kAlgebra);
}

TEST(Dynamics, PendulumMatchesTheClosedForm) {
  const RobotModel model = test::load_small();
  RobotState state;
  state.q = Eigen::Vector2d(0.7, -0.4);
  state.v = Eigen::Vector2d::Zero();
  Eigen::MatrixXd M(8, 8);
  mass_matrix(model, state, M);
  // The last link about its hinge: I_axis + m d^2 + armature; its axis (1, 1, 0) / sqrt 2 is at right angles to the
  // centre of mass at (0, 0, -0.1).
  EXPECT_NEAR(M(7, 7), 0.001 + 0.5 * 0.01 + 0.02, 1e-15);
}

TEST(Dynamics, WorkspaceAllocatesNothing) {
  if (!test::counts_allocations()) GTEST_SKIP() << "not run: the sanitizer owns malloc";
  Random random(14, 1);
  const RobotState state = random_state(g1(), random);
  const Eigen::VectorXd a = random_acceleration(g1(), random);
  Dynamics dynamics(g1());
  Eigen::VectorXd tau(35);
  Eigen::MatrixXd M(35, 35);
  const long before = test::allocations();
  dynamics.bias_forces(state, tau);
  dynamics.inverse_dynamics(state, a, tau);
  dynamics.mass_matrix(state, M);
  EXPECT_EQ(test::allocations() - before, 0);
}

TEST(AllocationCounter, Counts) {
  if (!test::counts_allocations()) GTEST_SKIP() << "not run: the sanitizer owns malloc";
  const long before = test::allocations();
  const Eigen::VectorXd vector = Eigen::VectorXd::Constant(100, 1.0);
  EXPECT_GT(test::allocations() - before, 0);
  EXPECT_EQ(vector.sum(), 100.0);
}

// The factor of a humanoid's mass matrix against a dense one.

struct Humanoid {
  RobotModel robot = load_robot(default_card_path());
  int n = 6 + robot.dof();
  Eigen::VectorXd inertia = Eigen::VectorXd::LinSpaced(robot.dof(), 0.01, 0.3);
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(n, n);
  TreeFactor factor{robot};
  Humanoid() {
    Dynamics dynamics(robot);
    dynamics.update(robot.standing_state());
    mass = dynamics.mass();
    EXPECT_TRUE(factor.compute(mass, inertia));
  }
  [[nodiscard]] Eigen::MatrixXd dense_solution(const Eigen::MatrixXd& right) const {
    Eigen::MatrixXd H = mass;
    H.diagonal().tail(robot.dof()) += inertia;
    return H.llt().solve(right);
  }
};

constexpr double kRounding = 1e-9;  // of responses of about 1, condition 1e4

TEST(TreeFactor, SolvesAsADenseFactorDoes) {
  const Humanoid humanoid;
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(humanoid.n, humanoid.n);
  const Eigen::MatrixXd expected = humanoid.dense_solution(identity);
  for (int i = 0; i < humanoid.n; ++i) {
    Eigen::VectorXd column = identity.col(i);
    humanoid.factor.solve(column);
    EXPECT_LT((column - expected.col(i)).cwiseAbs().maxCoeff(), kRounding * expected.cwiseAbs().maxCoeff());
  }
}

TEST(TreeFactor, SolvesThreeColumnsWithFewEntriesAsDenseOnes) {
  const Humanoid humanoid;
  std::vector<int> rows;
  TreeFactor::Triple columns = TreeFactor::Triple::Zero(humanoid.n, 3);
  const int link = humanoid.robot.shapes[humanoid.robot.feet[0]].link;
  for (int k = link; k > 0; k = humanoid.robot.links[k].parent) rows.push_back(5 + k);
  for (int k = 5; k >= 0; --k) rows.push_back(k);
  for (const int row : rows) columns.row(row) << 1.0 + row, -0.5 * row, 2.0;
  const Eigen::MatrixXd expected = humanoid.dense_solution(columns);
  humanoid.factor.solve(rows, columns);
  EXPECT_LT((columns - expected).cwiseAbs().maxCoeff(), kRounding * expected.cwiseAbs().maxCoeff());
}

TEST(TreeFactor, RefusesWhatIsNotPositiveDefinite) {
  Humanoid humanoid;
  humanoid.mass(7, 7) = -1.0;
  EXPECT_FALSE(humanoid.factor.compute(humanoid.mass, humanoid.inertia));
}

JointGains no_gains(const RobotModel& robot) {
  return {Eigen::VectorXd::Zero(robot.dof()), Eigen::VectorXd::Zero(robot.dof())};
}

JointGains card_gains(const RobotModel& robot) {
  JointGains gains = no_gains(robot);
  for (int j = 0; j < robot.dof(); ++j) {
    gains.kp[j] = robot.joints[j].kp;
    gains.kd[j] = robot.joints[j].kd;
  }
  return gains;
}

RobotModel bare(RobotModel robot) {
  for (RobotJoint& joint : robot.joints) joint.armature = 0.0;
  return robot;
}

int joint_named(const RobotModel& robot, const std::string& name) {
  const auto found = std::ranges::find(robot.joints, name, &RobotJoint::name);
  return static_cast<int>(found - robot.joints.begin());
}

// Largest speed after a fine nudge and `steps` steps of the linearised explicit law.
double speed_after(const RobotModel& robot, const JointGains& gains, double dt, int steps) {
  Eigen::MatrixXd mass(6 + robot.dof(), 6 + robot.dof());
  mass_matrix(robot, robot.standing_state(), mass);
  const Eigen::MatrixXd W = mass.inverse().bottomRightCorner(robot.dof(), robot.dof());
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof()), v = Eigen::VectorXd::Constant(robot.dof(), 1e-3);
  for (int i = 0; i < steps; ++i) {
    v -= dt * (W * (gains.kp.cwiseProduct(q) + gains.kd.cwiseProduct(v)));
    q += dt * v;
  }
  return v.cwiseAbs().maxCoeff();
}

TEST(ExplicitStep, IsWhereTheLinearisedRobotBeginsToShake) {
  for (const bool armature : {true, false}) {
    const RobotModel robot = armature ? g1() : bare(g1());
    const JointGains gains = card_gains(robot);
    const double largest = largest_explicit_step(robot, robot.standing_state(), gains).largest;
    EXPECT_LT(speed_after(robot, gains, 0.98 * largest, 4000), 1e-2) << armature;
    EXPECT_GT(speed_after(robot, gains, 1.02 * largest, 4000), 1e3) << armature;
  }
}

// Steps of the damping alone with the card's kd, as they were found by hand in the standing pose [ms].
TEST(ExplicitStep, OfTheG1AreThoseOfItsSmallestInertias) {
  struct Known {
    const char* joint;
    double bare, with_armature;
  };
  const RobotModel heavy = g1(), light = bare(g1());
  for (const Known& known : {Known{"left_ankle_roll_joint", 0.32, 7.5}, Known{"left_wrist_roll_joint", 0.63, 7.9},
                             Known{"left_wrist_yaw_joint", 2.1, 11.0}, Known{"left_ankle_pitch_joint", 2.3, 9.6},
                             Known{"left_wrist_pitch_joint", 2.8, 12.0}}) {
    const int joint = joint_named(heavy, known.joint);
    JointGains gains = no_gains(heavy);
    gains.kd[joint] = heavy.joints[joint].kd;
    const auto step = [&](const RobotModel& robot) {
      return 1e3 * largest_explicit_step_of(robot, robot.standing_state(), gains, joint);
    };
    EXPECT_NEAR(step(light), known.bare, 0.04 * known.bare) << known.joint;
    EXPECT_NEAR(step(heavy), known.with_armature, 0.04 * known.with_armature) << known.joint;
    // One joint alone: the whole robot's bound is that joint's.
    const ExplicitStep whole = largest_explicit_step(light, light.standing_state(), gains);
    EXPECT_NEAR(1e3 * whole.largest, step(light), 1e-9);
    EXPECT_EQ(whole.joint, joint);
  }
}

TEST(GainsForExplicitStep, LowerOnlyWhatWouldShake) {
  const RobotModel robot = g1();
  const JointGains asked = card_gains(robot), gains = gains_for_explicit_step(robot, asked, 0.001);
  EXPECT_EQ(gains.kp, asked.kp);
  EXPECT_GE(largest_explicit_step(bare(robot), robot.standing_state(), gains).largest, 0.002);
  for (int j = 0; j < robot.dof(); ++j) {
    const bool shakes = robot.joints[j].name.find("ankle_roll") != std::string::npos ||
                        robot.joints[j].name.find("wrist_roll") != std::string::npos;
    if (shakes)
      EXPECT_LT(gains.kd[j], 0.5 * asked.kd[j]) << robot.joints[j].name;
    else
      EXPECT_GE(gains.kd[j], 0.6 * asked.kd[j]) << robot.joints[j].name;
    EXPECT_EQ(gains.kd[j], gains.kd[robot.roles.counterpart[j]]);
  }
  EXPECT_EQ(gains_for_explicit_step(robot, asked, 1e-5).kd, asked.kd);
}

TEST(GainsForExplicitStep, RefuseAStiffnessThatNoDampingHolds) {
  const RobotModel robot = g1();
  const auto said = [&](double step) {
    return test::thrown_message<std::invalid_argument>(
        [&] { gains_for_explicit_step(robot, card_gains(robot), step); });
  };
  EXPECT_THAT(said(0.02), ::testing::HasSubstr("which no damping makes hold at 20 ms"));
  EXPECT_THAT(said(0.0), ::testing::HasSubstr("expected a step above 0 s, found 0"));
}

TEST(ExplicitStep, NoGainsShakeNothingAndOthersRobotsAreRefused) {
  const RobotModel& robot = g1();
  const ExplicitStep none = largest_explicit_step(robot, robot.standing_state(), no_gains(robot));
  EXPECT_EQ(none.largest, std::numeric_limits<double>::infinity());
  EXPECT_EQ(none.joint, -1);
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] {
                largest_explicit_step(robot, robot.standing_state(), {Eigen::VectorXd(3), {}});
              }),
              ::testing::HasSubstr("found 3 and 0"));
}

}  // namespace
}  // namespace duet
