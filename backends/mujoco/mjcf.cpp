#include "duet/backends/mujoco/mjcf.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "duet/backends/mujoco/mujoco_options.h"
#include "duet/robots/dynamics.h"

namespace duet {
namespace {

using Out = std::back_insert_iterator<std::string>;

// With a higher priority a geom decides the parameters of a contact alone: the robot over the human.
constexpr int kRobotPriority = 1;
constexpr const char* kImpedance = "0.95 0.99 0.001";  // of the ground and of the robot itself
// More points, and rows of theirs and of joint stops, than a robot touches with at once; a world stays below a
// mebibyte, of which the rows take most.
constexpr int kContacts = 64;
constexpr int kRows = 192;
// The most that the solver and the collision take from MuJoCo's stack with so many rows, with a margin.
constexpr int kStackPerRow = 60, kStack = 8000;  // [doubles]
// Capsules wait here until the partner is set.
constexpr double kFarAway = 1000.0;  // [m]

std::string numbers(const Eigen::Vector3d& v) { return fmt::format("{} {} {}", v.x(), v.y(), v.z()); }
std::string numbers(const Eigen::Quaterniond& R) { return fmt::format("{} {} {} {}", R.w(), R.x(), R.y(), R.z()); }

// MuJoCo wants at least two steps.
double ground_time_constant(const Scene& scene) {
  return std::max(mujoco_settings(scene.options).ground_time_constant, 2.0 * scene.dt);
}

// [doubles]. The implicit integrator's derivatives take one velocity, acceleration and force per body and coordinate.
int stack_size(const Scene& scene, const MujocoSettings& settings, int rows) {
  const int stack = kStack + kStackPerRow * rows;
  if (settings.integrator == "euler") return stack;
  const int bodies = static_cast<int>(1 + scene.robot->links.size() + scene.human.capsules.size());
  const int coordinates = 6 + scene.robot->dof();
  return stack + 6 * coordinates * (3 * bodies + coordinates);
}

void write_options(Out out, const Scene& scene) {
  const MujocoSizes sizes = mujoco_sizes(scene);
  const MujocoSettings settings = mujoco_settings(scene.options);
  const std::string solver = settings.solver == "newton" ? "Newton" : settings.solver == "cg" ? "CG" : "PGS";
  fmt::format_to(out,
                 "<mujoco><compiler angle='radian' inertiafromgeom='false' boundmass='0' boundinertia='0' "
                 "balanceinertia='false'/><size njmax='{}' nconmax='{}' nstack='{}'/>"
                 "<option timestep='{}' gravity='{}' integrator='{}' solver='{}' cone='{}' "
                 "iterations='{}' tolerance='{}' impratio='{}' jacobian='{}' collision='{}'>"
                 "<flag frictionloss='disable' equality='disable' passive='disable' sensor='disable' "
                 "actuation='disable'/></option>",
                 sizes.rows, sizes.contacts, stack_size(scene, settings, sizes.rows), scene.dt, numbers(scene.gravity),
                 settings.integrator == "euler" ? "Euler" : settings.integrator, solver, settings.cone,
                 settings.iterations, settings.tolerance, settings.impratio, settings.jacobian,
                 scene.partner == PartnerMode::kSolid ? "all" : "predefined");
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

// Contacts with the ground and of the robot with itself are pairs of their own: no search for them, and friction is
// the pair's.
void write_pairs(Out out, const Scene& scene) {
  const RobotModel& robot = *scene.robot;
  const double time_constant = ground_time_constant(scene);
  const auto write = [&](const std::string& first, const std::string& second, double friction) {
    fmt::format_to(out,
                   "<pair geom1='{0}' geom2='{1}' condim='3' friction='{2} {2} 0 0 0' solref='{3} 1' solimp='{4}'/>",
                   first, second, friction, time_constant, kImpedance);
  };
  fmt::format_to(out, "<contact>");
  for (size_t s = 0; s < robot.shapes.size(); ++s) write("ground", fmt::format("s{}", s), scene.friction.robot_ground);
  if (scene.self_collision)
    for (const auto& [first, second] : robot.self_collision)
      write(fmt::format("s{}", first), fmt::format("s{}", second), scene.friction.robot_robot);
  fmt::format_to(out, "</contact>");
}

}  // namespace

MujocoSizes mujoco_sizes(const Scene& scene) {
  const RobotModel& robot = *scene.robot;
  int contacts = 0;
  for (const RobotShape& shape : robot.shapes) contacts += shape.kind == ShapeKind::kSphere ? 1 : 2;  // ends
  const bool solid = scene.partner == PartnerMode::kSolid;
  if (solid) contacts += 2 * static_cast<int>(robot.shapes.size() * scene.human.capsules.size());
  if (scene.self_collision) contacts += 2 * static_cast<int>(robot.self_collision.size());
  contacts = std::clamp(contacts, 1, kContacts);
  return {.contacts = contacts, .rows = std::min(4 * contacts + robot.dof(), kRows)};
}

std::string make_mjcf(const Scene& scene) {
  std::string text;
  const Out out(text);
  write_options(out, scene);
  fmt::format_to(out, "<worldbody><geom name='ground' type='plane' size='0 0 1' contype='0' conaffinity='0'/>");
  write_link(out, scene, 0);
  if (scene.partner == PartnerMode::kSolid) write_capsules(out, scene);
  fmt::format_to(out, "</worldbody>");
  write_pairs(out, scene);
  fmt::format_to(out, "</mujoco>");
  return text;
}

}  // namespace duet
