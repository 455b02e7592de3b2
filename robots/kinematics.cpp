#include "duet/robots/kinematics.h"

#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(),  //
      v.z(), 0.0, -v.x(),   //
      -v.y(), v.x(), 0.0;
  return m;
}

// R times the rotation by `angle` about coordinate axis k: the other two columns mix.
Eigen::Matrix3d turned_about(const Eigen::Matrix3d& R, int k, double angle) {
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  const double c = std::cos(angle), s = std::sin(angle);
  Eigen::Matrix3d result;
  result.col(k) = R.col(k);
  result.col(i) = c * R.col(i) + s * R.col(j);
  result.col(j) = c * R.col(j) - s * R.col(i);
  return result;
}

// Rodrigues' formula.
Eigen::Matrix3d rotation_about(const Eigen::Vector3d& axis, double angle) {
  const Eigen::Matrix3d K = cross_matrix(axis);
  return Eigen::Matrix3d::Identity() + std::sin(angle) * K + (1.0 - std::cos(angle)) * (K * K);
}

int principal_axis(const Eigen::Vector3d& axis) {
  for (int k = 0; k < 3; ++k)
    if (axis == Eigen::Vector3d::Unit(k)) return k;
  return -1;
}

}  // namespace

Kinematics::Kinematics(const RobotModel& model)
    : model_(&model),
      R_WL_(model.links.size(), Eigen::Matrix3d::Identity()),
      p_WL_(model.links.size(), Eigen::Vector3d::Zero()) {
  hinges_.reserve(model.links.size());
  for (const RobotLink& link : model.links) {
    const Eigen::Matrix3d R = link.X_PL.R.toRotationMatrix();
    hinges_.push_back({R, !R.isIdentity(0.0), principal_axis(link.axis)});
  }
}

void Kinematics::update(const Pose& X_WB, const Eigen::Ref<const Eigen::VectorXd>& q) {
  R_WL_[0] = X_WB.R.toRotationMatrix();
  p_WL_[0] = X_WB.p;
  for (size_t i = 1; i < R_WL_.size(); ++i) {
    const RobotLink& link = model_->links[i];
    const Hinge& hinge = hinges_[i];
    const Eigen::Matrix3d& R_WP = R_WL_[link.parent];
    const double angle = q[static_cast<Eigen::Index>(i) - 1];
    p_WL_[i].noalias() = p_WL_[link.parent] + R_WP * link.X_PL.p;
    const Eigen::Matrix3d R_WL0 = hinge.turned ? Eigen::Matrix3d(R_WP * hinge.R_PL0) : R_WP;
    R_WL_[i] = hinge.principal >= 0 ? turned_about(R_WL0, hinge.principal, angle)
                                    : Eigen::Matrix3d(R_WL0 * rotation_about(link.axis, angle));
  }
}

Eigen::Vector3d Kinematics::frame_position(int frame) const {
  const RobotFrame& f = model_->frames[frame];
  return p_WL_[f.link] + R_WL_[f.link] * f.X_LF.p;
}

Pose Kinematics::frame_pose(int frame) const {
  const RobotFrame& f = model_->frames[frame];
  return X_WL(f.link) * f.X_LF;
}

Eigen::Vector3d Kinematics::shape_position(int shape) const {
  const RobotShape& s = model_->shapes[shape];
  return p_WL_[s.link] + R_WL_[s.link] * s.X_LS.p;
}

Eigen::Vector3d Kinematics::center_of_mass() const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double mass = 0.0;
  for (size_t i = 0; i < R_WL_.size(); ++i) {
    const RobotLink& link = model_->links[i];
    sum += link.mass * (p_WL_[i] + R_WL_[i] * link.com);
    mass += link.mass;
  }
  return sum / mass;
}

void Kinematics::point_jacobian(int link, const Eigen::Vector3d& p_W, Eigen::Ref<Eigen::MatrixXd> J) const {
  J.setZero();
  J.leftCols<3>().setIdentity();
  J.middleCols<3>(3) = -cross_matrix(p_W - p_WL_[0]) * R_WL_[0];
  for (int i = link; i > 0; i = model_->links[i].parent) {
    const Eigen::Vector3d axis_W = R_WL_[i] * model_->links[i].axis;
    J.col(5 + i) = axis_W.cross(p_W - p_WL_[i]);
  }
}

void Kinematics::angular_jacobian(int link, Eigen::Ref<Eigen::MatrixXd> J) const {
  J.setZero();
  J.middleCols<3>(3) = R_WL_[0];
  for (int i = link; i > 0; i = model_->links[i].parent) J.col(5 + i) = R_WL_[i] * model_->links[i].axis;
}

void Kinematics::center_of_mass_jacobian(Eigen::Ref<Eigen::MatrixXd> J) const {
  J.setZero();
  const double total = model_->total_mass();
  for (size_t body = 0; body < R_WL_.size(); ++body) {
    const RobotLink& moved = model_->links[body];
    const Eigen::Vector3d com_W = p_WL_[body] + R_WL_[body] * moved.com;
    for (int i = static_cast<int>(body); i > 0; i = model_->links[i].parent) {
      const Eigen::Vector3d axis_W = R_WL_[i] * model_->links[i].axis;
      J.col(5 + i) += (moved.mass / total) * axis_W.cross(com_W - p_WL_[i]);
    }
  }
  J.leftCols<3>().setIdentity();
  J.middleCols<3>(3) = -cross_matrix(center_of_mass() - p_WL_[0]) * R_WL_[0];
}

PointTracks frame_tracks(const RobotModel& model, const RobotMotion& motion, const std::vector<int>& frames) {
  require(motion.q.rows() == model.dof() && motion.q.cols() == motion.frames(),
          "frame tracks of '" + model.name + "': expected a motion of " + std::to_string(model.dof()) + " joints and " +
              std::to_string(motion.frames()) + " frames, found " + std::to_string(motion.q.rows()) + " and " +
              std::to_string(motion.q.cols()));
  for (const int frame : frames)
    require(frame >= 0 && frame < static_cast<int>(model.frames.size()),
            "frame tracks of '" + model.name + "': expected frame indices below " +
                std::to_string(model.frames.size()) + ", found " + std::to_string(frame));
  PointTracks tracks(motion.frames(), static_cast<int>(frames.size()));
  Kinematics kinematics(model);
  for (int t = 0; t < motion.frames(); ++t) {
    kinematics.update(motion.root[t], motion.q.col(t));
    for (size_t k = 0; k < frames.size(); ++k) tracks.at(t, static_cast<int>(k)) = kinematics.frame_position(frames[k]);
  }
  return tracks;
}

}  // namespace duet
