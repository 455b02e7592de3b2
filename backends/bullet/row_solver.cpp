#include "duet/backends/bullet/row_solver.h"

#include <algorithm>
#include <functional>

namespace duet {
namespace {

constexpr double kNear = 0.01;      // stops that the step without contacts leaves nearer than this get a row [rad]
constexpr double kSoftest = 1e-12;  // of the sum h K + D of a skin [N s/m]
constexpr double kRigid = 1e-12;    // no impulse moves a row less compliant than this; Bullet leaves it out [1/kg]
constexpr double kNoLimit = 1e10;   // impulse [N s]

// Joints of one or two chains towards the base: falling, each once, then the base.
void close_support(std::vector<int>& support) {
  std::sort(support.begin(), support.end(), std::greater<>());
  support.erase(std::unique(support.begin(), support.end()), support.end());
  for (int i = 5; i >= 0; --i) support.push_back(i);
}

// One step size for the two friction rows of a contact, or friction would not oppose the slip.
void share_step(btMultiBodySolverConstraint& a, btMultiBodySolverConstraint& b) {
  const double step = std::min(a.m_jacDiagABInv, b.m_jacDiagABInv);
  if (step == 0.0) return;
  for (btMultiBodySolverConstraint* row : {&a, &b}) {
    row->m_rhs *= step / row->m_jacDiagABInv;
    row->m_jacDiagABInv = step;
  }
}

}  // namespace

RowSolver::RowSolver(const Scene& scene, const RowSettings& settings, std::size_t contacts)
    : robot_(scene.robot), settings_(settings), dt_(scene.dt), contacts_(contacts) {
  const int n = 6 + robot_->dof(), stops = robot_->dof(), rows = 3 * static_cast<int>(contacts) + stops;
  row_ = Eigen::VectorXd::Zero(n);
  response_ = Eigen::VectorXd::Zero(n);
  responses_ = Triple::Zero(n, 3);
  for (ContactRows& contact : contacts_) {
    contact.support.reserve(n);
    contact.J = Triple::Zero(n, 3);
  }
  m_multiBodyNonContactConstraints.reserve(stops);
  m_multiBodyNormalContactConstraints.reserve(static_cast<int>(contacts));
  m_multiBodyFrictionContactConstraints.reserve(2 * static_cast<int>(contacts));
  m_data.m_jacobians.reserve(rows * n);
  m_data.m_deltaVelocitiesUnitImpulse.reserve(rows * n);
  m_data.m_deltaVelocities.reserve(n);
  info_.m_timeStep = dt_;
  info_.m_numIterations = settings_.iterations;
  info_.m_splitImpulse = 0;
  info_.m_solverMode = SOLVER_USE_2_FRICTION_DIRECTIONS;  // the two rows of a contact are limited by a cone
  // Once, so that Bullet's own buffers have their size.
  m_tmpMultiBodyConstraints = nullptr;
  m_tmpNumMultiBodyConstraints = 0;
  btMultiBodyConstraintSolver::solveGroupCacheFriendlySetup(nullptr, 0, nullptr, 0, nullptr, 0, info_, nullptr);
}

void RowSolver::set_contacts(std::span<const ContactPoint> points, const Kinematics& kinematics) {
  used_ = 0;
  for (const ContactPoint& point : points) {
    ContactRows& rows = contacts_[used_++];
    const Eigen::Vector3d tangent = point.n_W.unitOrthogonal();
    rows.axes_W << point.n_W, tangent, point.n_W.cross(tangent);
    rows.J.setZero();
    rows.support.clear();
    add_link(rows, point.link, 1.0, point.p_W, kinematics);
    if (point.side == ContactSide::kRobot) add_link(rows, point.other, -1.0, point.p_W, kinematics);
    close_support(rows.support);
    rows.friction = point.friction;
    rows.v_target = rows.axes_W.transpose() * point.v_other_W;
    if (point.side == ContactSide::kHuman) {
      const double softness = std::max(dt_ * point.skin.stiffness + point.skin.damping, kSoftest);
      rows.cfm = 1.0 / (dt_ * softness);
      rows.v_target[0] += point.skin.stiffness * point.depth / softness;
    } else {
      const double depth = point.depth - settings_.slop;
      rows.cfm = 0.0;
      rows.v_target[0] += depth > 0.0 ? std::min(settings_.erp * depth / dt_, settings_.push_out) : depth / dt_;
    }
  }
}

void RowSolver::add_link(ContactRows& rows, int link, double sign, const Eigen::Vector3d& p_W,
                         const Kinematics& kinematics) const {
  const Eigen::Matrix3d axes = sign * rows.axes_W;
  const Eigen::Vector3d arm = p_W - kinematics.p_WL(0);
  rows.J.topRows<3>() += axes;
  for (int i = 0; i < 3; ++i)
    rows.J.block<3, 1>(3, i) += kinematics.R_WL(0).transpose() * arm.cross(Eigen::Vector3d(axes.col(i)));
  for (int k = link; k > 0; k = robot_->links[k].parent) {
    const Eigen::Vector3d hinge = kinematics.R_WL(k) * robot_->links[k].axis;
    rows.J.row(5 + k) += hinge.cross(p_W - kinematics.p_WL(k)).transpose() * axes;
    rows.support.push_back(5 + k);
  }
}

void RowSolver::solve(Articulation& articulation, const TreeFactor& factor, const Kinematics& kinematics,
                      const Eigen::VectorXd& q) {
  articulation_ = &articulation;
  factor_ = &factor;
  q_ = &q;
  R_WB_ = kinematics.R_WL(0);
  r_W_ = R_WB_ * robot_->links[0].com;
  solveMultiBodyGroup(nullptr, 0, nullptr, 0, nullptr, 0, nullptr, 0, info_, nullptr, nullptr);
  articulation.body().processDeltaVeeMultiDof2();
}

btScalar RowSolver::solveGroupCacheFriendlySetup(btCollisionObject** bodies, int bodies_size,
                                                 btPersistentManifold** manifolds, int manifolds_size,
                                                 btTypedConstraint** constraints, int constraints_size,
                                                 const btContactSolverInfo& info, btIDebugDraw* draw) {
  const btScalar residual = btMultiBodyConstraintSolver::solveGroupCacheFriendlySetup(
      bodies, bodies_size, manifolds, manifolds_size, constraints, constraints_size, info, draw);
  m_data.m_deltaVelocities.resize(articulation_->size(), 0.0);
  add_stops();
  for (std::size_t i = 0; i < used_; ++i) add_contact(contacts_[i]);
  return residual;
}

void RowSolver::add_stops() {
  const Eigen::Map<const Eigen::VectorXd> v = std::as_const(*articulation_).velocity();
  for (int i = 0; i < robot_->dof(); ++i) {
    const RobotJoint& joint = robot_->joints[i];
    const bool lower = (*q_)[i] + dt_ * v[6 + i] < 0.5 * (joint.lower + joint.upper);
    const double side = lower ? 1.0 : -1.0, gap = lower ? (*q_)[i] - joint.lower : joint.upper - (*q_)[i];
    if (gap + dt_ * side * v[6 + i] > kNear) continue;
    row_.setZero();
    row_[6 + i] = side;
    response_ = row_;
    factor_->solve(response_);
    btMultiBodySolverConstraint& row =
        add_row(m_multiBodyNonContactConstraints, 0.0, -(gap < 0.0 ? settings_.stop_erp : 1.0) * gap / dt_);
    row.m_upperLimit = kNoLimit;
  }
}

void RowSolver::add_contact(const ContactRows& contact) {
  responses_ = contact.J;
  factor_->solve(contact.support, responses_);
  const int normal_at = m_multiBodyNormalContactConstraints.size(),
            friction_at = m_multiBodyFrictionContactConstraints.size();
  for (int i = 0; i < 3; ++i) {
    row_ = contact.J.col(i);
    response_ = responses_.col(i);
    btMultiBodySolverConstraint& row =
        add_row(i == 0 ? m_multiBodyNormalContactConstraints : m_multiBodyFrictionContactConstraints,
                i == 0 ? contact.cfm : 0.0, contact.v_target[i]);
    row.m_frictionIndex = i == 0 ? friction_at : normal_at;
    row.m_friction = contact.friction;
    if (i == 0) row.m_upperLimit = kNoLimit;
  }
  share_step(m_multiBodyFrictionContactConstraints[friction_at],
             m_multiBodyFrictionContactConstraints[friction_at + 1]);
}

btMultiBodySolverConstraint& RowSolver::add_row(btMultiBodyConstraintArray& rows, double cfm, double v_target) {
  const int n = static_cast<int>(row_.size()), at = m_data.m_jacobians.size();
  const double compliance = row_.dot(response_) + cfm;
  const double inverse = compliance > kRigid ? 1.0 / compliance : 0.0;

  m_data.m_jacobians.resize(at + n);
  m_data.m_deltaVelocitiesUnitImpulse.resize(at + n);
  Eigen::Map<Eigen::VectorXd> jacobian(&m_data.m_jacobians[at], n), unit(&m_data.m_deltaVelocitiesUnitImpulse[at], n);
  const Eigen::Vector3d force = row_.head<3>(), spin = R_WB_ * response_.segment<3>(3);
  jacobian << R_WB_ * row_.segment<3>(3) - r_W_.cross(force), force, row_.tail(n - 6);
  unit << spin, response_.head<3>() + spin.cross(r_W_), response_.tail(n - 6);

  btMultiBodySolverConstraint& row = rows.expand(btMultiBodySolverConstraint());
  row.m_multiBodyA = &articulation_->body();
  row.m_deltaVelAindex = 0;
  row.m_jacAindex = at;
  row.m_jacDiagABInv = inverse;
  row.m_rhs = (v_target - jacobian.dot(std::as_const(*articulation_).velocity())) * inverse;
  row.m_rhsPenetration = 0.0;
  row.m_cfm = cfm * inverse;
  row.m_lowerLimit = 0.0;
  row.m_upperLimit = 0.0;
  row.m_appliedImpulse = 0.0;
  row.m_appliedPushImpulse = 0.0;
  return row;
}

Eigen::Vector3d RowSolver::contact_force(std::size_t i) const {
  const btMultiBodySolverConstraint& normal = m_multiBodyNormalContactConstraints[static_cast<int>(i)];
  const btMultiBodySolverConstraint* friction = &m_multiBodyFrictionContactConstraints[normal.m_frictionIndex];
  const Eigen::Vector3d impulse(normal.m_appliedImpulse, friction[0].m_appliedImpulse, friction[1].m_appliedImpulse);
  return contacts_[i].axes_W * impulse / dt_;
}

}  // namespace duet
