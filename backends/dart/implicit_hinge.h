// DART's revolute joint with the torque law's inertia added to the one that it projects on its axis: the armature, and
// what damping and spring weigh at the end of the step. DART's own springs and dampers are missing where it computes
// responses to contact impulses; here accelerations and responses see the same inertia.
#pragma once

#include <dart/dynamics/RevoluteJoint.hpp>

#include "duet/backends/dart/alignment.h"

namespace duet {

class ImplicitHinge final : public dart::dynamics::RevoluteJoint {
 public:
  explicit ImplicitHinge(const Properties& properties);

  // s of backends/implicit_law.h [kg m^2]. DART does not notice: Skeleton::dirtyArticulatedInertia() is the caller's.
  void set_added_inertia(double inertia) { added_inertia_ = inertia; }

  // Motion of the child body per unit velocity, in its frame: angular, then linear.
  [[nodiscard]] const Eigen::Vector6d& motion() const;
  // The inverse of the articulated inertia projected on the axis, with what is added. [1/(kg m^2)]
  [[nodiscard]] double inverse_inertia() const { return getInvProjArtInertia()(0, 0); }

 private:
  Joint* clone() const override;
  void updateInvProjArtInertia(const Eigen::Matrix6d& inertia) override;
  void updateInvProjArtInertiaImplicit(const Eigen::Matrix6d& inertia, double dt) override;

  double added_inertia_ = 0.0;
};

}  // namespace duet
