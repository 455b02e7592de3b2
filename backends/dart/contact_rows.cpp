#include "duet/backends/dart/contact_rows.h"

#include <algorithm>
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

}  // namespace duet
