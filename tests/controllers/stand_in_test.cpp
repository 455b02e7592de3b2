// Every published descriptor with a network of its layout, written here: the way from the name to the joints without
// the networks themselves, which do not ship. Tests of those are in published_test.cpp.
#include <cmath>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "tests/controllers/fake_network.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet {
namespace {

// A network whose answer does not depend on what it is shown: zero times the inputs side by side, plus the answer.
std::string constant_network(const Descriptor& descriptor, const std::vector<float>& answer, int more = 0) {
  test::OnnxWriter writer;
  std::vector<std::string> names;
  std::int64_t size = 0;
  for (const ObservationInput& input : descriptor.observation.inputs) {
    names.push_back(input.name.empty() ? "x" : input.name);
    const std::int64_t numbers = descriptor.input_size(input) + more;
    writer.input(names.back(), {1, numbers});
    size += numbers;
  }
  const auto actions = static_cast<std::int64_t>(answer.size());
  const std::string output = descriptor.output.empty() ? "y" : descriptor.output;
  writer.constant("w", {size, actions}, std::vector<float>(static_cast<std::size_t>(size * actions)));
  writer.constant("b", {actions}, answer);
  if (names.size() > 1) writer.node("Concat", names, {"all"}, {{"axis", std::int64_t{1}}});
  writer.node("Gemm", {names.size() > 1 ? "all" : names[0], "w", "b"}, {output});
  writer.output(output, {1, actions});
  return writer.bytes();
}

class StandIn : public testing::TestWithParam<const char*> {
 protected:
  Descriptor descriptor_ = load_descriptor(GetParam());
  std::shared_ptr<const RobotModel> robot_ = test::body(descriptor_.robot);
  test::ScratchFolder folder_;
};

TEST_P(StandIn, TheNetworksAnswerReachesTheJointsOfTheDescriptorWithItsScalesAndGains) {
  std::vector<float> answer;
  for (int i = 0; i < descriptor_.actions(); ++i) answer.push_back(0.01F * static_cast<float>(i + 1));
  write_file(folder_ / "network", constant_network(descriptor_, answer));
  const auto controller = make_controller(GetParam(), robot_, {{"network", folder_ / "network"}});
  const RobotState state = robot_->standing_state(Pose{});
  Reference reference{state.X_WB, robot_->neutral};
  reference.q.array() += 0.05;
  JointCommand command = robot_->default_command(robot_->neutral);
  controller->reset(state);
  controller->act(state, reference, command);
  int action = 0;
  for (const DescriptorJoint& joint : descriptor_.joints) {
    const int j = robot_->joint_index(joint.name);
    EXPECT_EQ(command.kp[j], joint.kp) << joint.name;
    EXPECT_EQ(command.kd[j], joint.kd) << joint.name;
    const double from = joint.action && !joint.around_reference ? joint.neutral : reference.q[j];
    const double wanted = joint.action ? from + *joint.action * answer[action++] : from;
    const bool locked =
        descriptor_.waist_locked && (joint.name == "waist_roll_joint" || joint.name == "waist_pitch_joint");
    if (locked || joint.effort) continue;
    EXPECT_NEAR(command.q_target[j], wanted, 1e-6) << joint.name;
  }
}

TEST_P(StandIn, ANetworkOfAnotherLayoutIsRefusedWithBothNumbers) {
  write_file(folder_ / "network", constant_network(descriptor_, std::vector<float>(descriptor_.actions()), 1));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] {
    make_controller(GetParam(), robot_, {{"network", folder_ / "network"}});
  }));
}

INSTANTIATE_TEST_SUITE_P(Published, StandIn,
                         testing::Values("beyond_mimic", "falcon", "falcon_dec_loco", "gmt", "holosoma",
                                         "holosoma_fastsac", "holosoma_t1", "homie", "playground", "rl_gym",
                                         "rl_sar_dance", "twist2", "unitree_rl_lab", "unitree_rl_mjlab"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace
}  // namespace duet
