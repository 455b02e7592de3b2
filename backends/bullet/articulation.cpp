#include "duet/backends/bullet/articulation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

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

}  // namespace duet
