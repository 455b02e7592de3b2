#include "duet/backends/bullet/articulation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <functional>

namespace duet {
namespace {

constexpr double kFastest = 1e6;  // Bullet clamps velocities here; the backend gives up far below

btVector3 to_bullet(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
btQuaternion to_bullet(const Eigen::Quaterniond& q) { return {q.x(), q.y(), q.z(), q.w()}; }
Eigen::Vector3d from_bullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Quaterniond from_bullet(const btQuaternion& q) { return {q.w(), q.x(), q.y(), q.z()}; }

struct Principal {
  Eigen::Matrix3d R_LP;  // right-handed
  Eigen::Vector3d moments;
};

Principal principal_axes(const RobotLink& link) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(link.inertia);
  Principal principal{solver.eigenvectors(), solver.eigenvalues()};
  if (principal.R_LP.determinant() < 0.0) principal.R_LP.col(0) *= -1.0;
  return principal;
}

std::unique_ptr<btMultiBody> make_body(const RobotModel& robot) {
  std::vector<Principal> principal;
  for (const RobotLink& link : robot.links) principal.push_back(principal_axes(link));
  const bool fixed_base = false, can_sleep = false, ignore_parent = true;
  auto body = std::make_unique<btMultiBody>(robot.dof(), robot.links[0].mass, to_bullet(principal[0].moments),
                                            fixed_base, can_sleep);
  for (int i = 1; i <= robot.dof(); ++i) {
    const RobotLink& link = robot.links[i];
    const Eigen::Matrix3d& R_PL_axes = principal[link.parent].R_LP;
    const Eigen::Matrix3d R_ip = (R_PL_axes.transpose() * link.X_PL.R * principal[i].R_LP).transpose();
    const Eigen::Vector3d axis = principal[i].R_LP.transpose() * link.axis;
    const Eigen::Vector3d pivot = R_PL_axes.transpose() * (link.X_PL.p - robot.links[link.parent].com);
    const Eigen::Vector3d com = principal[i].R_LP.transpose() * link.com;
    body->setupRevolute(i - 1, link.mass, to_bullet(principal[i].moments), link.parent - 1,
                        to_bullet(Eigen::Quaterniond(R_ip)), to_bullet(axis), to_bullet(pivot), to_bullet(com),
                        ignore_parent);
  }
  body->finalizeMultiDof();
  body->setLinearDamping(0.0);  // 0.04 by default
  body->setAngularDamping(0.0);
  body->setMaxCoordinateVelocity(kFastest);
  return body;
}

}  // namespace

Articulation::Articulation(const Scene& scene)
    : robot_(scene.robot),
      gravity_(to_bullet(Eigen::Vector3d(scene.gravity))),
      R_BP_(principal_axes(robot_->links[0]).R_LP),
      body_(make_body(*robot_)) {
  // Once, so that Bullet's buffers have their size.
  accelerate(Eigen::VectorXd::Zero(size()), Eigen::Matrix3d::Identity(), scene.dt);
}

void Articulation::set_velocity(const Eigen::VectorXd& velocity) {
  body_->setBaseOmega({velocity[0], velocity[1], velocity[2]});
  body_->setBaseVel({velocity[3], velocity[4], velocity[5]});
  for (int i = 0; i < robot_->dof(); ++i) body_->setJointVel(i, velocity[6 + i]);
}

void Articulation::write(const RobotState& state) {
  const Eigen::Vector3d r = state.X_WB.R * robot_->links[0].com, w = state.X_WB.R * state.w_WB_B;
  body_->setBasePos(to_bullet(Eigen::Vector3d(state.X_WB.p + r)));
  body_->setWorldToBaseRot(to_bullet((state.X_WB.R * R_BP_).conjugate()));
  body_->setBaseOmega(to_bullet(w));
  body_->setBaseVel(to_bullet(Eigen::Vector3d(state.v_WB + w.cross(r))));
  for (int i = 0; i < robot_->dof(); ++i) {
    body_->setJointPos(i, state.q[i]);
    body_->setJointVel(i, state.v[i]);
  }
}

void Articulation::kick(const Eigen::Vector3d& dv_W) { body_->setBaseVel(body_->getBaseVel() + to_bullet(dv_W)); }

void Articulation::read(RobotState& state) const {
  state.X_WB.R = (from_bullet(body_->getWorldToBaseRot()).conjugate() * R_BP_.conjugate()).normalized();
  const Eigen::Vector3d r = state.X_WB.R * robot_->links[0].com, w = from_bullet(body_->getBaseOmega());
  state.X_WB.p = from_bullet(body_->getBasePos()) - r;
  state.w_WB_B = state.X_WB.R.conjugate() * w;
  state.v_WB = from_bullet(body_->getBaseVel()) - w.cross(r);
  for (int i = 0; i < robot_->dof(); ++i) {
    state.q[i] = body_->getJointPos(i);
    state.v[i] = body_->getJointVel(i);
  }
}

void Articulation::accelerate(const Eigen::VectorXd& Q, const Eigen::Matrix3d& R_WB, double dt) {
  const Eigen::Vector3d force = Q.head<3>(), r = R_WB * robot_->links[0].com;
  body_->clearForcesAndTorques();
  body_->addBaseForce(to_bullet(force) + robot_->links[0].mass * gravity_);
  body_->addBaseTorque(to_bullet(Eigen::Vector3d(R_WB * Q.segment<3>(3) - r.cross(force))));
  for (int i = 0; i < robot_->dof(); ++i) {
    body_->addLinkForce(i, robot_->links[i + 1].mass * gravity_);
    body_->addJointTorque(i, Q[6 + i]);
  }
  const bool constraint_pass = false, feedback_in_world = false, feedback_in_joint = false;
  body_->computeAccelerationsArticulatedBodyAlgorithmMultiDof(dt, scratch_r_, scratch_v_, scratch_m_, constraint_pass,
                                                              feedback_in_world, feedback_in_joint);
}

void Articulation::append_to(std::vector<double>& values) const {
  const btVector3& p = body_->getBasePos();
  const btQuaternion& R = body_->getWorldToBaseRot();
  values.insert(values.end(), {p.x(), p.y(), p.z(), R.x(), R.y(), R.z(), R.w()});
  values.insert(values.end(), body_->getVelocityVector(), body_->getVelocityVector() + size());
  for (int i = 0; i < robot_->dof(); ++i) values.push_back(body_->getJointPos(i));
}

void Articulation::read_from(std::span<const double> values) {
  body_->setBasePos({values[0], values[1], values[2]});
  body_->setWorldToBaseRot({values[3], values[4], values[5], values[6]});
  set_velocity(Eigen::Map<const Eigen::VectorXd>(values.data() + 7, size()));
  for (int i = 0; i < robot_->dof(); ++i) body_->setJointPos(i, values[7 + size() + i]);
}

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
