// All points at which the robot touches in one step as one DART constraint: a normal row and two friction rows each.
// Friction is a pyramid whose first side is the direction in which the point would slide if nothing held it.
#pragma once

#include <dart/constraint/BoxedLcpConstraintSolver.hpp>
#include <dart/constraint/ConstraintBase.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/Skeleton.hpp>
#include <span>
#include <vector>

#include "duet/backends/dart/alignment.h"
#include "duet/backends/dart/link_responses.h"
#include "duet/backends/narrow_phase.h"

namespace duet {

// Settings of the rigid contacts with the ground and of the robot with itself.
struct RigidContact {
  double erp = 0.0;             // share of the depth that is recovered in a step
  double recovery_speed = 0.0;  // at most [m/s]
  double cfm = 0.0;             // softness of the normal row, as a share of its inverse inertia
};

class ContactRows final : public dart::constraint::ConstraintBase {
 public:
  // `bodies` by link. At most `capacity` points.
  ContactRows(dart::dynamics::SkeletonPtr skeleton, std::vector<dart::dynamics::BodyNode*> bodies,
              LinkResponses responses, const RigidContact& rigid, double dt, std::size_t capacity);

  // The points of the coming step; they must stay as they are until it ends.
  void set(std::span<const ContactPoint> points);
  // The joints whose stops DART will solve for together with the points.
  void set_stops(std::span<const int> joints) { stops_ = joints; }
  // The force of the other side on the link at points[index], mean over the step that has ended. [N], W.
  [[nodiscard]] Eigen::Vector3d force(std::size_t index) const;

 private:
  struct Row {
    Eigen::Vector6d J = Eigen::Vector6d::Zero();        // of the link, in its frame: moment, then force
    Eigen::Vector6d J_other = Eigen::Vector6d::Zero();  // of the other link, where there is one
    double velocity = 0.0;                              // change that is asked for [m/s]
    double softness = 0.0;                              // added to the diagonal [1/kg]
    double cfm = 0.0;                                   // the same, as a share of it
    double impulse = 0.0;                               // [N s]
  };
  struct Point {
    dart::dynamics::BodyNode* body = nullptr;
    dart::dynamics::BodyNode* other = nullptr;  // null: the ground or the human
    Eigen::Matrix3d axes_W;                     // columns: normal, two tangents
  };

  void update() override;
  void getInformation(dart::constraint::ConstraintInfo* info) override;
  void applyUnitImpulse(std::size_t row) override;
  void getVelocityChange(double* change, bool with_cfm) override;
  void excite() override;
  void unexcite() override;
  void applyImpulse(double* impulses) override;
  [[nodiscard]] bool isActive() const override { return !points_.empty(); }
  [[nodiscard]] dart::dynamics::SkeletonPtr getRootSkeleton() const override;

  void aim(const ContactPoint& contact, Point& point);
  void answer(std::size_t row);
  void fill_rows(const ContactPoint& contact, const Point& point, Row* rows) const;

  dart::dynamics::SkeletonPtr skeleton_;
  std::vector<dart::dynamics::BodyNode*> bodies_;
  RigidContact rigid_;
  double dt_;
  std::span<const ContactPoint> contacts_;
  std::vector<Point> points_;
  std::vector<Row> rows_;
  LinkResponses responses_;
  std::vector<Eigen::Vector6d> answers_;  // by link: change of velocity by the last unit impulse
  std::span<const int> stops_;
  std::size_t applied_ = 0;  // row of the last unit impulse
};

// DART's solver of constraints as boxed linear complementarity problems, for one robot: the same problem without the
// checks of Debian's build, which print or end the process (assertions are on in it). DART bounds friction by what the
// normal forces would be without friction, and each of two tangents apart; here such a solution is the first of a few,
// each with the bounds that follow from the one before, until friction is Coulomb's.
class GroupSolver final : public dart::constraint::BoxedLcpConstraintSolver {
 public:
  // `second` is asked where `first` finds nothing; it may be null. `friction_passes`: the most solutions after the
  // first.
  GroupSolver(dart::constraint::BoxedLcpSolverPtr first, dart::constraint::BoxedLcpSolverPtr second, double dt,
              int friction_passes);

  // True where the last impulses were not finite and so were not applied.
  [[nodiscard]] bool failed() const { return failed_; }
  void clear_failure() { failed_ = false; }

 private:
  void solveConstrainedGroup(dart::constraint::ConstrainedGroup& group) override;
  void resize(dart::constraint::ConstrainedGroup& group);
  void fill(dart::constraint::ConstrainedGroup& group, std::size_t index);
  bool solve_problem();
  bool solve_with(dart::constraint::BoxedLcpSolver& solver, bool give_up);
  bool bound_friction();
  bool bound_friction_of(int normal);

  int friction_passes_;
  bool failed_ = false;
  Eigen::VectorXd friction_;   // coefficients, where normal_of_ says that a row is one of friction
  Eigen::VectorXi normal_of_;  // row of its normal force, else -1
};

}  // namespace duet
