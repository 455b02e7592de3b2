// A scene compiled by MuJoCo, and where the robot's joints and shapes are in its arrays. For the files of this folder
// that are built with MuJoCo; the vendor's types are only named here.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/engine_module.h"
#include "duet/core/robot_state.h"

struct mjModel_;
struct mjData_;

namespace duet {

// A geom of the compiled model: a shape on a link, a capsule of the human or the ground.
struct MujocoGeom {
  ContactSide side = ContactSide::kGround;
  int index = -1;  // link of the robot or capsule of the human; -1 for the ground
  int shape = -1;  // of the robot
};

struct MujocoDelete {
  void operator()(mjModel_* model) const;
  void operator()(mjData_* data) const;
};

// One compiled copy per backend: gains and capsule lengths are written into it. Not shared between threads.
struct MujocoModel {
  std::unique_ptr<mjModel_, MujocoDelete> model;
  std::unique_ptr<mjData_, MujocoDelete> data;
  std::vector<int> q_address;     // of joint i in qpos
  std::vector<int> v_address;     // of joint i in qvel
  std::vector<int> link_body;     // body of link i
  std::vector<MujocoGeom> geoms;  // by MuJoCo's geom id
  std::vector<int> human_geom;    // geom of capsule i; empty unless the partner is solid
  std::vector<int> human_mocap;   // mocap index of capsule i
};

// Throws std::runtime_error with MuJoCo's message where it refuses the document. Thread-safe (compiling is serialised).
MujocoModel compile_mujoco(const Scene& scene);

void write_state(const RobotState& state, const MujocoModel& from, mjData_& to);
void read_state(const MujocoModel& from, RobotState& state);

// The scene as an MJCF document, made in memory: no file of the robot's vendor is read. Names in it are indices, so
// that nothing needs escaping: links "l0", joints "j0", shapes "s0", capsules of the human "h0", and "ground".

// Largest numbers of contacts and of constraint rows that the scene can have; MuJoCo's buffers have these sizes.
struct MujocoSizes {
  int contacts = 0;
  int rows = 0;
};
MujocoSizes mujoco_sizes(const Scene& scene);

std::string make_mjcf(const Scene& scene);

// The settings of MuJoCo that a profile may change, and the values that hold for a scene.

std::span<const EngineOption> mujoco_options();

struct MujocoSettings {
  std::string solver, cone, jacobian, integrator;
  int iterations = 0;
  double tolerance = 0.0;
  double impratio = 0.0;
  double ground_time_constant = 0.0;  // [s]
};

// Options are checked before (check_options).
MujocoSettings mujoco_settings(const EngineOptions& options);

}  // namespace duet
