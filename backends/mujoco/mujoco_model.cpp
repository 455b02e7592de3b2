#include "duet/backends/mujoco/mujoco_model.h"

#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <mutex>
#include <stdexcept>
#include <string>

#include "duet/backends/mujoco/mjcf.h"

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

}  // namespace duet
