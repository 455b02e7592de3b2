#include "duet/backends/ode/contact_forecast.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>

namespace duet {
namespace {

constexpr int kUsualRows = 39;
constexpr std::size_t kUsualParts = 16;
constexpr int kPivots = 12;
constexpr double kSlow = 1e-9;      // a slip without direction [m/s]
constexpr double kRounding = 1e-9;  // of the largest impulse, and of the velocities wanted

// x <- A^-1 x by elimination with partial pivoting; A is overwritten. False where A is singular.
bool eliminate(Eigen::Ref<Eigen::MatrixXd> A, Eigen::Ref<Eigen::VectorXd> x) {
  const Eigen::Index n = A.rows();
  for (Eigen::Index k = 0; k < n; ++k) {
    Eigen::Index pivot = 0;
    if (!(A.col(k).tail(n - k).cwiseAbs().maxCoeff(&pivot) > 0.0)) return false;
    pivot += k;
    if (pivot != k) {
      A.row(k).swap(A.row(pivot));
      std::swap(x[k], x[pivot]);
    }
    const double inverse = 1.0 / A(k, k);
    for (Eigen::Index j = k + 1; j < n; ++j) {
      const double factor = A(k, j) * inverse;
      A.col(j).tail(n - k - 1) -= factor * A.col(k).tail(n - k - 1);
      A(k, j) = factor;
    }
    x[k] *= inverse;
    x.tail(n - k - 1) -= x[k] * A.col(k).tail(n - k - 1);
  }
  for (Eigen::Index k = n - 1; k > 0; --k) x.head(k) -= x[k] * A.col(k).head(k);
  return true;
}

}  // namespace

ContactForecast::ContactForecast(const RobotModel& robot, std::size_t contacts, double dt, int sweeps)
    : robot_(&robot), dt_(dt), sweeps_(sweeps), stop_impulses_(robot.dof()) {
  const std::size_t most = contacts + robot.joints.size();
  while (parts_.size() < std::min(kUsualParts, most)) parts_.push_back(new_part());
  rows_.reserve(3 * most);
  free_.reserve(3 * most);
  change_ = Eigen::VectorXd::Zero(6 + robot.dof());
  reserve(std::min(kUsualRows, static_cast<int>(3 * most)));
}

ContactForecast::Part ContactForecast::new_part() const {
  const int n = 6 + robot_->dof();
  Part part;
  part.support.reserve(2 * n);
  part.J = part.Y = TreeFactor::Triple::Zero(n, 3);
  return part;
}

void ContactForecast::reserve(int rows) {
  if (rows <= G_.rows()) return;
  G_.setZero(rows, rows);
  work_.setZero(rows, rows);
  missing_.setZero(rows);
  p_.setZero(rows);
  reduced_.setZero(rows);
  swept_.setZero(rows);
}

void ContactForecast::clear() {
  used_ = 0;
  rows_.clear();
  std::fill(stop_impulses_.begin(), stop_impulses_.end(), 0.0);
}

ContactForecast::Part& ContactForecast::next_part() {
  if (used_ == parts_.size()) parts_.push_back(new_part());
  Part& part = parts_[used_++];
  for (const int k : part.support) {
    part.J.row(k).setZero();
    part.Y.row(k).setZero();
  }
  part.support.clear();
  part.axes_W.setIdentity();
  part.row = static_cast<int>(rows_.size());
  part.rows = 0;
  part.joint = -1;
  return part;
}

void ContactForecast::add_row(Part& part, double friction, double compliance, double target) {
  rows_.push_back({.normal = part.rows == 0 ? -1 : part.row,
                   .friction = friction,
                   .compliance = compliance / dt_,
                   .target = target});
  ++part.rows;
}

void ContactForecast::add(const ContactPoint& point, const ConstraintSoftness& normal, double tangential,
                          std::span<const Eigen::Matrix3d> R_WL, std::span<const Eigen::Vector3d> p_WL,
                          const Eigen::VectorXd& v0) {
  Part& part = next_part();
  add_link(part, point.link, 1.0, point.p_W, R_WL, p_WL);
  if (point.side == ContactSide::kRobot) {
    add_link(part, point.other, -1.0, point.p_W, R_WL, p_WL);
    std::sort(part.support.begin(), part.support.end(), std::greater<>());
    part.support.erase(std::unique(part.support.begin(), part.support.end()), part.support.end());
  }
  Eigen::Vector3d slip = -point.v_other_W;
  for (const int k : part.support) slip += v0[k] * part.J.row(k).transpose();
  slip -= slip.dot(point.n_W) * point.n_W;
  const double speed = slip.norm();
  part.axes_W.col(0) = point.n_W;
  part.axes_W.col(1) = speed > kSlow ? Eigen::Vector3d(slip / speed) : point.n_W.unitOrthogonal();
  part.axes_W.col(2) = point.n_W.cross(part.axes_W.col(1));
  for (const int k : part.support) part.J.row(k) = (part.J.row(k) * part.axes_W).eval();
  const Eigen::Vector3d other = part.axes_W.transpose() * point.v_other_W;
  add_row(part, 0.0, normal.cfm, other.x() + normal.erp * point.depth / dt_);
  if (point.friction == 0.0) return;
  add_row(part, point.friction, tangential, other.y());
  add_row(part, point.friction, tangential, other.z());
}

// Adds the velocity of the link's point at p_W, in W.
void ContactForecast::add_link(Part& part, int link, double sign, const Eigen::Vector3d& p_W,
                               std::span<const Eigen::Matrix3d> R_WL, std::span<const Eigen::Vector3d> p_WL) const {
  for (int i = link; i > 0; i = robot_->links[i].parent) {
    const Eigen::Vector3d axis_W = R_WL[i] * robot_->links[i].axis;
    part.J.row(5 + i) += sign * axis_W.cross(p_W - p_WL[i]).transpose();
    part.support.push_back(5 + i);
  }
  const Eigen::Vector3d arm = p_W - p_WL[0];
  part.J.topRows<3>() += sign * Eigen::Matrix3d::Identity();
  for (int k = 0; k < 3; ++k) part.J.row(3 + k) += sign * R_WL[0].col(k).cross(arm).transpose();
  for (int k = 5; k >= 0; --k) part.support.push_back(k);
}

void ContactForecast::add_stop(int joint, double side, double depth, const ConstraintSoftness& softness) {
  Part& part = next_part();
  part.joint = joint;
  part.side = side;
  part.J(6 + joint, 0) = side;
  for (int i = joint + 1; i > 0; i = robot_->links[i].parent) part.support.push_back(5 + i);
  for (int k = 5; k >= 0; --k) part.support.push_back(k);
  add_row(part, 0.0, softness.cfm, softness.erp * depth / dt_);
}

Eigen::Vector3d ContactForecast::impulse(std::size_t i) const {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int k = 0; k < parts_[i].rows; ++k) p[k] = p_[parts_[i].row + k];
  return p;
}

void ContactForecast::solve(const TreeFactor& factor, Eigen::VectorXd& v) {
  if (used_ == 0) return;
  project(factor, v);
  for (Row& row : rows_) row.mode = Mode::kFree;
  if (!pivot()) settle();
  change_.setZero();
  for (std::size_t i = 0; i < used_; ++i) {
    const Part& part = parts_[i];
    const Eigen::Vector3d p = impulse(i);
    for (const int k : part.support) change_[k] += part.J.row(k).dot(p);
    if (part.joint >= 0) stop_impulses_[part.joint] = part.side * p.x();
  }
  factor.solve(change_);
  v += change_;
}

void ContactForecast::project(const TreeFactor& factor, const Eigen::VectorXd& v0) {
  reserve(static_cast<int>(rows_.size()));
  for (std::size_t i = 0; i < used_; ++i) {
    Part& part = parts_[i];
    Eigen::Vector3d moving = Eigen::Vector3d::Zero();
    for (const int k : part.support) {
      part.Y.row(k) = part.J.row(k);
      moving += v0[k] * part.J.row(k).transpose();
    }
    for (int k = 0; k < part.rows; ++k) missing_[part.row + k] = rows_[part.row + k].target - moving[k];
    factor.half_solve(part.support, part.Y);
    for (std::size_t j = 0; j <= i; ++j) {
      const Part& other = parts_[j];
      Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
      for (const int k : part.support) block.noalias() += part.Y.row(k).transpose() * other.Y.row(k);
      for (int b = 0; b < other.rows; ++b) {
        for (int a = 0; a < part.rows; ++a) {
          G_(part.row + a, other.row + b) = block(a, b);
          G_(other.row + b, part.row + a) = block(a, b);
        }
      }
    }
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Eigen::Index k = static_cast<Eigen::Index>(r);
    G_(k, k) += rows_[r].compliance;
  }
}

// Gauss-Seidel finds out which rows are free; what they hold is then exact where pivoting ends, else its own.
void ContactForecast::settle() {
  gauss_seidel();
  swept_ = p_;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    Row& row = rows_[r];
    const double p = p_[static_cast<Eigen::Index>(r)];
    if (row.normal < 0)
      row.mode = p > 0.0 ? Mode::kFree : Mode::kZero;
    else if (rows_[row.normal].mode == Mode::kZero)
      row.mode = Mode::kZero;
    else if (std::abs(p) < bound(row))
      row.mode = Mode::kFree;
    else
      row.mode = p > 0.0 ? Mode::kHigh : Mode::kLow;
  }
  if (!pivot()) p_ = swept_;
}

bool ContactForecast::pivot() {
  for (int i = 0; i < kPivots; ++i) {
    if (!solve_free_rows()) return false;
    if (!change_modes()) return true;
  }
  return false;
}

// The impulses of the free rows, those at a bound following the normal impulse of their contact.
bool ContactForecast::solve_free_rows() {
  const int rows = static_cast<int>(rows_.size());
  free_.clear();
  bool symmetric = true;
  for (int r = 0; r < rows; ++r) {
    if (rows_[r].mode == Mode::kFree) free_.push_back(r);
    symmetric = symmetric && (rows_[r].mode == Mode::kFree || rows_[r].mode == Mode::kZero);
  }
  const int n = static_cast<int>(free_.size());
  Eigen::Ref<Eigen::MatrixXd> A = work_.topLeftCorner(n, n);
  Eigen::Ref<Eigen::VectorXd> x = reduced_.head(n);
  for (int j = 0; j < n; ++j) {
    const int column = free_[j];
    x[j] = missing_[column];
    for (int i = 0; i < n; ++i) A(i, j) = G_(free_[i], column);
    for (int t = column + 1; !symmetric && t < rows && rows_[t].normal == column; ++t) {
      if (rows_[t].mode != Mode::kHigh && rows_[t].mode != Mode::kLow) continue;
      const double slope = rows_[t].mode == Mode::kHigh ? rows_[t].friction : -rows_[t].friction;
      for (int i = 0; i < n; ++i) A(i, j) += slope * G_(free_[i], t);
    }
  }
  if (symmetric) {
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(A);
    if (factor.info() != Eigen::Success) return false;
    factor.solveInPlace(x);
  } else if (!eliminate(A, x)) {
    return false;
  }
  p_.head(rows).setZero();
  for (int j = 0; j < n; ++j) p_[free_[j]] = x[j];
  for (int r = 0; r < rows; ++r) {
    if (rows_[r].mode == Mode::kHigh) p_[r] = rows_[r].friction * p_[rows_[r].normal];
    if (rows_[r].mode == Mode::kLow) p_[r] = -rows_[r].friction * p_[rows_[r].normal];
  }
  return true;
}

// Moves every row that breaks its law to the side on which it does; normal ones once friction has settled. False: none
// does.
bool ContactForecast::change_modes() {
  const int rows = static_cast<int>(rows_.size());
  small_ = kRounding * p_.head(rows).cwiseAbs().maxCoeff();
  slow_ = kRounding * missing_.head(rows).cwiseAbs().maxCoeff();
  bool changed = false;
  for (const bool normal : {false, true}) {
    for (int r = 0; r < rows; ++r) {
      if ((rows_[r].normal < 0) != normal) continue;
      const Mode mode = normal ? normal_mode(r) : tangential_mode(r);
      changed = changed || mode != rows_[r].mode;
      rows_[r].mode = mode;
    }
    if (changed) return true;
  }
  return false;
}

double ContactForecast::still_missing(int row) const {
  const Eigen::Index rows = static_cast<Eigen::Index>(rows_.size());
  return missing_[row] - G_.col(row).head(rows).dot(p_.head(rows));
}

ContactForecast::Mode ContactForecast::normal_mode(int row) const {
  if (rows_[row].mode == Mode::kFree) return p_[row] < -small_ ? Mode::kZero : Mode::kFree;
  return still_missing(row) > slow_ ? Mode::kFree : Mode::kZero;
}

ContactForecast::Mode ContactForecast::tangential_mode(int row) const {
  const Mode mode = rows_[row].mode;
  if (rows_[rows_[row].normal].mode == Mode::kZero) return Mode::kZero;
  if (mode == Mode::kHigh) return still_missing(row) < -slow_ ? Mode::kFree : mode;
  if (mode == Mode::kLow) return still_missing(row) > slow_ ? Mode::kFree : mode;
  const double most = bound(rows_[row]) + small_;
  if (p_[row] > most) return Mode::kHigh;
  return p_[row] < -most ? Mode::kLow : Mode::kFree;
}

void ContactForecast::gauss_seidel() {
  const int rows = static_cast<int>(rows_.size());
  p_.head(rows).setZero();
  for (int sweep = 0; sweep < sweeps_; ++sweep) {
    for (int r = 0; r < rows; ++r) {
      const double missing = missing_[r] - G_.col(r).head(rows).dot(p_.head(rows));
      const double p = p_[r] + missing / G_(r, r);
      p_[r] = rows_[r].normal < 0 ? std::max(0.0, p) : std::clamp(p, -bound(rows_[r]), bound(rows_[r]));
    }
  }
}

}  // namespace duet
