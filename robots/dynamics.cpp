#include "duet/robots/dynamics.h"

#include <Eigen/Geometry>
#include <cmath>

// An Eigen::Ref that is written to is passed by value, as Eigen's guide has it.
// NOLINTBEGIN(performance-unnecessary-value-param)

namespace duet {
namespace {

Eigen::Matrix3d shifted_inertia(double mass, const Eigen::Vector3d& d) {
  return mass * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
}

}  // namespace

Dynamics::Dynamics(const RobotModel& model, const Eigen::Vector3d& gravity_W)
    : model_(&model),
      gravity_(gravity_W),
      kinematics_(model),
      bodies_(model.links.size()),
      zero_(Eigen::VectorXd::Zero(6 + model.dof())),
      bias_(zero_),
      mass_(Eigen::MatrixXd::Zero(6 + model.dof(), 6 + model.dof())) {}

void Dynamics::update(const RobotState& state) {
  newton_euler(state, zero_, bias_);
  accumulate_composites();
  project_composites(mass_);
}

void Dynamics::bias_forces(const RobotState& state, Eigen::Ref<Eigen::VectorXd> out) {
  newton_euler(state, zero_, out);
}

void Dynamics::inverse_dynamics(const RobotState& state, const Eigen::Ref<const Eigen::VectorXd>& a,
                                Eigen::Ref<Eigen::VectorXd> out) {
  newton_euler(state, a, out);
  for (int j = 0; j < model_->dof(); ++j) out[6 + j] += model_->joints[j].armature * a[6 + j];
}

void Dynamics::newton_euler(const RobotState& state, const Eigen::Ref<const Eigen::VectorXd>& a,
                            Eigen::Ref<Eigen::VectorXd> out) {
  kinematics_.update(state.X_WB, state.q);
  const int n = static_cast<int>(bodies_.size());
  for (int i = 0; i < n; ++i) {
    const RobotLink& link = model_->links[i];
    const Eigen::Matrix3d& R = kinematics_.R_WL(i);
    Body& body = bodies_[i];
    if (i == 0) {
      body.w.noalias() = R * state.w_WB_B;
      body.dw.noalias() = R * a.segment<3>(3);
      body.a = a.head<3>() - gravity_;
    } else {
      const Body& parent = bodies_[link.parent];
      const Eigen::Vector3d r = kinematics_.p_WL(i) - kinematics_.p_WL(link.parent);
      body.axis.noalias() = R * link.axis;
      const Eigen::Vector3d spin = state.v[i - 1] * body.axis;
      body.w = parent.w + spin;
      body.dw = parent.dw + a[5 + i] * body.axis + parent.w.cross(spin);
      body.a = parent.a + parent.dw.cross(r) + parent.w.cross(parent.w.cross(r));
    }
    const Eigen::Vector3d c = R * link.com;
    const Eigen::Matrix3d I = R * link.inertia * R.transpose();
    body.f = link.mass * (body.a + body.dw.cross(c) + body.w.cross(body.w.cross(c)));
    body.n = I * body.dw + body.w.cross(I * body.w) + c.cross(body.f);
  }
  for (int i = n - 1; i > 0; --i) {
    const int parent = model_->links[i].parent;
    out[5 + i] = bodies_[i].axis.dot(bodies_[i].n);
    const Eigen::Vector3d r = kinematics_.p_WL(i) - kinematics_.p_WL(parent);
    bodies_[parent].f += bodies_[i].f;
    bodies_[parent].n += bodies_[i].n + r.cross(bodies_[i].f);
  }
  out.head<3>() = bodies_[0].f;
  out.segment<3>(3) = kinematics_.R_WL(0).transpose() * bodies_[0].n;
}

void Dynamics::accumulate_composites() {
  const int n = static_cast<int>(bodies_.size());
  for (int i = 0; i < n; ++i) {
    const RobotLink& link = model_->links[i];
    const Eigen::Matrix3d& R = kinematics_.R_WL(i);
    Body& body = bodies_[i];
    body.axis.noalias() = R * link.axis;
    body.mass = link.mass;
    body.com = kinematics_.p_WL(i) + R * link.com;
    body.inertia.noalias() = R * link.inertia * R.transpose();
  }
  for (int i = n - 1; i > 0; --i) {
    const Body& child = bodies_[i];
    Body& parent = bodies_[model_->links[i].parent];
    const double mass = parent.mass + child.mass;
    const Eigen::Vector3d com = (parent.mass * parent.com + child.mass * child.com) / mass;
    parent.inertia +=
        shifted_inertia(parent.mass, parent.com - com) + child.inertia + shifted_inertia(child.mass, child.com - com);
    parent.com = com;
    parent.mass = mass;
  }
}

void Dynamics::mass_matrix(const RobotState& state, Eigen::Ref<Eigen::MatrixXd> out) {
  kinematics_.update(state.X_WB, state.q);
  accumulate_composites();
  project_composites(out);
  for (int j = 0; j < model_->dof(); ++j) out(6 + j, 6 + j) += model_->joints[j].armature;
}

// Composite rigid bodies: a unit acceleration of joint i alone moves what it carries as one body; the force and moment
// that this takes are projected on the joints between it and the base.
void Dynamics::project_composites(Eigen::Ref<Eigen::MatrixXd> out) const {
  out.setZero();
  const Eigen::Matrix3d& R = kinematics_.R_WL(0);
  const Eigen::Vector3d& p_WB = kinematics_.p_WL(0);
  for (int i = 1; i < static_cast<int>(bodies_.size()); ++i) {
    const Body& body = bodies_[i];
    const Eigen::Vector3d f = body.mass * body.axis.cross(body.com - kinematics_.p_WL(i));
    const Eigen::Vector3d n_com = body.inertia * body.axis;
    for (int k = i; k > 0; k = model_->links[k].parent) {
      const double value = bodies_[k].axis.dot(n_com + (body.com - kinematics_.p_WL(k)).cross(f));
      out(5 + i, 5 + k) = value;
      out(5 + k, 5 + i) = value;
    }
    out.block<3, 1>(0, 5 + i) = f;
    out.block<3, 1>(3, 5 + i) = R.transpose() * (n_com + (body.com - p_WB).cross(f));
    out.block<1, 3>(5 + i, 0) = out.block<3, 1>(0, 5 + i).transpose();
    out.block<1, 3>(5 + i, 3) = out.block<3, 1>(3, 5 + i).transpose();
  }
  const Body& all = bodies_[0];
  const Eigen::Vector3d c_B = R.transpose() * (all.com - p_WB);
  out.block<3, 3>(0, 0) = all.mass * Eigen::Matrix3d::Identity();
  for (int k = 0; k < 3; ++k) out.block<3, 1>(0, 3 + k) = R * (all.mass * Eigen::Vector3d::Unit(k).cross(c_B));
  out.block<3, 3>(3, 0) = out.block<3, 3>(0, 3).transpose();
  const Eigen::Matrix3d I_B = R.transpose() * all.inertia * R + shifted_inertia(all.mass, c_B);
  out.block<3, 3>(3, 3) = 0.5 * (I_B + I_B.transpose());
}

void bias_forces(const RobotModel& model, const RobotState& state, Eigen::Ref<Eigen::VectorXd> out) {
  Dynamics(model).bias_forces(state, out);
}

void inverse_dynamics(const RobotModel& model, const RobotState& state, const Eigen::VectorXd& a,
                      Eigen::Ref<Eigen::VectorXd> out) {
  Dynamics(model).inverse_dynamics(state, a, out);
}

void mass_matrix(const RobotModel& model, const RobotState& state, Eigen::Ref<Eigen::MatrixXd> out) {
  Dynamics(model).mass_matrix(state, out);
}

}  // namespace duet

// NOLINTEND(performance-unnecessary-value-param)

namespace duet {

TreeFactor::TreeFactor(const RobotModel& model) {
  const int n = 6 + model.dof();
  parent_.resize(n);
  ancestors_.resize(n);
  for (int i = 0; i < n; ++i) {
    parent_[i] = i - 1;
    if (i >= 6) {
      const int link = model.links[i - 5].parent;
      parent_[i] = link > 0 ? 5 + link : 5;
    }
    for (int k = parent_[i]; k >= 0; k = parent_[k]) ancestors_[i].push_back(k);
  }
  L_ = Eigen::MatrixXd::Zero(n, n);
  inverse_ = Eigen::VectorXd::Zero(n);
}

bool TreeFactor::compute(const Eigen::MatrixXd& mass, const Eigen::VectorXd& joint_inertia) {
  const int n = static_cast<int>(parent_.size());
  L_.triangularView<Eigen::Lower>() = mass;
  L_.diagonal().tail(n - 6) += joint_inertia;
  for (int k = n - 1; k >= 0; --k) {
    if (!(L_(k, k) > 0.0)) return false;
    const double diagonal = std::sqrt(L_(k, k)), inverse = 1.0 / diagonal;
    L_(k, k) = diagonal;
    inverse_[k] = inverse;
    const std::vector<int>& above = ancestors_[k];
    for (const int i : above) L_(k, i) *= inverse;
    for (std::size_t a = 0; a < above.size(); ++a) {
      const int i = above[a];
      const double factor = L_(k, i);
      for (std::size_t b = a; b < above.size(); ++b) L_(i, above[b]) -= factor * L_(k, above[b]);
    }
  }
  return true;
}

void TreeFactor::solve(Eigen::VectorXd& x) const {
  const int n = static_cast<int>(parent_.size());
  for (int i = n - 1; i >= 0; --i) {
    x[i] *= inverse_[i];
    for (const int j : ancestors_[i]) x[j] -= L_(i, j) * x[i];
  }
  for (int i = 0; i < n; ++i) {
    double value = x[i];
    for (const int j : ancestors_[i]) value -= L_(i, j) * x[j];
    x[i] = value * inverse_[i];
  }
}

void TreeFactor::half_solve(std::span<const int> rows, Triple& x) const {
  for (const int i : rows) {
    const Eigen::RowVector3d scaled = inverse_[i] * x.row(i);
    x.row(i) = scaled;
    for (const int j : ancestors_[i]) x.row(j) -= L_(i, j) * scaled;
  }
}

void TreeFactor::solve(std::span<const int> rows, Triple& x) const {
  half_solve(rows, x);
  for (int i = 0; i < static_cast<int>(parent_.size()); ++i) {
    Eigen::RowVector3d value = x.row(i);
    for (const int j : ancestors_[i]) value -= L_(i, j) * x.row(j);
    x.row(i) = inverse_[i] * value;
  }
}

}  // namespace duet
