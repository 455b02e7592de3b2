#include "duet/backends/simbody/simbody_model.h"

#include <Simbody.h>
#include <fmt/format.h>

#include <Eigen/Geometry>

namespace duet {
namespace {

SimTK::Vec3 to_simbody(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

SimTK::Rotation to_simbody(const Eigen::Quaterniond& R) {
  return SimTK::Rotation(SimTK::Quaternion(R.w(), R.x(), R.y(), R.z()));
}

Eigen::Vector3d from_simbody(const SimTK::Vec3& v) { return {v[0], v[1], v[2]}; }

Eigen::Matrix3d from_simbody(const SimTK::Rotation& R) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) m(i, j) = R.asMat33()(i, j);
  return m;
}

// Simbody takes the inertia about the body's origin.
SimTK::Body::Rigid body_of(const RobotLink& link) {
  const Eigen::Matrix3d& I = link.inertia;
  const SimTK::Inertia central(I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
  const SimTK::Vec3 com = to_simbody(link.com);
  return SimTK::Body::Rigid(SimTK::MassProperties(link.mass, com, central.shiftFromMassCenter(-com, link.mass)));
}

// Force and moment about the link's origin that move what the link carries as one body, per unit of turning.
struct Effort {
  Eigen::Vector3d f, n;
};
Effort effort_of_turning(const SimTK::SpatialInertia& carried, const Eigen::Vector3d& axis_W) {
  const SimTK::Vec3 axis = to_simbody(axis_W);
  return {from_simbody(carried.getMass() * (axis % carried.getMassCenter())),
          from_simbody(carried.getMass() * (carried.getUnitInertia() * axis))};
}

}  // namespace

std::string simbody_version() {
  int major = 0, minor = 0, build = 0;
  SimTK_version_simbody(&major, &minor, &build);
  return fmt::format("{}.{}.{}", major, minor, build);
}

struct SimbodyModel::Tree {
  SimTK::MultibodySystem system;
  SimTK::SimbodyMatterSubsystem matter{system};
  std::vector<SimTK::MobilizedBody> bodies;  // of links
  std::vector<int> q_index, u_index;         // first of each link's
  SimTK::State state;
  SimTK::Vector no_forces, acceleration, residual;
  SimTK::Vector_<SimTK::SpatialVec> no_body_forces, body_forces;
  bool pushed = false;  // body_forces count
};

SimbodyModel::SimbodyModel(std::shared_ptr<const RobotModel> robot, const Eigen::Vector3d& gravity_W)
    : robot_(std::move(robot)),
      tree_(std::make_unique<Tree>()),
      R_WL_(robot_->links.size()),
      p_WL_(robot_->links.size()),
      axes_W_(robot_->links.size(), Eigen::Vector3d::Zero()),
      mass_(Eigen::MatrixXd::Zero(6 + robot_->dof(), 6 + robot_->dof())),
      bias_(Eigen::VectorXd::Zero(6 + robot_->dof())) {
  Tree& t = *tree_;
  t.bodies.push_back(
      SimTK::MobilizedBody::Free(t.matter.Ground(), SimTK::Transform(), body_of(robot_->links[0]), SimTK::Transform()));
  for (size_t i = 1; i < robot_->links.size(); ++i) {
    const RobotLink& link = robot_->links[i];
    const SimTK::Rotation to_axis(SimTK::UnitVec3(to_simbody(link.axis)), SimTK::ZAxis);  // a Pin turns about z
    t.bodies.push_back(SimTK::MobilizedBody::Pin(
        t.bodies[link.parent], SimTK::Transform(to_simbody(link.X_PL.R) * to_axis, to_simbody(link.X_PL.p)),
        body_of(link), SimTK::Transform(to_axis)));
  }
  t.state = t.system.realizeTopology();
  t.system.realizeModel(t.state);
  for (const SimTK::MobilizedBody& body : t.bodies) {
    t.q_index.push_back(body.getFirstQIndex(t.state));
    t.u_index.push_back(body.getFirstUIndex(t.state));
  }
  // Gravity enters as an acceleration of the base the other way.
  t.acceleration.resize(t.state.getNU());
  t.acceleration = 0.0;
  for (int k = 0; k < 3; ++k) t.acceleration[t.u_index[0] + 3 + k] = -gravity_W[k];
  t.body_forces.resize(t.matter.getNumBodies());
}

SimbodyModel::~SimbodyModel() = default;

void SimbodyModel::update(const RobotState& state) {
  write(state);
  tree_->system.realize(tree_->state, SimTK::Stage::Velocity);
  tree_->pushed = false;
  read_poses();
  read_mass();
}

// The Free joint's speeds are the angular and then the linear velocity, both in W; its coordinates a quaternion from w
// to z and the position.
void SimbodyModel::write(const RobotState& state) {
  Tree& t = *tree_;
  SimTK::Vector &q = t.state.updQ(), &u = t.state.updU();
  const Eigen::Quaterniond& R = state.X_WB.R;
  const Eigen::Vector3d w_WB = R * state.w_WB_B;
  q[t.q_index[0]] = R.w();
  for (int k = 0; k < 3; ++k) {
    q[t.q_index[0] + 1 + k] = R.vec()[k];
    q[t.q_index[0] + 4 + k] = state.X_WB.p[k];
    u[t.u_index[0] + k] = w_WB[k];
    u[t.u_index[0] + 3 + k] = state.v_WB[k];
  }
  for (int i = 0; i < robot_->dof(); ++i) {
    q[t.q_index[i + 1]] = state.q[i];
    u[t.u_index[i + 1]] = state.v[i];
  }
}

void SimbodyModel::read_poses() {
  const Tree& t = *tree_;
  for (size_t i = 0; i < t.bodies.size(); ++i) {
    const SimTK::Transform& X = t.bodies[i].getBodyTransform(t.state);
    R_WL_[i] = from_simbody(X.R());
    p_WL_[i] = from_simbody(X.p());
    if (i > 0) axes_W_[i] = from_simbody(t.bodies[i].getHCol(t.state, SimTK::MobilizerUIndex(0))[0]);
  }
}

// From Simbody's composite inertias and hinge axes, along the tree only: calcM() goes through it once per column.
void SimbodyModel::read_mass() {
  const Tree& t = *tree_;
  t.matter.realizeCompositeBodyInertias(t.state);
  const auto carried = [&t](int link) -> const SimTK::SpatialInertia& {
    return t.matter.getCompositeBodyInertia(t.state, t.bodies[link].getMobilizedBodyIndex());
  };
  const Eigen::Matrix3d R_BW = R_WL_[0].transpose();
  for (int i = 1; i < static_cast<int>(t.bodies.size()); ++i) {
    auto [f, n] = effort_of_turning(carried(i), axes_W_[i]);
    for (int k = i; k > 0; k = robot_->links[k].parent) {
      mass_(5 + i, 5 + k) = mass_(5 + k, 5 + i) = axes_W_[k].dot(n + (p_WL_[i] - p_WL_[k]).cross(f));
    }
    mass_.block<3, 1>(0, 5 + i) = f;
    mass_.block<3, 1>(3, 5 + i) = R_BW * (n + (p_WL_[i] - p_WL_[0]).cross(f));
    mass_.block<1, 6>(5 + i, 0) = mass_.block<6, 1>(0, 5 + i).transpose();
  }
  const SimTK::SpatialInertia& all = carried(0);
  mass_.topLeftCorner<3, 3>() = all.getMass() * Eigen::Matrix3d::Identity();
  for (int k = 0; k < 3; ++k) {
    const auto [f, n] = effort_of_turning(all, R_WL_[0].col(k));
    mass_.block<3, 1>(0, 3 + k) = f;
    mass_.block<3, 1>(3, 3 + k) = R_BW * n;
    mass_.block<1, 3>(3 + k, 0) = f.transpose();
  }
}

void SimbodyModel::apply(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L) {
  Tree& t = *tree_;
  if (!t.pushed) t.body_forces = SimTK::SpatialVec(SimTK::Vec3(0), SimTK::Vec3(0));
  t.pushed = true;
  const Eigen::Vector3d moment = (R_WL_[link] * p_L).cross(f_W);
  t.body_forces[t.bodies[link].getMobilizedBodyIndex()] += SimTK::SpatialVec(to_simbody(moment), to_simbody(f_W));
}

const Eigen::VectorXd& SimbodyModel::update_bias() {
  Tree& t = *tree_;
  t.matter.calcResidualForceIgnoringConstraints(t.state, t.no_forces, t.pushed ? t.body_forces : t.no_body_forces,
                                                t.acceleration, t.residual);
  Eigen::Vector3d moment;
  for (int k = 0; k < 3; ++k) {
    moment[k] = t.residual[t.u_index[0] + k];
    bias_[k] = t.residual[t.u_index[0] + 3 + k];
  }
  bias_.segment<3>(3) = R_WL_[0].transpose() * moment;
  for (int i = 0; i < robot_->dof(); ++i) bias_[6 + i] = t.residual[t.u_index[i + 1]];
  return bias_;
}

}  // namespace duet
