#include "duet/backends/contact_solver.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>

namespace duet {
namespace {

// Found by hand on the conformance scenes and on a G1 that stands, tips over and thrashes: large enough that these
// settle, small enough that their tolerances hold. Nobody has swept them.
constexpr std::size_t kDirect = 16;       // contacts whose linear system is formed
constexpr double kRegularisation = 1e-7;  // of the inverse inertia: coplanar contacts share the load
constexpr double kSettled = 1e-9;         // change of velocity in a sweep [m/s]
constexpr int kFirstGuess = 4;            // sweeps before the first, each next one after twice as many
constexpr int kTurns = 4;                 // of corrections, per guess
constexpr double kOpening = 1e-9;         // approach of an open contact [m/s]
constexpr double kSlip = 1e-5;            // that has a direction [m/s]
constexpr double kSoftest = 1e-9;         // h K + D of a spring and damper of nothing [N s/m]
constexpr double kDirection = 3e-3;       // of slip [rad], and of a share of the cone

// Nearest point of the disc with this radius.
Eigen::Vector2d clipped(const Eigen::Vector2d& p, double radius) {
  const double norm = p.norm();
  return norm <= radius ? p : Eigen::Vector2d(radius / norm * p);
}

bool in_cone(const Eigen::Vector3d& p, double friction) {
  return p.x() >= 0.0 && p.tail<2>().squaredNorm() <= friction * friction * p.x() * p.x();
}

// In place, without pivots: the systems here are close to positive definite. False where one is not.
bool solve_in_place(Eigen::Ref<Eigen::MatrixXd> A, Eigen::Ref<Eigen::VectorXd> x) {
  const Eigen::Index n = x.size();
  for (Eigen::Index k = 0; k < n; ++k) {
    if (!(A(k, k) > 0.0)) return false;
    const Eigen::Index below = n - k - 1;
    A.col(k).tail(below) /= A(k, k);
    x.tail(below) -= x[k] * A.col(k).tail(below);
    for (Eigen::Index j = k + 1; j < n; ++j) A.col(j).tail(below) -= A(k, j) * A.col(k).tail(below);
  }
  for (Eigen::Index k = n - 1; k >= 0; --k) {
    x[k] /= A(k, k);
    x.head(k) -= x[k] * A.col(k).head(k);
  }
  return true;
}

double largest_eigenvalue(const Eigen::Matrix2d& m) {
  const double mean = 0.5 * (m(0, 0) + m(1, 1)), half = 0.5 * (m(0, 0) - m(1, 1));
  return mean + std::sqrt(half * half + m(0, 1) * m(0, 1));
}

}  // namespace

ConstraintSoftness spring_damper(double stiffness, double damping, double dt) {
  const double both = std::max(dt * stiffness + damping, kSoftest);
  return {.erp = dt * stiffness / both, .cfm = 1.0 / both};
}

ContactSolver::ContactSolver(const RobotModel& robot, std::size_t contacts, double dt, int sweeps)
    : robot_(&robot), dt_(dt), sweeps_(sweeps), rows_(contacts + robot.joints.size()) {
  const int n = 6 + robot.dof();
  for (Row& row : rows_) {
    row.support.reserve(2 * n);
    row.J = TreeFactor::Triple::Zero(n, 3);
    row.Y = TreeFactor::Triple::Zero(n, 3);
  }
  const int direct = static_cast<int>(3 * std::min(rows_.size(), kDirect));
  G_ = system_ = Eigen::MatrixXd::Zero(direct, direct);
  unknowns_ = p_ = missing_ = change_of_rows_ = Eigen::VectorXd::Zero(direct);
  half_ = generalized_ = change_ = Eigen::VectorXd::Zero(n);
}

void ContactSolver::clear() { used_ = 0; }

ContactSolver::Row& ContactSolver::next_row(const ConstraintSoftness& softness) {
  Row& row = rows_[used_++];
  for (const int k : row.support) {
    row.J.row(k).setZero();
    row.Y.row(k).setZero();
  }
  row.support.clear();
  row.axes_W.setIdentity();
  row.target.setZero();
  row.p.setZero();
  row.friction = 0.0;
  row.compliance = softness.cfm / dt_;
  return row;
}

void ContactSolver::add(const ContactPoint& point, const ConstraintSoftness& softness,
                        std::span<const Eigen::Matrix3d> R_WL, std::span<const Eigen::Vector3d> p_WL) {
  Row& row = next_row(softness);
  row.axes_W.col(0) = point.n_W;
  row.axes_W.col(1) = point.n_W.unitOrthogonal();
  row.axes_W.col(2) = point.n_W.cross(row.axes_W.col(1));
  row.friction = point.friction;
  row.target.noalias() = row.axes_W.transpose() * point.v_other_W;
  row.target.x() += softness.erp * point.depth / dt_;
  add_link(row, point.link, 1.0, point.p_W, R_WL, p_WL);
  if (point.side != ContactSide::kRobot) return;
  add_link(row, point.other, -1.0, point.p_W, R_WL, p_WL);
  std::sort(row.support.begin(), row.support.end(), std::greater<>());
  row.support.erase(std::unique(row.support.begin(), row.support.end()), row.support.end());
}

void ContactSolver::add_link(Row& row, int link, double sign, const Eigen::Vector3d& p_W,
                             std::span<const Eigen::Matrix3d> R_WL, std::span<const Eigen::Vector3d> p_WL) const {
  for (int i = link; i > 0; i = robot_->links[i].parent) {
    const Eigen::Vector3d axis_W = R_WL[i] * robot_->links[i].axis;
    row.J.row(5 + i).noalias() += sign * axis_W.cross(p_W - p_WL[i]).transpose() * row.axes_W;
    row.support.push_back(5 + i);
  }
  const Eigen::Vector3d arm = p_W - p_WL[0];
  row.J.topRows<3>() += sign * row.axes_W;
  for (int k = 0; k < 3; ++k) row.J.block<3, 1>(3, k) += sign * (R_WL[0].transpose() * arm.cross(row.axes_W.col(k)));
  for (int k = 5; k >= 0; --k) row.support.push_back(k);
}

void ContactSolver::add_stop(int joint, double side, double depth, const ConstraintSoftness& softness) {
  Row& row = next_row(softness);
  row.J(6 + joint, 0) = side;
  for (int i = joint + 1; i > 0; i = robot_->links[i].parent) row.support.push_back(5 + i);
  for (int k = 5; k >= 0; --k) row.support.push_back(k);
  row.target.x() = (depth > 0.0 ? softness.erp : 1.0) * depth / dt_;
}

void ContactSolver::solve(const TreeFactor& factor, Eigen::VectorXd& v) {
  generalized_.setZero();
  if (used_ == 0) return;
  project(factor, v);
  if (!stick()) slide();
  for (std::size_t i = 0; i < used_; ++i)
    for (const int k : rows_[i].support) generalized_[k] += rows_[i].J.row(k).dot(rows_[i].p);
  change_ = generalized_;
  factor.solve(change_);
  v += change_;
}

void ContactSolver::project(const TreeFactor& factor, const Eigen::VectorXd& v) {
  for (std::size_t i = 0; i < used_; ++i) {
    Row& row = rows_[i];
    row.missing = row.target;
    for (const int k : row.support) {
      row.Y.row(k) = row.J.row(k);
      row.missing -= v[k] * row.J.row(k).transpose();
    }
    factor.half_solve(row.support, row.Y);
    row.inverse.setZero();
    for (const int k : row.support) row.inverse.noalias() += row.Y.row(k).transpose() * row.Y.row(k);
  }
}

void ContactSolver::assemble() {
  for (std::size_t i = 0; i < used_; ++i) {
    const Row& a = rows_[i];
    const int ia = static_cast<int>(3 * i);
    for (std::size_t j = 0; j < i; ++j) {
      const int jb = static_cast<int>(3 * j);
      Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
      for (const int k : a.support) block.noalias() += a.Y.row(k).transpose() * rows_[j].Y.row(k);
      G_.block<3, 3>(ia, jb) = block;
      G_.block<3, 3>(jb, ia) = block.transpose();
    }
    G_.block<3, 3>(ia, ia) = a.inverse;
    G_.diagonal().segment<3>(ia).array() += kRegularisation * a.inverse(0, 0);
    G_(ia, ia) += a.compliance;
    missing_.segment<3>(ia) = a.missing;
  }
}

// False where a contact then pulls or leaves its cone; the rows hold the impulses of that all the same.
bool ContactSolver::stick() {
  for (std::size_t i = 0; i < used_; ++i) rows_[i].p.setZero();
  if (used_ > kDirect) return false;
  assemble();
  const int size = static_cast<int>(3 * used_);
  system_.topLeftCorner(size, size) = G_.topLeftCorner(size, size);
  Eigen::Ref<Eigen::MatrixXd> system = system_.topLeftCorner(size, size);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(system);
  p_.head(size) = missing_.head(size);
  Eigen::Ref<Eigen::VectorXd> p = p_.head(size);
  factor.solveInPlace(p);
  bool holds = true;
  for (std::size_t i = 0; i < used_; ++i) {
    rows_[i].p = p.segment<3>(static_cast<int>(3 * i));
    holds = holds && in_cone(rows_[i].p, rows_[i].friction);
  }
  return holds;
}

void ContactSolver::slide() {
  for (std::size_t i = 0; i < used_; ++i) {
    Row& row = rows_[i];
    row.p.x() = std::max(0.0, row.p.x());
    row.p.tail<2>() = clipped(row.p.tail<2>(), row.friction * row.p.x());
  }
  write_half();
  int guess = kFirstGuess;
  for (int i = 1; i <= sweeps_; ++i) {
    if (sweep() < kSettled) return;
    if (i < guess || used_ > kDirect) continue;
    guess *= 2;
    if (settle()) return;
  }
}

void ContactSolver::write_half() {
  half_.setZero();
  for (std::size_t i = 0; i < used_; ++i)
    for (const int k : rows_[i].support) half_[k] += rows_[i].Y.row(k).dot(rows_[i].p);
}

// True where the impulses that follow from what each contact does agree with it; else nothing changes.
bool ContactSolver::settle() {
  guess_modes();
  for (int turn = 0; turn < kTurns; ++turn) {
    if (!solve_modes()) return false;
    if (!correct_modes()) continue;
    for (std::size_t i = 0; i < used_; ++i) rows_[i].p = p_.segment<3>(static_cast<int>(3 * i));
    return true;
  }
  return false;
}

void ContactSolver::guess_modes() {
  for (std::size_t i = 0; i < used_; ++i) {
    Row& row = rows_[i];
    const double drag = row.p.tail<2>().norm(), most = row.friction * row.p.x();
    row.mode = row.p.x() <= 0.0 ? Mode::kOpen : drag < (1.0 - kDirection) * most ? Mode::kStick : Mode::kSlide;
    row.drag = drag > 0.0 ? Eigen::Vector2d(row.p.tail<2>() / drag) : Eigen::Vector2d::Zero();
  }
}

// A sliding contact's friction is its normal impulse times friction along `drag`: one column.
bool ContactSolver::solve_modes() {
  const int size = static_cast<int>(3 * used_);
  int unknowns = 0;
  for (std::size_t i = 0; i < used_; ++i) {
    rows_[i].at = unknowns;
    unknowns += rows_[i].mode == Mode::kOpen ? 0 : rows_[i].mode == Mode::kStick ? 3 : 1;
  }
  for (std::size_t j = 0; j < used_; ++j) {
    const Row& b = rows_[j];
    if (b.mode == Mode::kOpen) continue;
    const int jb = static_cast<int>(3 * j), columns = b.mode == Mode::kStick ? 3 : 1;
    for (std::size_t i = 0; i < used_; ++i) {
      const Row& a = rows_[i];
      if (a.mode == Mode::kOpen) continue;
      const int ia = static_cast<int>(3 * i), lines = a.mode == Mode::kStick ? 3 : 1;
      system_.block(a.at, b.at, lines, columns) = G_.block(ia, jb, lines, columns);
      if (columns == 1)
        system_.col(b.at).segment(a.at, lines) += b.friction * (b.drag.x() * G_.col(jb + 1).segment(ia, lines) +
                                                                b.drag.y() * G_.col(jb + 2).segment(ia, lines));
    }
    unknowns_.segment(b.at, columns) = missing_.segment(jb, columns);
  }
  if (!solve_in_place(system_.topLeftCorner(unknowns, unknowns), unknowns_.head(unknowns))) return false;
  for (std::size_t i = 0; i < used_; ++i) {
    const Row& row = rows_[i];
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    if (row.mode == Mode::kStick) p = unknowns_.segment<3>(row.at);
    if (row.mode == Mode::kSlide) p << unknowns_[row.at], row.friction * unknowns_[row.at] * row.drag;
    p_.segment<3>(static_cast<int>(3 * i)) = p;
  }
  change_of_rows_.head(size).noalias() = G_.topLeftCorner(size, size) * p_.head(size);
  return true;
}

// True where nothing was to be corrected.
bool ContactSolver::correct_modes() {
  bool held = true;
  for (std::size_t i = 0; i < used_; ++i) {
    Row& row = rows_[i];
    const int ia = static_cast<int>(3 * i);
    const Eigen::Vector3d p = p_.segment<3>(ia), missing = row.missing - change_of_rows_.segment<3>(ia);
    const Mode mode = row.mode;
    if (mode == Mode::kOpen) {
      if (missing.x() > kOpening) row.mode = row.friction > 0.0 ? Mode::kStick : Mode::kSlide;
    } else if (p.x() < 0.0) {
      row.mode = Mode::kOpen;
    } else if (mode == Mode::kStick) {
      if (!in_cone(p, row.friction)) {
        row.mode = Mode::kSlide;
        row.drag = p.tail<2>().normalized();
      }
    } else if (row.friction > 0.0 && missing.tail<2>().norm() > kSlip) {
      const Eigen::Vector2d drag = missing.tail<2>().normalized();
      if (drag.dot(row.drag) < 0.0) row.mode = Mode::kStick;
      held = held && (drag - row.drag).norm() < kDirection;
      row.drag = drag;
    }
    held = held && row.mode == mode;
  }
  return held;
}

// Each contact in turn finds its own impulse, the others' given. The largest change of velocity along a row [m/s].
double ContactSolver::sweep() {
  double largest = 0.0;
  for (std::size_t i = 0; i < used_; ++i) {
    Row& row = rows_[i];
    Eigen::Vector3d missing = row.missing;
    for (const int k : row.support) missing -= half_[k] * row.Y.row(k).transpose();
    const Eigen::Vector3d before = row.p;
    const double normal = row.inverse(0, 0) + row.compliance;
    row.p.x() = std::max(0.0, row.p.x() + (missing.x() - row.compliance * row.p.x()) / normal);
    if (row.friction > 0.0) {
      const Eigen::Matrix2d tangential = row.inverse.bottomRightCorner<2, 2>();
      const Eigen::Vector2d slip = missing.tail<2>() - (row.p.x() - before.x()) * row.inverse.block<2, 1>(1, 0);
      const Eigen::Vector2d held = row.p.tail<2>() + tangential.inverse() * slip;
      const double radius = row.friction * row.p.x();
      row.p.tail<2>() =
          held.norm() <= radius ? held : clipped(row.p.tail<2>() + slip / largest_eigenvalue(tangential), radius);
    }
    const Eigen::Vector3d by = row.p - before;
    for (const int k : row.support) half_[k] += row.Y.row(k).dot(by);
    largest = std::max(largest, by.cwiseAbs().maxCoeff() * normal);
  }
  return largest;
}

}  // namespace duet
