#include "backends/dart/group_solver.h"

#include <dart/constraint/BoxedLcpSolver.hpp>
#include <dart/constraint/ConstrainedGroup.hpp>

namespace duet {
namespace {

using dart::constraint::ConstrainedGroup;
using dart::constraint::ConstraintBase;

// Length of a row of the matrix for n unknowns, as the solvers expect it.
int row_length(int n) { return n > 1 ? ((n - 1) | 3) + 1 : n; }

}  // namespace

GroupSolver::GroupSolver(dart::constraint::BoxedLcpSolverPtr first, dart::constraint::BoxedLcpSolverPtr second,
                         double dt)
    : BoxedLcpConstraintSolver(std::move(first), std::move(second)) {
  setTimeStep(dt);
}

void GroupSolver::solveConstrainedGroup(ConstrainedGroup& group) {
  if (group.getTotalDimension() == 0) return;
  resize(group);
  for (std::size_t i = 0; i < group.getNumConstraints(); ++i) fill(group, i);
  if (!solve_problem()) {
    failed_ = true;
    return;
  }
  for (std::size_t i = 0; i < group.getNumConstraints(); ++i) {
    ConstraintBase& constraint = *group.getConstraint(i);
    constraint.applyImpulse(mX.data() + mOffset[static_cast<Eigen::Index>(i)]);
    constraint.excite();
  }
}

void GroupSolver::resize(ConstrainedGroup& group) {
  const int n = static_cast<int>(group.getTotalDimension());
  mA.setZero(n, row_length(n));
  for (Eigen::VectorXd* vector : {&mX, &mB, &mW, &mLo, &mHi}) vector->setZero(n);
  mFIndex.setConstant(n, -1);
  mOffset.resize(static_cast<Eigen::Index>(group.getNumConstraints()));
  int offset = 0;
  for (std::size_t i = 0; i < group.getNumConstraints(); ++i) {
    mOffset[static_cast<Eigen::Index>(i)] = offset;
    offset += static_cast<int>(group.getConstraint(i)->getDimension());
  }
}

// The bounds of a constraint and its rows of the matrix, from its diagonal block on; what is left of that is mirrored.
void GroupSolver::fill(ConstrainedGroup& group, std::size_t index) {
  ConstraintBase& constraint = *group.getConstraint(index);
  const int begin = mOffset[static_cast<Eigen::Index>(index)];
  dart::constraint::ConstraintInfo info{};
  info.x = mX.data() + begin;
  info.lo = mLo.data() + begin;
  info.hi = mHi.data() + begin;
  info.b = mB.data() + begin;
  info.w = mW.data() + begin;
  info.findex = mFIndex.data() + begin;
  info.invTimeStep = 1.0 / getTimeStep();
  constraint.getInformation(&info);
  constraint.excite();
  for (int j = 0; j < static_cast<int>(constraint.getDimension()); ++j) {
    const int row = begin + j;
    if (mFIndex[row] >= 0) mFIndex[row] += begin;
    constraint.applyUnitImpulse(j);
    constraint.getVelocityChange(&mA(row, begin), true);
    for (std::size_t k = index + 1; k < group.getNumConstraints(); ++k)
      group.getConstraint(k)->getVelocityChange(&mA(row, mOffset[static_cast<Eigen::Index>(k)]), false);
    mA.row(row).head(begin) = mA.col(row).head(begin).transpose();
  }
  constraint.unexcite();
}

// The solvers overwrite the problem.
bool GroupSolver::solve_problem() {
  const int n = static_cast<int>(mX.size());
  const auto solve = [&](dart::constraint::BoxedLcpSolver& solver, bool give_up) {
    return solver.solve(n, mA.data(), mX.data(), mB.data(), 0, mLo.data(), mHi.data(), mFIndex.data(), give_up) &&
           mX.allFinite();
  };
  if (mSecondaryBoxedLcpSolver == nullptr) {
    solve(*mBoxedLcpSolver, false);
    return mX.allFinite();
  }
  mABackup = mA;
  mBBackup = mB;
  mLoBackup = mLo;
  mHiBackup = mHi;
  mFIndexBackup = mFIndex;
  if (solve(*mBoxedLcpSolver, true)) return true;
  mA = mABackup;
  mB = mBBackup;
  mLo = mLoBackup;
  mHi = mHiBackup;
  mFIndex = mFIndexBackup;
  mX.setZero();
  solve(*mSecondaryBoxedLcpSolver, false);
  return mX.allFinite();
}

}  // namespace duet
