#include "duet/backends/dart/contact_rows.h"

#include <algorithm>
#include <cmath>
#include <dart/constraint/BoxedLcpSolver.hpp>
#include <dart/constraint/ConstrainedGroup.hpp>
#include <limits>

namespace duet {
namespace {

using dart::dynamics::BodyNode;

constexpr double kNoSlip = 1e-12;  // [m/s], below which a direction of sliding has no meaning
// The softness of friction rows, as a share of their inverse inertia: the rows of one link depend on one another.
constexpr double kFrictionCfm = 1e-5;
constexpr double kNoSkin = 1e-9;  // [N s/m], the least h K + D of a skin
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::Vector3d velocity_at(const BodyNode& body, const Eigen::Vector3d& p_W) {
  const Eigen::Isometry3d& X_WL = body.getWorldTransform();
  const Eigen::Vector6d& V = body.getSpatialVelocity();
  const Eigen::Vector3d r_L = X_WL.linear().transpose() * (p_W - X_WL.translation());
  return X_WL.linear() * (V.tail<3>() + V.head<3>().cross(r_L));
}

Eigen::Vector6d wrench_on(const BodyNode& body, const Eigen::Vector3d& p_W, const Eigen::Vector3d& axis_W) {
  const Eigen::Isometry3d& X_WL = body.getWorldTransform();
  const Eigen::Vector3d r_L = X_WL.linear().transpose() * (p_W - X_WL.translation());
  const Eigen::Vector3d axis_L = X_WL.linear().transpose() * axis_W;
  Eigen::Vector6d wrench;
  wrench << r_L.cross(axis_L), axis_L;
  return wrench;
}

}  // namespace

ContactRows::ContactRows(dart::dynamics::SkeletonPtr skeleton, std::vector<BodyNode*> bodies, LinkResponses responses,
                         const RigidContact& rigid, double dt, std::size_t capacity)
    : skeleton_(std::move(skeleton)),
      bodies_(std::move(bodies)),
      rigid_(rigid),
      dt_(dt),
      responses_(std::move(responses)),
      answers_(bodies_.size()) {
  points_.reserve(capacity);
  rows_.reserve(3 * capacity);
}

void ContactRows::set(std::span<const ContactPoint> points) {
  contacts_ = points;
  points_.resize(points.size());
  rows_.resize(3 * points.size());
  mDim = rows_.size();
}

Eigen::Vector3d ContactRows::force(std::size_t index) const {
  const Row* rows = &rows_[3 * index];
  return points_[index].axes_W * Eigen::Vector3d(rows[0].impulse, rows[1].impulse, rows[2].impulse) / dt_;
}

// Velocities are those at the end of the step without constraints, poses those at its begin.
void ContactRows::update() {
  responses_.clear();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    aim(contacts_[i], points_[i]);
    fill_rows(contacts_[i], points_[i], &rows_[3 * i]);
    responses_.add(contacts_[i].link);
    if (points_[i].other != nullptr) responses_.add(contacts_[i].other);
  }
  if (points_.empty()) return;
  for (const int joint : stops_) responses_.add_hinge(joint);
  responses_.update();
}

void ContactRows::aim(const ContactPoint& contact, Point& point) {
  point.body = bodies_[contact.link];
  point.other = contact.side == ContactSide::kRobot ? bodies_[contact.other] : nullptr;
  const Eigen::Vector3d& n_W = contact.n_W;
  Eigen::Vector3d slip = velocity_at(*point.body, contact.p_W) - contact.v_other_W;
  if (point.other != nullptr) slip -= velocity_at(*point.other, contact.p_W);
  slip -= n_W.dot(slip) * n_W;
  const double speed = slip.norm();
  point.axes_W.col(0) = n_W;
  point.axes_W.col(1) = speed > kNoSlip ? Eigen::Vector3d(slip / speed) : n_W.unitOrthogonal();
  point.axes_W.col(2) = n_W.cross(point.axes_W.col(1));
}

void ContactRows::fill_rows(const ContactPoint& contact, const Point& point, Row* rows) const {
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis_W = point.axes_W.col(k);
    Row& row = rows[k];
    row.J = wrench_on(*point.body, contact.p_W, axis_W);
    row.velocity = contact.v_other_W.dot(axis_W) - row.J.dot(point.body->getSpatialVelocity());
    row.softness = 0.0;
    row.cfm = kFrictionCfm;
    row.impulse = 0.0;
    if (point.other == nullptr) continue;
    row.J_other = -wrench_on(*point.other, contact.p_W, axis_W);
    row.velocity -= row.J_other.dot(point.other->getSpatialVelocity());
  }
  if (contact.side == ContactSide::kHuman) {
    const double spring = dt_ * contact.skin.stiffness, both = std::max(spring + contact.skin.damping, kNoSkin);
    rows[0].velocity += spring / both * contact.depth / dt_;
    rows[0].softness = 1.0 / (dt_ * both);
    rows[0].cfm = 0.0;
  } else {
    rows[0].velocity += std::min(rigid_.erp * contact.depth / dt_, rigid_.recovery_speed);
    rows[0].cfm = rigid_.cfm;
  }
}

void ContactRows::getInformation(dart::constraint::ConstraintInfo* info) {
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const bool normal = i % 3 == 0;
    const double friction = contacts_[i / 3].friction;
    info->x[i] = 0.0;
    info->w[i] = 0.0;
    info->b[i] = rows_[i].velocity;
    info->lo[i] = normal ? 0.0 : -friction;
    info->hi[i] = normal ? kInfinity : friction;
    info->findex[i] = normal ? -1 : static_cast<int>(i - i % 3);
  }
}

// The constraints of stops read the answer from their joints.
void ContactRows::applyUnitImpulse(std::size_t row) {
  applied_ = row;
  const ContactPoint& contact = contacts_[row / 3];
  for (const int joint : responses_.hinges()) {
    double change = responses_.of_hinge(joint, contact.link) * rows_[row].J;
    if (contact.side == ContactSide::kRobot) change += responses_.of_hinge(joint, contact.other) * rows_[row].J_other;
    responses_.hinge(joint).setVelocityChange(0, change);
  }
}

// With `with_cfm` DART asks for the answer to this constraint's own last impulse, else to another's.
void ContactRows::getVelocityChange(double* change, bool with_cfm) {
  if (with_cfm) answer(applied_);
  const auto answer_of = [&](int link) -> const Eigen::Vector6d& {
    return with_cfm ? answers_[link] : bodies_[link]->getBodyVelocityChange();
  };
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const ContactPoint& contact = contacts_[i / 3];
    change[i] = rows_[i].J.dot(answer_of(contact.link));
    if (contact.side == ContactSide::kRobot) change[i] += rows_[i].J_other.dot(answer_of(contact.other));
  }
  if (!with_cfm) return;
  const Row& row = rows_[applied_];
  change[applied_] += row.cfm * change[applied_] + row.softness;
}

void ContactRows::answer(std::size_t row) {
  const ContactPoint& contact = contacts_[row / 3];
  for (const int link : responses_.links()) {
    answers_[link].noalias() = responses_.of(link, contact.link) * rows_[row].J;
    if (contact.side == ContactSide::kRobot)
      answers_[link].noalias() += responses_.of(link, contact.other) * rows_[row].J_other;
  }
}

void ContactRows::excite() { skeleton_->setImpulseApplied(true); }
void ContactRows::unexcite() { skeleton_->setImpulseApplied(false); }

void ContactRows::applyImpulse(double* impulses) {
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Point& point = points_[i / 3];
    rows_[i].impulse = impulses[i];
    point.body->addConstraintImpulse(rows_[i].J * impulses[i]);
    if (point.other != nullptr) point.other->addConstraintImpulse(rows_[i].J_other * impulses[i]);
  }
}

dart::dynamics::SkeletonPtr ContactRows::getRootSkeleton() const { return ConstraintBase::getRootSkeleton(skeleton_); }

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
