#include "backends/mujoco/mjcf.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "robots/dynamics.h"

namespace duet {
namespace {

using Out = std::back_insert_iterator<std::string>;

// Contact and stop parameters of MuJoCo (its `solref` time constant is at least twice the step): chosen stiff, see the
// README. With a higher priority a geom decides the parameters of a contact alone: the ground over the robot, the robot
// over the human.
constexpr double kGroundTimeConstant = 0.01;  // [s]
constexpr int kGroundPriority = 2;
constexpr int kRobotPriority = 1;
// More contacts with the human than a body's surface takes at once.
constexpr int kHumanContacts = 64;
// Capsules wait here until the partner is set.
constexpr double kFarAway = 1000.0;  // [m]

std::string numbers(const Eigen::Vector3d& v) { return fmt::format("{} {} {}", v.x(), v.y(), v.z()); }
std::string numbers(const Eigen::Quaterniond& R) { return fmt::format("{} {} {} {}", R.w(), R.x(), R.y(), R.z()); }

void write_options(Out out, const Scene& scene) {
  const MujocoSizes sizes = mujoco_sizes(scene);
  fmt::format_to(out,
                 "<mujoco><compiler angle='radian' inertiafromgeom='false' boundmass='0' boundinertia='0' "
                 "balanceinertia='false'/><size njmax='{}' nconmax='{}'/>"
                 "<option timestep='{}' gravity='{}' integrator='Euler' solver='Newton' cone='elliptic' "
                 "iterations='20' tolerance='1e-8' impratio='10' jacobian='dense'/>",
                 sizes.rows, sizes.contacts, scene.dt, numbers(scene.gravity));
}

void write_shape(Out out, const Scene& scene, int index) {
  const RobotShape& shape = scene.robot->shapes[index];
  const bool sphere = shape.kind == ShapeKind::kSphere;
  fmt::format_to(out,
                 "<geom name='s{}' type='{}' size='{} {}' pos='{}' quat='{}' contype='0' conaffinity='1' condim='3' "
                 "priority='{}' friction='{} 0 0'/>",
                 index, sphere ? "sphere" : "capsule", shape.radius, sphere ? 0.0 : shape.half_length,
                 numbers(shape.X_LS.p), numbers(shape.X_LS.R), kRobotPriority, scene.friction.robot_human);
}

void write_hinge(Out out, const Scene& scene, int joint) {
  const RobotJoint& j = scene.robot->joints[joint];
  fmt::format_to(out,
                 "<joint name='j{}' type='hinge' axis='{}' limited='true' range='{} {}' armature='{}' "
                 "solreflimit='{} 1' solimplimit='0.99 0.999 0.001'/>",
                 joint, numbers(scene.robot->links[joint + 1].axis), j.lower, j.upper, j.armature, 2.0 * scene.dt);
}

void write_link(Out out, const Scene& scene, int index) {
  const RobotModel& robot = *scene.robot;
  const RobotLink& link = robot.links[index];
  const Eigen::Matrix3d& I = link.inertia;
  fmt::format_to(out, "<body name='l{}' pos='{}' quat='{}'>", index, numbers(link.X_PL.p), numbers(link.X_PL.R));
  fmt::format_to(out, "<inertial pos='{}' mass='{}' fullinertia='{} {} {} {} {} {}'/>", numbers(link.com), link.mass,
                 I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2));
  if (index == 0)
    fmt::format_to(out, "<freejoint name='base'/>");
  else
    write_hinge(out, scene, index - 1);
  for (int s = 0; s < static_cast<int>(robot.shapes.size()); ++s)
    if (robot.shapes[s].link == index) write_shape(out, scene, s);
  for (int child = index + 1; child < static_cast<int>(robot.links.size()); ++child)
    if (robot.links[child].parent == index) write_link(out, scene, child);
  fmt::format_to(out, "</body>");
}

void write_capsules(Out out, const Scene& scene) {
  const std::vector<HumanCapsule>& capsules = scene.human.capsules;
  for (int i = 0; i < static_cast<int>(capsules.size()); ++i)
    fmt::format_to(out,
                   "<body name='h{0}' mocap='true' pos='{1} 0 {2}'><geom name='h{0}' type='capsule' size='{3} 0.1' "
                   "contype='1' conaffinity='0' condim='3' priority='0'/></body>",
                   i, static_cast<double>(i), kFarAway, capsules[i].radius);
}

}  // namespace

MujocoSizes mujoco_sizes(const Scene& scene) {
  int shape_ends = 0;  // a capsule touches the ground at two points
  for (const RobotShape& shape : scene.robot->shapes) shape_ends += shape.kind == ShapeKind::kSphere ? 1 : 2;
  const int human = scene.partner == PartnerMode::kSolid
                        ? std::min(kHumanContacts, 2 * shape_ends * static_cast<int>(scene.human.capsules.size()))
                        : 0;
  const int contacts = std::max(1, shape_ends + human);
  return {.contacts = contacts, .rows = 3 * contacts + scene.robot->dof()};
}

std::string make_mjcf(const Scene& scene) {
  std::string text;
  const Out out(text);
  write_options(out, scene);
  fmt::format_to(out,
                 "<worldbody><geom name='ground' type='plane' size='0 0 1' contype='1' conaffinity='0' condim='3' "
                 "priority='{}' friction='{} 0 0' solref='{} 1' solimp='0.95 0.99 0.001'/>",
                 kGroundPriority, scene.friction.robot_ground, std::max(kGroundTimeConstant, 2.0 * scene.dt));
  write_link(out, scene, 0);
  if (scene.partner == PartnerMode::kSolid) write_capsules(out, scene);
  fmt::format_to(out, "</worldbody></mujoco>");
  return text;
}

}  // namespace duet
