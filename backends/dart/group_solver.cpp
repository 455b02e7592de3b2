#include "duet/backends/dart/group_solver.h"

#include <algorithm>
#include <cmath>
#include <dart/constraint/BoxedLcpSolver.hpp>
#include <dart/constraint/ConstrainedGroup.hpp>

namespace duet {
namespace {

using dart::constraint::ConstrainedGroup;
using dart::constraint::ConstraintBase;

constexpr double kFrictionTolerance = 5e-4;  // of the friction that is possible
constexpr double kNoImpulse = 1e-12;         // [N s]

// Length of a row of the matrix for n unknowns, as the solvers expect it.
int row_length(int n) { return n > 1 ? ((n - 1) | 3) + 1 : n; }

}  // namespace

GroupSolver::GroupSolver(dart::constraint::BoxedLcpSolverPtr first, dart::constraint::BoxedLcpSolverPtr second,
                         double dt, int friction_passes)
    : BoxedLcpConstraintSolver(std::move(first), std::move(second)), friction_passes_(friction_passes) {
  setTimeStep(dt);
}

void GroupSolver::solveConstrainedGroup(ConstrainedGroup& group) {
  if (group.getTotalDimension() == 0) return;
  resize(group);
  for (std::size_t i = 0; i < group.getNumConstraints(); ++i) fill(group, i);
  failed_ = !solve_problem();
  friction_ = mHi;
  normal_of_ = mFIndex;
  for (int pass = 0; pass < friction_passes_ && !failed_ && bound_friction(); ++pass) failed_ = !solve_problem();
  if (failed_) return;
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

bool GroupSolver::solve_problem() {
  if (mSecondaryBoxedLcpSolver == nullptr) {
    solve_with(*mBoxedLcpSolver, false);
  } else if (!solve_with(*mBoxedLcpSolver, true)) {
    solve_with(*mSecondaryBoxedLcpSolver, false);
  }
  return mX.allFinite();
}

// The solvers overwrite what they are given: they get copies.
bool GroupSolver::solve_with(dart::constraint::BoxedLcpSolver& solver, bool give_up) {
  mABackup = mA;
  mBBackup = mB;
  mLoBackup = mLo;
  mHiBackup = mHi;
  mFIndexBackup = mFIndex;
  mX.setZero();
  return solver.solve(static_cast<int>(mX.size()), mABackup.data(), mX.data(), mBBackup.data(), 0, mLoBackup.data(),
                      mHiBackup.data(), mFIndexBackup.data(), give_up) &&
         mX.allFinite();
}

// False where all friction already fits.
bool GroupSolver::bound_friction() {
  bool unfit = false;
  for (int row = 0; row + 2 < static_cast<int>(mX.size()); ++row)
    if (normal_of_[row + 1] == row && normal_of_[row + 2] == row) unfit = bound_friction_of(row) || unfit;
  return unfit;
}

// Coulomb's friction is the point of a disc that is nearest to itself less any multiple of the slip. The bounds become
// the sides of that point where it slips, and the disc's radius where it sticks.
bool GroupSolver::bound_friction_of(int normal) {
  const int n = static_cast<int>(mX.size()), first = normal + 1;
  const double limit = friction_[first] * std::max(0.0, mX[normal]);
  const Eigen::Vector2d impulse = mX.segment<2>(first);
  const Eigen::Vector2d slip = mA.block(first, 0, 2, n) * mX - mB.segment<2>(first);
  Eigen::Vector2d aim = impulse - slip / std::max(mA(first, first), mA(first + 1, first + 1));
  const double length = aim.norm();
  const bool slips = length > limit;
  if (slips) aim *= limit / length;
  for (int k = 0; k < 2; ++k) {
    mHi[first + k] = slips ? std::abs(aim[k]) : limit;
    mLo[first + k] = -mHi[first + k];
    mFIndex[first + k] = -1;
  }
  return (aim - impulse).norm() > kFrictionTolerance * limit + kNoImpulse;
}

}  // namespace duet
