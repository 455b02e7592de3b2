#include "duet/backends/dart/link_responses.h"

#include <Eigen/LU>
#include <algorithm>

namespace duet {
namespace {

// Columns of impulses on a link, about its origin, as seen from its parent.
Eigen::Matrix6d to_parent(const Eigen::Matrix3d& R, const Eigen::Vector3d& p, const Eigen::Matrix6d& F) {
  Eigen::Matrix6d result;
  result.bottomRows<3>().noalias() = R * F.bottomRows<3>();
  result.topRows<3>().noalias() = R * F.topRows<3>();
  for (int k = 0; k < 6; ++k) result.col(k).head<3>() += p.cross(result.col(k).tail<3>());
  return result;
}

// Columns of velocities of the parent as a link has them that is fixed to it.
Eigen::Matrix6d from_parent(const Eigen::Matrix3d& R, const Eigen::Vector3d& p, const Eigen::Matrix6d& V) {
  Eigen::Matrix<double, 3, 6> at_link = V.bottomRows<3>();
  for (int k = 0; k < 6; ++k) at_link.col(k) -= p.cross(V.col(k).head<3>());
  Eigen::Matrix6d result;
  result.topRows<3>().noalias() = R.transpose() * V.topRows<3>();
  result.bottomRows<3>().noalias() = R.transpose() * at_link;
  return result;
}

}  // namespace

LinkResponses::LinkResponses(std::shared_ptr<const RobotModel> robot, std::vector<dart::dynamics::BodyNode*> bodies,
                             std::vector<ImplicitHinge*> hinges)
    : robot_(std::move(robot)),
      bodies_(std::move(bodies)),
      hinges_(std::move(hinges)),
      links_(bodies_.size()),
      slot_(bodies_.size(), -1) {
  for (const RobotShape& shape : robot_->shapes)
    if (slot_[shape.link] < 0) slot_[shape.link] = slots_++;
  blocks_.resize(static_cast<std::size_t>(slots_) * slots_);
  added_.reserve(slots_);
  added_hinges_.reserve(hinges_.size());
  hinge_rows_.resize(static_cast<std::size_t>(slots_) * hinges_.size());
}

void LinkResponses::clear() {
  added_.clear();
  added_hinges_.clear();
  for (Link& link : links_) link.needed = false;
}

void LinkResponses::add(int link) {
  if (std::find(added_.begin(), added_.end(), link) != added_.end()) return;
  added_.push_back(link);
  need(link);
}

void LinkResponses::add_hinge(int joint) {
  added_hinges_.push_back(joint);
  need(joint + 1);
}

void LinkResponses::need(int link) {
  for (; link >= 0; link = robot_->links[link].parent) links_[link].needed = true;
}

void LinkResponses::update() {
  base_inverse_ = bodies_[0]->getArticulatedInertia().inverse();
  for (int i = 1; i < static_cast<int>(links_.size()); ++i)
    if (links_[i].needed) read(i);
  for (const int link : added_) hit(link);
}

void LinkResponses::read(int index) {
  Link& link = links_[index];
  const ImplicitHinge& hinge = *hinges_[index - 1];
  const Eigen::Isometry3d& X_PL = hinge.getRelativeTransform();
  link.R = X_PL.linear();
  link.p = X_PL.translation();
  link.S = hinge.motion();
  link.U.noalias() = bodies_[index]->getArticulatedInertia() * link.S;
  link.inverse = hinge.inverse_inertia();
}

// Unit impulses on the link go to the base, each hinge on the way giving way; then velocities come back.
void LinkResponses::hit(int index) {
  for (Link& link : links_) link.h.setZero();
  Eigen::Matrix6d F = Eigen::Matrix6d::Identity();
  for (int i = index; i > 0; i = robot_->links[i].parent) {
    Link& link = links_[i];
    link.h.noalias() = link.S.transpose() * F;
    F.noalias() -= link.U * (link.inverse * link.h);
    F = to_parent(link.R, link.p, F);
  }
  links_[0].V.noalias() = base_inverse_ * F;
  for (int i = 1; i < static_cast<int>(links_.size()); ++i) {
    Link& link = links_[i];
    if (!link.needed) continue;
    link.V = from_parent(link.R, link.p, links_[robot_->links[i].parent].V);
    const Row6 hinge = link.inverse * (link.h - link.U.transpose() * link.V);
    link.V.noalias() += link.S * hinge;
    hinge_rows_[static_cast<std::size_t>(slot_[index]) * hinges_.size() + i - 1] = hinge;
  }
  for (const int moved : added_) blocks_[slot_[index] * slots_ + slot_[moved]] = links_[moved].V;
}

ImplicitHinge::ImplicitHinge(const Properties& properties) : RevoluteJoint(properties) {}

const Eigen::Vector6d& ImplicitHinge::motion() const {
  return GenericJoint<dart::math::R1Space>::getRelativeJacobianStatic();
}

dart::dynamics::Joint* ImplicitHinge::clone() const { return new ImplicitHinge(getRevoluteJointProperties()); }

void ImplicitHinge::updateInvProjArtInertia(const Eigen::Matrix6d& inertia) {
  const Eigen::Vector6d& S = motion();
  mInvProjArtInertia(0, 0) = 1.0 / (S.dot(inertia * S) + added_inertia_);
}

// With the same added inertia in both, DART's explicit and implicit articulated inertias are one.
void ImplicitHinge::updateInvProjArtInertiaImplicit(const Eigen::Matrix6d&, double) {
  mInvProjArtInertiaImplicit = mInvProjArtInertia;
}

}  // namespace duet
