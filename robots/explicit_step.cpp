#include "duet/robots/explicit_step.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/core/require.h"
#include "duet/robots/dynamics.h"

namespace duet {
namespace {

using SymmetricSolver = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;

constexpr double kLessDamping = 0.95;   // of a joint that oscillates
constexpr double kLeastDamping = 0.01;  // of what was asked for
constexpr int kHalvings = 50;           // of the bracket of the step: to the last bits of a double

Eigen::MatrixXd joint_mobility(const RobotModel& robot, const RobotState& pose) {
  Eigen::MatrixXd mass(6 + robot.dof(), 6 + robot.dof());
  mass_matrix(robot, pose, mass);
  const Eigen::MatrixXd inverse = mass.llt().solve(Eigen::MatrixXd::Identity(mass.rows(), mass.cols()));
  return inverse.bottomRightCorner(robot.dof(), robot.dof());
}

// S W S, S^2 = (2 dt D + dt^2 K) / 4: the law shakes where its largest eigenvalue passes 1.
Eigen::MatrixXd shaken(const Eigen::MatrixXd& W, const JointGains& gains, double dt) {
  const Eigen::VectorXd S = (0.5 * dt * gains.kd + 0.25 * dt * dt * gains.kp).cwiseSqrt();
  return S.asDiagonal() * W * S.asDiagonal();
}

// 2 dt kd + dt^2 kp = 4 I; infinite without gains.
double single_joint_step(double kp, double kd, double inertia) {
  return 4.0 * inertia / (kd + std::sqrt(kd * kd + 4.0 * inertia * kp));
}

void check_gains(const RobotModel& robot, const JointGains& gains) {
  require(gains.kp.size() == robot.dof() && gains.kd.size() == robot.dof(),
          "explicit step: expected gains of the {} joints of {}, found {} and {}", robot.dof(), robot.name,
          gains.kp.size(), gains.kd.size());
}

}  // namespace

ExplicitStep largest_explicit_step(const RobotModel& robot, const RobotState& pose, const JointGains& gains) {
  check_gains(robot, gains);
  const Eigen::MatrixXd W = joint_mobility(robot, pose);
  ExplicitStep found{.largest = std::numeric_limits<double>::infinity(), .joint = -1};
  for (int j = 0; j < robot.dof(); ++j)
    found.largest = std::min(found.largest, single_joint_step(gains.kp[j], gains.kd[j], 1.0 / W(j, j)));
  if (!std::isfinite(found.largest)) return found;
  double low = 0.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + found.largest);
    const SymmetricSolver solver(shaken(W, gains, middle), Eigen::EigenvaluesOnly);
    (solver.eigenvalues().tail<1>()[0] < 1.0 ? low : found.largest) = middle;
  }
  SymmetricSolver(shaken(W, gains, found.largest)).eigenvectors().rightCols<1>().cwiseAbs().maxCoeff(&found.joint);
  if (!robot.roles.counterpart.empty()) found.joint = std::min(found.joint, robot.roles.counterpart[found.joint]);
  return found;
}

double largest_explicit_step_of(const RobotModel& robot, const RobotState& pose, const JointGains& gains, int joint) {
  check_gains(robot, gains);
  return single_joint_step(gains.kp[joint], gains.kd[joint], 1.0 / joint_mobility(robot, pose)(joint, joint));
}

JointGains gains_for_explicit_step(RobotModel robot, JointGains gains, double step) {
  require(step > 0.0 && std::isfinite(step), "explicit step: expected a step above 0 s, found {:g}", step);
  check_gains(robot, gains);
  for (RobotJoint& joint : robot.joints) joint.armature = 0.0;
  const Eigen::MatrixXd W = joint_mobility(robot, robot.standing_state());
  const Eigen::VectorXd asked = gains.kd;
  while (true) {
    const SymmetricSolver solver(shaken(W, gains, 2.0 * step));
    if (solver.eigenvalues().tail<1>()[0] <= 1.0) return gains;
    int joint = 0;
    solver.eigenvectors().rightCols<1>().cwiseAbs().maxCoeff(&joint);
    require(gains.kd[joint] > kLeastDamping * asked[joint],
            "explicit step: {} of {} has a kp of {:g} N m/rad, which no damping makes hold at {:g} ms",
            robot.joints[joint].name, robot.name, gains.kp[joint], 1e3 * step);
    const int other = robot.roles.counterpart.empty() ? joint : robot.roles.counterpart[joint];
    gains.kd[joint] *= kLessDamping;
    if (other != joint) gains.kd[other] *= kLessDamping;
  }
}

}  // namespace duet
