// How links answer to impulses on links: 6 x 6 blocks of the inverse inertia, made of DART's articulated inertias along
// the paths between the links and the base. DART's own impulse test passes through the whole tree for each row of each
// contact; here it is done once for each touched link. Source: Featherstone, Rigid Body Dynamics Algorithms, chapter 7.
#pragma once

#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <memory>
#include <span>
#include <vector>

#include "duet/backends/dart/alignment.h"
#include "duet/robots/robot_model.h"

namespace duet {

// DART's revolute joint with the torque law's inertia added to the one that it projects on its axis: the armature, and
// what damping and spring weigh at the end of the step. DART's own springs and dampers are missing where it computes
// responses to contact impulses; here accelerations and responses see the same inertia.
class ImplicitHinge final : public dart::dynamics::RevoluteJoint {
 public:
  explicit ImplicitHinge(const Properties& properties);

  // s of backends/physics_backend.h [kg m^2]. DART does not notice: Skeleton::dirtyArticulatedInertia() is the
  // caller's.
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

class LinkResponses {
 public:
  using Row6 = Eigen::Matrix<double, 1, 6>;

  // `bodies` by link, `hinges` by joint.
  LinkResponses(std::shared_ptr<const RobotModel> robot, std::vector<dart::dynamics::BodyNode*> bodies,
                std::vector<ImplicitHinge*> hinges);

  // The links that matter now are those of add() since clear(). Poses and inertias are read by update().
  void clear();
  void add(int link);
  void add_hinge(int joint);  // its answers matter too
  void update();
  [[nodiscard]] std::span<const int> links() const { return added_; }
  [[nodiscard]] std::span<const int> hinges() const { return added_hinges_; }
  [[nodiscard]] ImplicitHinge& hinge(int joint) const { return *hinges_[joint]; }
  // Change of velocity of link `moved` per unit impulse on `hit`: both as DART has them, angular above linear, about
  // the link's origin in its frame.
  [[nodiscard]] const Eigen::Matrix6d& of(int moved, int hit) const {
    return blocks_[slot_[hit] * slots_ + slot_[moved]];
  }
  // Change of velocity of a hinge per unit impulse on link `hit`.
  [[nodiscard]] const Row6& of_hinge(int joint, int hit) const {
    return hinge_rows_[static_cast<std::size_t>(slot_[hit]) * hinges_.size() + joint];
  }

 private:
  struct Link {  // on a path
    bool needed = false;
    Eigen::Matrix3d R;  // of the link in its parent
    Eigen::Vector3d p;
    Eigen::Vector6d S, U;  // motion of the hinge; articulated inertia times that
    double inverse = 0.0;  // of the inertia that the hinge feels
    Row6 h;                // impulse on the hinge
    Eigen::Matrix6d V;     // velocities
  };
  void read(int link);
  void need(int link);
  void hit(int link);

  std::shared_ptr<const RobotModel> robot_;
  std::vector<dart::dynamics::BodyNode*> bodies_;
  std::vector<ImplicitHinge*> hinges_;
  std::vector<Link> links_;
  Eigen::Matrix6d base_inverse_;
  std::vector<int> added_;  // links
  std::vector<int> slot_;   // of a link that has a shape, else -1
  int slots_ = 0;
  std::vector<Eigen::Matrix6d> blocks_;
  std::vector<int> added_hinges_;  // joints
  std::vector<Row6> hinge_rows_;
};

}  // namespace duet
