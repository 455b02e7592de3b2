// Files that controllers are made from: descriptors of networks' inputs and outputs, and the networks of WBC-Sim.
#include <fmt/format.h>

#include "duet/controllers/audit/trace.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/descriptor.h"
#include "duet/controllers/import/descriptor_import.h"
#include "duet/controllers/wbc_sim/observation.h"
#include "duet/controllers/wbc_sim/wbc_sim.h"
#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "tests/fuzz/reader.h"
#include "tests/fuzz/tensor_edit.h"

namespace duet::fuzz {
namespace {

const RobotModel& robot() {
  static const auto robot = load_shared_robot();
  return *robot;
}

std::string descriptor_sample(unsigned seed) {
  constexpr const char* kNames[] = {"twist2",       "homie",    "rl_gym", "playground",    "gmt",
                                    "beyond_mimic", "holosoma", "falcon", "unitree_rl_lab"};
  return read_file(std::string(DUET_SOURCE_DIR "/controllers/descriptors/") + kNames[seed / 64 % std::size(kNames)] +
                   ".yaml");
}

void read_descriptor(std::string_view bytes) { (void)parse_descriptor(std::string(bytes), "fuzz.yaml"); }

// Deployments of the T1 with legs alone.
std::string deployment_sample(unsigned seed) {
  const std::string twelve = "[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]";
  if (seed / 64 % 3 == 0)
    return "joint_ids_map: [6, 7, 8, 9, 10, 11, 0, 1, 2, 3, 4, 5]\nstep_dt: 0.04\nstiffness: " + twelve +
           "\ndamping: " + twelve + "\ndefault_joint_pos: " + twelve +
           "\ncommands: {base_velocity: {ranges: {lin_vel_x: [-1, 1], lin_vel_y: [0, 0], ang_vel_z: [-1, 1]}}}\n"
           "actions: {JointPositionAction: {clip: null, scale: 0.25, offset: null}}\n"
           "observations:\n  base_ang_vel: {params: {}, clip: [-3, 3], scale: [0.2, 0.2, 0.2], history_length: 2}\n"
           "  gait_phase: {params: {period: 0.8}, clip: null, scale: [1, 1], history_length: 2}\n";
  if (seed / 64 % 3 == 1)
    return "policy_path: a/policy.pt\nsimulation_dt: 0.002\ncontrol_decimation: 10\nkps: " + twelve +
           "\nkds: " + twelve + "\ndefault_angles: " + twelve +
           "\nang_vel_scale: 0.25\ndof_pos_scale: 1.0\ndof_vel_scale: 0.05\naction_scale: 0.25\n"
           "cmd_scale: [2.0, 2.0, 0.25]\nnum_actions: 12\nnum_obs: 47\n";
  return "t1:\n  model_name: policy.pt\n  joint_mapping: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]\n  rl_kp: " + twelve +
         "\n  rl_kd: " + twelve + "\n  default_dof_pos: " + twelve + "\n  action_scale: " + twelve +
         "\n  clip_actions_lower: -100" + "\n  clip_actions_upper: 100" +
         "\n  observations: [ang_vel, gravity_vec, commands, dof_pos, dof_vel, actions]\n  clip_obs: 100.0\n"
         "  ang_vel_scale: 0.25\n  dof_pos_scale: 1.0\n  dof_vel_scale: 0.05\n  commands_scale: [2, 2, 0.25]\n"
         "  observations_history: [1, 0]\n";
}

void read_deployment(std::string_view bytes) {
  (void)import_descriptor({.file = scratch_file("deploy.yaml", bytes), .robot = "t1_12dof"});
}

const Descriptor& traced() {
  static const Descriptor descriptor = load_descriptor("homie");
  return descriptor;
}

const RobotModel& traced_robot() {
  static const auto robot = load_shared_robot(card_path("g1_27dof"));
  return *robot;
}

// Two rows of what HOMIE's program may have written down.
std::string trace_sample(unsigned) {
  std::string header =
      "quat_w,quat_x,quat_y,quat_z,gyro_x,gyro_y,gyro_z,command_forward,command_lateral,command_yaw_rate";
  std::string row = "1,0,0,0,0.1,0,-2e-3,0.5,0,0";
  for (const char* stem : {"q", "v", "target"})
    for (const DescriptorJoint& joint : traced().joints) {
      if (std::string_view(stem) == "target" && !joint.action) continue;
      header += fmt::format(",{}.{}", stem, joint.name);
      row += ",0.25";
    }
  return header + "\n" + row + "\n" + row + "\n";
}

void read_trace(std::string_view bytes) {
  (void)parse_controller_trace(std::string(bytes), "fuzz.csv", traced(), traced_robot());
}

SafeTensors small_network() {
  const int joints = robot().dof(), inputs = WbcLayout(joints).oracle();
  Random random(5, 6);
  WbcNetwork network;
  network.kind = WbcKind::kOracle;
  network.robot = robot().name;
  network.joints = robot().joint_names();
  network.mlp = random_mlp({inputs, 2, joints}, 0.1F, random);
  network.mean.setZero(inputs);
  network.deviation.setOnes(inputs);
  network.action_scale.setConstant(joints, 0.25);
  network.neutral = robot().neutral;
  const JointCommand command = robot().default_command(robot().neutral);
  network.kp = command.kp;
  network.kd = command.kd;
  network.note = "fuzz";
  const std::string path = scratch_folder() + "/wbc.safetensors";
  save_wbc_network(path, network, TensorType::kF16);
  return read_safetensors(path);
}

const SafeTensors& good_network() {
  static const SafeTensors content = small_network();
  return content;
}

std::string wbc_sample(unsigned seed) { return tensors_sample(good_network(), seed); }

void read_wbc_network(std::string_view bytes) {
  (void)load_wbc_network(scratch_file("fuzz.safetensors", tensors_of(good_network(), bytes)), robot());
}

}  // namespace

std::vector<Reader> controller_readers() {
  return {{"controller_descriptor", descriptor_sample, read_descriptor},
          {"controller_trace", trace_sample, read_trace},
          {"deployment", deployment_sample, read_deployment},
          {"wbc_network", wbc_sample, read_wbc_network}};
}

}  // namespace duet::fuzz
