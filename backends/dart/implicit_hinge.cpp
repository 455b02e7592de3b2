#include "duet/backends/dart/implicit_hinge.h"

namespace duet {

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
