// DART's solver of constraints as boxed linear complementarity problems, for one robot: the same problem without the
// checks of Debian's build, which print or end the process (assertions are on in it). DART bounds friction by what the
// normal forces would be without friction, and each of two tangents apart; here such a solution is the first of a few,
// each with the bounds that follow from the one before, until friction is Coulomb's.
#pragma once

#include <dart/constraint/BoxedLcpConstraintSolver.hpp>

#include "duet/backends/dart/alignment.h"

namespace duet {

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
