#include "duet/hardware/safety/contact_watch.h"

#include <algorithm>
#include <cmath>

#include "duet/backends/narrow_phase.h"
#include "duet/core/require.h"

namespace duet {
namespace {

const RobotModel& with_arms(const std::shared_ptr<const RobotModel>& robot) {
  require(robot != nullptr, "contact watch: expected a robot, found none");
  require(!robot->roles.arms[0].empty() && !robot->roles.arms[1].empty(),
          "contact watch: expected a card with two arms, found none in '{}'", robot->name);
  return *robot;
}

}  // namespace

ContactWatch::ContactWatch(std::shared_ptr<const RobotModel> robot, const HardwareLimits& limits, double least_force,
                           double dt)
    : robot_(std::move(robot)), limits_(limits), least_force_(least_force), dynamics_(with_arms(robot_)) {
  require(dt > 0.0, "contact watch: expected a dt above 0 s, found {}", dt);
  require(least_force >= 0.0, "contact watch: expected a force of at least 0 N, found {}", least_force);
  ticks_to_count_ = static_cast<int>(std::ceil(limits.contact_time / dt - 1e-9));
  bias_.setZero(6 + robot_->dof());
  still_.v.setZero(robot_->dof());
  still_.q.setZero(robot_->dof());
  is_wrist_.assign(robot_->joints.size(), false);
  for (const int joint : robot_->roles.wrists) is_wrist_[joint] = true;
  ticks_.assign(robot_->joints.size(), 0);
}

double ContactWatch::threshold(int joint) const {
  return is_wrist_[joint] ? limits_.wrist_torque : limits_.shoulder_torque;
}

ContactReading ContactWatch::update(const RobotState& state, const Eigen::VectorXd& tau) {
  still_.X_WB = state.X_WB;
  still_.q = state.q;
  dynamics_.bias_forces(still_, bias_);  // of gravity: arms move slowly
  ContactReading reading;
  for (const std::vector<int>& arm : robot_->roles.arms) {
    double largest = 0.0;
    for (const int joint : arm) {
      const double beyond = std::abs(tau[joint] - bias_[6 + joint]);
      ticks_[joint] = beyond > threshold(joint) ? ticks_[joint] + 1 : 0;
      reading.touch = reading.touch || ticks_[joint] >= ticks_to_count_;
      if (ticks_[joint] < ticks_to_count_) continue;
      if (!is_wrist_[joint]) largest = std::max(largest, beyond);
      reading.release = reading.release || std::abs(tau[joint]) > limits_.release_effort * robot_->joints[joint].effort;
    }
    reading.force += largest / limits_.contact_lever;
  }
  const bool too_much = least_force_ > 0.0 ? reading.force > limits_.release_force * least_force_ : reading.touch;
  reading.release = reading.release || too_much;
  return reading;
}

double least_touch_force(const std::vector<TouchPair>& touches, const ContactLimits& limits) {
  double least = 0.0;
  for (const TouchPair& touch : touches) {
    const RegionLimits& region = limits.region(touch.human);
    require(region.quasi_static_n.has_value(), "contact limits of region '{}': expected quasi_static_n, found none",
            touch.human);
    least = least == 0.0 ? *region.quasi_static_n : std::min(least, *region.quasi_static_n);
  }
  return least;
}

namespace {

bool is_head_region(const std::string& region) { return region == "head" || region == "neck"; }

void check_touch(const RobotModel& robot, const HumanBody& human, const TouchPair& touch) {
  const bool robot_has = std::ranges::any_of(robot.shapes, [&](const auto& s) { return s.region == touch.robot; });
  const bool human_has = std::ranges::any_of(human.capsules, [&](const auto& c) { return c.region == touch.human; });
  require(robot_has, "touch: expected a region of robot '{}', found '{}'", robot.name, touch.robot);
  require(human_has, "touch: expected a region of a person, found '{}'", touch.human);
  require(!is_head_region(touch.human), "touch: expected a region that may be touched, found '{}'", touch.human);
}

}  // namespace

BodyDistance::BodyDistance(std::shared_ptr<const RobotModel> robot, HumanBody human,
                           const std::vector<TouchPair>& touches)
    : robot_(std::move(robot)), human_(std::move(human)), kinematics_(*robot_), shapes_(robot_->shapes.size()) {
  for (const TouchPair& touch : touches) check_touch(*robot_, human_, touch);
  for (const HumanCapsule& capsule : human_.capsules) {
    is_head_.push_back(is_head_region(capsule.region));
    std::vector<bool> allowed(shapes_.size(), false);
    for (const TouchPair& touch : touches)
      for (std::size_t s = 0; s < shapes_.size(); ++s)
        if (touch.human == capsule.region && touch.robot == robot_->shapes[s].region) allowed[s] = true;
    touches_.push_back(std::move(allowed));
  }
}

BodyDistance::Segment BodyDistance::segment(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius) {
  return {a, b, radius, 0.5 * (a + b), 0.5 * (b - a).norm() + radius};
}

void BodyDistance::place_shapes(const Pose& X_WB, const Eigen::VectorXd& q) {
  kinematics_.update(X_WB, q);
  for (std::size_t s = 0; s < shapes_.size(); ++s) {
    const RobotShape& shape = robot_->shapes[s];
    const Eigen::Matrix3d& R_WL = kinematics_.R_WL(shape.link);
    const Eigen::Vector3d center = kinematics_.p_WL(shape.link) + R_WL * shape.X_LS.p;
    const Eigen::Vector3d half = R_WL * (shape.X_LS.R * Eigen::Vector3d(0.0, 0.0, shape.half_length));
    shapes_[s] = segment(center - half, center + half, shape.radius);
  }
}

const BodyGaps& BodyDistance::measure(const Pose& X_WB, const Eigen::VectorXd& q, const HumanJoints* person,
                                      double uncertainty, bool may_touch) {
  place_shapes(X_WB, q);
  gaps_ = {};
  for (const auto& [i, j] : robot_->self_collision) {
    const NearestPoints near = nearest_points(shapes_[i].a, shapes_[i].b, shapes_[j].a, shapes_[j].b);
    gaps_.self = std::min(gaps_.self, (near.p1 - near.p2).norm() - shapes_[i].radius - shapes_[j].radius);
  }
  if (person != nullptr) measure_person(*person, uncertainty, may_touch);
  return gaps_;
}

void BodyDistance::measure_person(const HumanJoints& person, double uncertainty, bool may_touch) {
  for (std::size_t c = 0; c < human_.capsules.size(); ++c) {
    const HumanCapsule& capsule = human_.capsules[c];
    const Eigen::Vector3d a = person.col(capsule.joint_a);
    const Eigen::Vector3d along = person.col(capsule.joint_b) - a;
    measure_capsule(segment(a + capsule.begin * along, a + capsule.end * along, capsule.radius), c, uncertainty,
                    may_touch);
  }
}

void BodyDistance::measure_capsule(const Segment& capsule, std::size_t index, double uncertainty, bool may_touch) {
  for (std::size_t s = 0; s < shapes_.size(); ++s) {
    const bool touches = may_touch && touches_[index][s];
    const double at_least = (shapes_[s].center - capsule.center).norm() - shapes_[s].reach - capsule.reach;
    const double of_interest = is_head_[index] ? std::max(gaps_.person, gaps_.head) : gaps_.person;
    if (touches ? at_least > gaps_.touch : at_least - uncertainty > of_interest) continue;
    const NearestPoints near = nearest_points(shapes_[s].a, shapes_[s].b, capsule.a, capsule.b);
    const Eigen::Vector3d apart = near.p2 - near.p1;
    const double gap = apart.norm() - shapes_[s].radius - capsule.radius;
    if (touches) {
      if (gap < gaps_.touch) gaps_.touched = static_cast<int>(index);
      gaps_.touch = std::min(gaps_.touch, gap);
      continue;
    }
    gaps_.person = std::min(gaps_.person, gap - uncertainty);
    if (!is_head_[index] || gap - uncertainty >= gaps_.head) continue;
    gaps_.head = gap - uncertainty;
    gaps_.head_from_robot = apart.normalized();
  }
}

}  // namespace duet
