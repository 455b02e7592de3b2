#include "duet/backends/mujoco/mujoco_model.h"

#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <mutex>
#include <stdexcept>
#include <string>

#include "duet/robots/dynamics.h"

namespace duet {
namespace {

// MuJoCo's handlers belong to the process. By default a warning is appended to MUJOCO_LOG.TXT in the current folder and
// printed, and an error ends the process. Warnings are also counted in mjData, where the backend looks; an error
// becomes an exception. Handlers that the program has set before are kept.
void install_handlers() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (mju_user_warning == nullptr) mju_user_warning = [](const char*) {};
    if (mju_user_error == nullptr)
      mju_user_error = [](const char* message) { throw std::runtime_error(fmt::format("mujoco: {}", message)); };
  });
}

// The parser keeps the last document in the process: one thread at a time.
mjModel* load(const std::string& document) {
  static std::mutex mutex;
  const std::lock_guard<std::mutex> lock(mutex);
  constexpr const char* kName = "scene.xml";
  const std::unique_ptr<mjVFS> files = std::make_unique<mjVFS>();  // about a megabyte: too large for the stack
  mj_defaultVFS(files.get());
  mj_makeEmptyFileVFS(files.get(), kName, static_cast<int>(document.size()));
  document.copy(static_cast<char*>(files->filedata[mj_findFileVFS(files.get(), kName)]), document.size());
  std::array<char, 1000> error{};
  mjModel* model = mj_loadXML(kName, files.get(), error.data(), static_cast<int>(error.size()));
  mj_deleteVFS(files.get());
  if (model == nullptr) throw std::runtime_error(fmt::format("mujoco: refuses the scene: {}", error.data()));
  return model;
}

int id_of(const mjModel& model, int type, char letter, int index) {
  return mj_name2id(&model, type, fmt::format("{}{}", letter, index).c_str());
}

void find_robot(const Scene& scene, MujocoModel& compiled) {
  const RobotModel& robot = *scene.robot;
  mjModel& m = *compiled.model;
  for (int i = 0; i < robot.dof(); ++i) {
    const int joint = id_of(m, mjOBJ_JOINT, 'j', i);
    compiled.q_address.push_back(m.jnt_qposadr[joint]);
    compiled.v_address.push_back(m.jnt_dofadr[joint]);
  }
  for (int i = 0; i < static_cast<int>(robot.links.size()); ++i)
    compiled.link_body.push_back(id_of(m, mjOBJ_BODY, 'l', i));
  for (int i = 0; i < static_cast<int>(robot.shapes.size()); ++i) {
    const int geom = id_of(m, mjOBJ_GEOM, 's', i);
    compiled.geoms[geom] = {ContactSide::kRobot, robot.shapes[i].link, i};
  }
}

void find_human(const Scene& scene, MujocoModel& compiled) {
  if (scene.partner != PartnerMode::kSolid) return;
  for (int i = 0; i < static_cast<int>(scene.human.capsules.size()); ++i) {
    const int geom = id_of(*compiled.model, mjOBJ_GEOM, 'h', i);
    compiled.geoms[geom] = {ContactSide::kHuman, i, -1};
    compiled.human_geom.push_back(geom);
    compiled.human_mocap.push_back(compiled.model->body_mocapid[compiled.model->geom_bodyid[geom]]);
  }
}

}  // namespace

void MujocoDelete::operator()(mjModel* model) const { mj_deleteModel(model); }
void MujocoDelete::operator()(mjData* data) const { mj_deleteData(data); }

MujocoModel compile_mujoco(const Scene& scene) {
  install_handlers();
  MujocoModel compiled;
  compiled.model.reset(load(make_mjcf(scene)));
  compiled.data.reset(mj_makeData(compiled.model.get()));
  compiled.geoms.resize(compiled.model->ngeom);
  find_robot(scene, compiled);
  find_human(scene, compiled);
  return compiled;
}

void write_state(const RobotState& state, const MujocoModel& from, mjData& to) {
  const Eigen::Quaterniond& R = state.X_WB.R;
  Eigen::Map<Eigen::Vector3d>(to.qpos) = state.X_WB.p;
  Eigen::Map<Eigen::Vector4d>(to.qpos + 3) << R.w(), R.x(), R.y(), R.z();
  Eigen::Map<Eigen::Vector3d>(to.qvel) = state.v_WB;
  Eigen::Map<Eigen::Vector3d>(to.qvel + 3) = state.w_WB_B;
  for (size_t i = 0; i < from.q_address.size(); ++i) {
    to.qpos[from.q_address[i]] = state.q[static_cast<Eigen::Index>(i)];
    to.qvel[from.v_address[i]] = state.v[static_cast<Eigen::Index>(i)];
  }
}

void read_state(const MujocoModel& from, RobotState& state) {
  const mjData& d = *from.data;
  state.X_WB.p = Eigen::Map<const Eigen::Vector3d>(d.qpos);
  state.X_WB.R = Eigen::Quaterniond(d.qpos[3], d.qpos[4], d.qpos[5], d.qpos[6]);
  state.v_WB = Eigen::Map<const Eigen::Vector3d>(d.qvel);
  state.w_WB_B = Eigen::Map<const Eigen::Vector3d>(d.qvel + 3);
  for (size_t i = 0; i < from.q_address.size(); ++i) {
    state.q[static_cast<Eigen::Index>(i)] = d.qpos[from.q_address[i]];
    state.v[static_cast<Eigen::Index>(i)] = d.qvel[from.v_address[i]];
  }
}

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

std::span<const EngineOption> mujoco_options() {
  static const std::vector<EngineOption> options = {
      choice_option("solver", {"newton", "cg", "pgs"}, "of the constraint forces"),
      integer_option("iterations", 20, 1, 1000, "of the solver, at most"),
      number_option("tolerance", 1e-8, 0.0, 1.0, "of the solver: scaled improvement at which it ends"),
      choice_option("cone", {"elliptic", "pyramidal"}, "friction cone"),
      number_option("impratio", 10.0, 1.0, 1e4, "stiffness of friction over that of the normal"),
      choice_option("jacobian", {"dense", "sparse"}, "form of the solver's matrices; pgs is always dense"),
      choice_option("integrator", {"euler", "implicit"},
                    "implicit also takes velocity-product forces at the end of the step"),
      number_option("ground_time_constant", 0.01, 1e-4, 0.1,
                    "of contacts with the ground and the robot itself, at least two steps [s]")};
  return options;
}

MujocoSettings mujoco_settings(const EngineOptions& options) {
  const std::span<const EngineOption> known = mujoco_options();
  MujocoSettings settings;
  settings.solver = option_choice(options, known, "solver");
  settings.cone = option_choice(options, known, "cone");
  settings.jacobian = settings.solver == "pgs" ? "dense" : option_choice(options, known, "jacobian");
  settings.integrator = option_choice(options, known, "integrator");
  settings.iterations = option_integer(options, known, "iterations");
  settings.tolerance = option_number(options, known, "tolerance");
  settings.impratio = option_number(options, known, "impratio");
  settings.ground_time_constant = option_number(options, known, "ground_time_constant");
  return settings;
}

}  // namespace duet
