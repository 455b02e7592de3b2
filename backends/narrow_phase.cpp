#include "duet/backends/narrow_phase.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kCoincident = 1e-9;  // [m]
constexpr double kParallel = 1e-6;    // of the squared sine between two axes

// Where the middle of the overlap of [0, 1] and [t0, t1] is, or the end of [0, 1] that is nearest to it.
double middle_of_overlap(double t0, double t1) {
  const double low = std::max(0.0, std::min(t0, t1)), high = std::min(1.0, std::max(t0, t1));
  return std::clamp(0.5 * (low + high), 0.0, 1.0);
}

}  // namespace

Contact reported(const ContactPoint& point, const Eigen::Vector3d& f_W) {
  return {.link = point.link,
          .side = point.side,
          .other = point.other,
          .p_WC = point.p_W,
          .f_W = f_W,
          .depth = point.depth};
}

NearestPoints nearest_points(const Eigen::Vector3d& a1, const Eigen::Vector3d& b1, const Eigen::Vector3d& a2,
                             const Eigen::Vector3d& b2) {
  const Eigen::Vector3d d1 = b1 - a1, d2 = b2 - a2, r = a1 - a2;
  const double dd1 = d1.squaredNorm(), dd2 = d2.squaredNorm(), d12 = d1.dot(d2);
  const double c1 = d1.dot(r), c2 = d2.dot(r);
  if (dd1 < kCoincident * kCoincident) {
    const double t = dd2 < kCoincident * kCoincident ? 0.0 : std::clamp(c2 / dd2, 0.0, 1.0);
    return {a1, a2 + t * d2};
  }
  if (dd2 < kCoincident * kCoincident) return {a1 + std::clamp(-c1 / dd1, 0.0, 1.0) * d1, a2};
  const double determinant = dd1 * dd2 - d12 * d12;
  double s = 0.0;
  if (determinant > kParallel * dd1 * dd2) {
    s = std::clamp((d12 * c2 - c1 * dd2) / determinant, 0.0, 1.0);
  } else {
    s = middle_of_overlap(-c1 / dd1, (d12 - c1) / dd1);
  }
  double t = (d12 * s + c2) / dd2;
  if (t < 0.0 || t > 1.0) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((d12 * t - c1) / dd1, 0.0, 1.0);
  }
  return {a1 + s * d1, a2 + t * d2};
}

NarrowPhase::NarrowPhase(const Scene& scene, std::size_t human_contacts)
    : robot_(scene.robot),
      human_(scene.human),
      mode_(scene.partner),
      friction_(scene.friction),
      self_collision_(scene.self_collision) {
  std::size_t ends = 0;
  for (const RobotShape& shape : robot_->shapes) {
    ends += shape.kind == ShapeKind::kSphere ? 1 : 2;
    R_LS_.push_back(shape.X_LS.R.toRotationMatrix());
    shapes_.push_back({.radius = shape.radius, .reach = shape.radius + shape.half_length});
  }
  capsules_.resize(human_.capsules.size());
  points_.reserve(ends + (self_collision_ ? robot_->self_collision.size() : 0) +
                  (mode_ == PartnerMode::kSolid ? human_contacts : 0));
}

std::span<const ContactPoint> NarrowPhase::collide(const Kinematics& kinematics, const MovingPartner& partner) {
  return collide(kinematics.rotations(), kinematics.positions(), partner);
}

std::span<const ContactPoint> NarrowPhase::collide(std::span<const Eigen::Matrix3d> R_WL,
                                                   std::span<const Eigen::Vector3d> p_WL,
                                                   const MovingPartner& partner) {
  points_.clear();
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    const RobotShape& shape = robot_->shapes[i];
    const Eigen::Matrix3d& R = R_WL[shape.link];
    Segment& segment = shapes_[i];
    segment.center = p_WL[shape.link] + R * shape.X_LS.p;
    const Eigen::Vector3d half = R * (shape.half_length * R_LS_[i].col(2));
    segment.a = segment.center - half;
    segment.b = segment.center + half;
  }
  collide_ground();
  if (self_collision_) collide_self();
  if (mode_ == PartnerMode::kSolid && partner.present) collide_human(partner);
  return points_;
}

void NarrowPhase::add(const ContactPoint& point) {
  if (points_.size() == points_.capacity())
    throw std::runtime_error(fmt::format("more than {} contacts in one step", points_.capacity()));
  points_.push_back(point);
}

void NarrowPhase::collide_ground() {
  const auto touch = [this](int link, const Eigen::Vector3d& center, double radius) {
    const double depth = radius - center.z();
    if (depth <= 0.0) return;
    add({.link = link,
         .p_W = {center.x(), center.y(), -0.5 * depth},
         .n_W = Eigen::Vector3d::UnitZ(),
         .depth = depth,
         .friction = friction_.robot_ground});
  };
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    const Segment& segment = shapes_[i];
    if (segment.center.z() >= segment.reach) continue;
    const RobotShape& shape = robot_->shapes[i];
    touch(shape.link, segment.a, segment.radius);
    if (shape.kind == ShapeKind::kCapsule) touch(shape.link, segment.b, segment.radius);
  }
}

void NarrowPhase::collide_self() {
  for (const auto& [first, second] : robot_->self_collision) {
    const Segment &a = shapes_[first], &b = shapes_[second];
    const double far = a.reach + b.reach;
    if ((a.center - b.center).squaredNorm() > far * far) continue;
    const NearestPoints near = nearest_points(a.a, a.b, b.a, b.b);
    const Eigen::Vector3d apart = near.p1 - near.p2;
    const double distance = apart.norm(), depth = a.radius + b.radius - distance;
    if (depth <= 0.0) continue;
    const Eigen::Vector3d n_W = distance > kCoincident ? Eigen::Vector3d(apart / distance) : Eigen::Vector3d::UnitZ();
    add({.link = robot_->shapes[first].link,
         .side = ContactSide::kRobot,
         .other = robot_->shapes[second].link,
         .p_W = near.p2 + (b.radius - 0.5 * depth) * n_W,
         .n_W = n_W,
         .depth = depth,
         .friction = friction_.robot_robot});
  }
}

void NarrowPhase::collide_human(const MovingPartner& partner) {
  for (std::size_t i = 0; i < capsules_.size(); ++i) {
    const HumanCapsule& capsule = human_.capsules[i];
    const std::array<Eigen::Vector3d, 2> ends = capsule.ends(partner.joints);
    capsules_[i] = {.a = ends[0],
                    .b = ends[1],
                    .center = 0.5 * (ends[0] + ends[1]),
                    .radius = capsule.radius,
                    .reach = capsule.radius + 0.5 * (ends[1] - ends[0]).norm()};
  }
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    const Segment& shape = shapes_[i];
    for (std::size_t k = 0; k < capsules_.size(); ++k) {
      const Segment& capsule = capsules_[k];
      const double far = shape.reach + capsule.reach;
      if ((shape.center - capsule.center).squaredNorm() > far * far) continue;
      const NearestPoints near = nearest_points(shape.a, shape.b, capsule.a, capsule.b);
      const Eigen::Vector3d apart = near.p1 - near.p2;
      const double distance = apart.norm(), depth = shape.radius + capsule.radius - distance;
      if (depth <= 0.0) continue;
      const Eigen::Vector3d n_W = distance > kCoincident ? Eigen::Vector3d(apart / distance) : Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d p_W = near.p2 + (capsule.radius - 0.5 * depth) * n_W;
      add({.link = robot_->shapes[i].link,
           .side = ContactSide::kHuman,
           .other = static_cast<int>(k),
           .p_W = p_W,
           .n_W = n_W,
           .depth = depth,
           .friction = friction_.robot_human,
           .skin = human_.capsules[k].skin,
           .v_other_W = capsule_velocity(human_.capsules[k], partner, p_W)});
    }
  }
}

namespace {

constexpr double kShortest = 1e-9;  // [m]

}  // namespace

void MovingPartner::set(const HumanJoints& new_joints, const HumanJoints& new_velocities) {
  present = true;
  joints = new_joints;
  velocities = new_velocities;
}

void MovingPartner::append_to(std::vector<double>& values) const {
  values.push_back(present ? 1.0 : 0.0);
  values.insert(values.end(), joints.data(), joints.data() + joints.size());
  values.insert(values.end(), velocities.data(), velocities.data() + velocities.size());
}

void MovingPartner::read_from(std::span<const double> values) {
  present = values[0] != 0.0;
  std::copy_n(values.data() + 1, joints.size(), joints.data());
  std::copy_n(values.data() + 1 + joints.size(), velocities.size(), velocities.data());
}

CapsulePose capsule_pose(const HumanCapsule& capsule, const HumanJoints& joints) {
  const std::array<Eigen::Vector3d, 2> ends = capsule.ends(joints);
  const Eigen::Vector3d axis = ends[1] - ends[0];
  const double length = axis.norm();
  const Eigen::Vector3d p_WC = 0.5 * (ends[0] + ends[1]);
  if (length < kShortest) return {{Eigen::Quaterniond::Identity(), p_WC}, 0.0};  // two joints in one place: a sphere
  return {{Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), axis), p_WC}, 0.5 * length};
}

Eigen::Vector3d capsule_velocity(const HumanCapsule& capsule, const MovingPartner& partner,
                                 const Eigen::Vector3d& p_W) {
  const std::array<Eigen::Vector3d, 2> ends = capsule.ends(partner.joints);
  const std::array<Eigen::Vector3d, 2> end_velocities = capsule.ends(partner.velocities);
  const Eigen::Vector3d axis = ends[1] - ends[0];
  const double length_squared = axis.squaredNorm();
  const double along = length_squared > 0.0 ? axis.dot(p_W - ends[0]) / length_squared : 0.0;
  return end_velocities[0] + std::clamp(along, 0.0, 1.0) * (end_velocities[1] - end_velocities[0]);
}

namespace {

ContactPoint deepest(const Scene& scene, const RobotState& state, const MovingPartner& partner, bool with_human) {
  Kinematics kinematics(*scene.robot);
  kinematics.update(state.X_WB, state.q);
  NarrowPhase narrow_phase(scene, scene.robot->shapes.size() * scene.human.capsules.size());
  ContactPoint found;
  for (const ContactPoint& point : narrow_phase.collide(kinematics, partner))
    if ((point.side == ContactSide::kHuman) == with_human && point.depth > found.depth) found = point;
  return found;
}

}  // namespace

void refuse_robot_overlap(const Scene& scene, const RobotState& state) {
  const ContactPoint point = deepest(scene, state, {}, false);
  if (point.depth <= kRobotOverlap) return;
  const std::vector<RobotLink>& links = scene.robot->links;
  if (point.side == ContactSide::kGround)
    throw std::invalid_argument(
        fmt::format("Backend::reset: {} is {:.3f} m below the ground", links[point.link].name, point.depth));
  throw std::invalid_argument(fmt::format("Backend::reset: {} and {} overlap by {:.3f} m", links[point.link].name,
                                          links[point.other].name, point.depth));
}

namespace {

ContactPoint deepest_in_partner(const Scene& scene, const RobotState& state, const HumanJoints& joints) {
  MovingPartner partner;
  partner.set(joints, HumanJoints::Zero());
  return deepest(scene, state, partner, true);
}

}  // namespace

bool is_in_partner(const Scene& scene, const RobotState& state, const HumanJoints& joints) {
  return scene.partner == PartnerMode::kSolid && deepest_in_partner(scene, state, joints).depth > kPartnerOverlap;
}

void refuse_partner_overlap(const Scene& scene, const RobotState& state, const HumanJoints& joints) {
  if (!is_in_partner(scene, state, joints)) return;
  const ContactPoint point = deepest_in_partner(scene, state, joints);
  throw std::invalid_argument(
      fmt::format("Backend::set_partner: {} (region {}) of the partner and {} overlap by {:.3f} m",
                  scene.human.capsules[point.other].name, scene.human.capsules[point.other].region,
                  scene.robot->links[point.link].name, point.depth));
}

}  // namespace duet
