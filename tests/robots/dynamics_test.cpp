#include "duet/robots/dynamics.h"

#include <Eigen/Cholesky>

#include "tests/robots/allocations.h"
#include "tests/robots/fixtures.h"

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

}  // namespace
}  // namespace duet
