#include "duet/backends/conformance/small_robots.h"

#include <string>

namespace duet::conformance {
namespace {

RobotLink solid(const std::string& name, double mass, const Eigen::Vector3d& moments) {
  RobotLink link;
  link.name = name;
  link.mass = mass;
  link.inertia = moments.asDiagonal();
  return link;
}

RobotShape sphere(const Eigen::Vector3d& p_L, double radius) {
  RobotShape shape;
  shape.X_LS.p = p_L;
  shape.radius = radius;
  shape.region = "foot";
  return shape;
}

RobotLink heavy_base() { return solid("base", kBaseMass, Eigen::Vector3d::Constant(kBaseMass)); }

RobotJoint hinge(const std::string& name, double limit, double effort, double armature) {
  RobotJoint joint;
  joint.name = name;
  joint.lower = -limit;
  joint.upper = limit;
  joint.effort = effort;
  joint.velocity = 100.0;
  joint.armature = armature;
  return joint;
}

std::shared_ptr<const RobotModel> finished(RobotModel robot, const std::string& name) {
  robot.name = name;
  robot.neutral = Eigen::VectorXd::Zero(robot.dof());
  return std::make_shared<const RobotModel>(std::move(robot));
}

}  // namespace

std::shared_ptr<const RobotModel> tumbling_box() {
  RobotModel robot;
  robot.links = {solid("box", 10.0,
                       {10.0 * (0.4 * 0.4 + 0.9 * 0.9) / 12.0, 10.0 * (0.1 * 0.1 + 0.9 * 0.9) / 12.0,
                        10.0 * (0.1 * 0.1 + 0.4 * 0.4) / 12.0})};
  return finished(robot, "box");
}

std::shared_ptr<const RobotModel> sledge() {
  RobotModel robot;
  robot.links = {solid("sledge", 10.0, {0.4, 0.5, 0.6})};
  for (const double x : {-0.2, 0.2})
    for (const double y : {-0.2, 0.2}) {
      robot.feet.push_back(static_cast<int>(robot.shapes.size()));
      robot.shapes.push_back(sphere({x, y, 0.02 - kSledgeHeight}, 0.02));
    }
  return finished(robot, "sledge");
}

std::shared_ptr<const RobotModel> ball(double mass, double radius) {
  RobotModel robot;
  robot.links = {solid("ball", mass, Eigen::Vector3d::Constant(0.4 * mass * radius * radius))};
  robot.shapes = {sphere(Eigen::Vector3d::Zero(), radius)};
  robot.feet = {0};
  return finished(robot, "ball");
}

std::shared_ptr<const RobotModel> wheel() {
  RobotModel robot;
  RobotLink rim = solid("rim", 2.0, {0.03, 0.03, kWheelInertia});
  rim.parent = 0;
  robot.links = {heavy_base(), rim};
  robot.joints = {hinge("axle", 1.0, kWheelEffort, kWheelArmature)};
  return finished(robot, "wheel");
}

std::shared_ptr<const RobotModel> rods(int links) {
  RobotModel robot;
  robot.links = {heavy_base()};
  for (int i = 0; i < links; ++i) {
    RobotLink rod = solid("rod" + std::to_string(i), kRodMass, {kRodInertia, kRodInertia, 0.1 * kRodInertia});
    rod.parent = i;
    rod.axis = Eigen::Vector3d::UnitY();
    rod.com = {0.0, 0.0, -0.5 * kRodLength};
    if (i > 0) rod.X_PL.p = {0.0, 0.0, -kRodLength};
    robot.links.push_back(rod);
    robot.joints.push_back(hinge("hinge" + std::to_string(i), 3.1, 100.0, 0.0));
  }
  return finished(robot, "rods");
}

std::shared_ptr<const RobotModel> without_stops(const RobotModel& robot) {
  RobotModel copy = robot;
  for (RobotJoint& joint : copy.joints) {
    joint.lower = -10.0;
    joint.upper = 10.0;
  }
  return std::make_shared<const RobotModel>(std::move(copy));
}

RobotState state_at(const RobotModel& robot, const Eigen::Vector3d& p_WB) {
  RobotState state;
  state.X_WB.p = p_WB;
  state.q = robot.neutral;
  state.v = Eigen::VectorXd::Zero(robot.dof());
  return state;
}

JointCommand no_torque(const RobotModel& robot) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(robot.dof());
  return {zero, zero, zero, zero};
}

void hold_base(Backend& backend) {
  backend.push(0, -backend.scene().robot->links[0].mass * backend.scene().gravity, backend.state().X_WB.p);
}

}  // namespace duet::conformance
