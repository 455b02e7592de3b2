// Files that controllers are made from: descriptors of networks' inputs and outputs, and the networks of WBC-Sim.
#include "duet/controllers/descriptor.h"
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
  return {{"controller_descriptor", descriptor_sample, read_descriptor}, {"wbc_network", wbc_sample, read_wbc_network}};
}

}  // namespace duet::fuzz
