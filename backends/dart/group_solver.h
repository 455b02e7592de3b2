// DART's solver of constraints as boxed linear complementarity problems, for one robot: the same problem, without the
// checks of Debian's build that print or end the process (assertions are on in it), and without the copies that only
// the second solver needs.
#pragma once

#include <dart/constraint/BoxedLcpConstraintSolver.hpp>

#include "backends/dart/alignment.h"

namespace duet {

class GroupSolver final : public dart::constraint::BoxedLcpConstraintSolver {
 public:
  // `second` is asked where `first` finds nothing; it may be null.
  GroupSolver(dart::constraint::BoxedLcpSolverPtr first, dart::constraint::BoxedLcpSolverPtr second, double dt);

  // True where the last impulses were not finite and so were not applied.
  [[nodiscard]] bool failed() const { return failed_; }
  void clear_failure() { failed_ = false; }

 private:
  void solveConstrainedGroup(dart::constraint::ConstrainedGroup& group) override;
  void resize(dart::constraint::ConstrainedGroup& group);
  void fill(dart::constraint::ConstrainedGroup& group, std::size_t index);
  bool solve_problem();

  bool failed_ = false;
};

}  // namespace duet
