#include "duet/hardware/body_distance.h"

#include <algorithm>

#include "duet/backends/narrow_phase.h"
#include "duet/core/require.h"

namespace duet {
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
