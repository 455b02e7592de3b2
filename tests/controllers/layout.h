// A descriptor's controller over a fake network: what the network is shown, number by number.
#pragma once

#include <gtest/gtest.h>

#include "duet/controllers/descriptor_controller.h"
#include "tests/controllers/fake_network.h"

namespace duet::test {

// Tolerance of float arithmetic on numbers of size 1 to 30.
inline constexpr double kNear = 4e-6;

// A controller over a fake network, in a state whose numbers can be told apart.
struct Layout {
  Layout(const std::string& name, int input, int output, const ControllerOptions& options = {}, const char* in = "x",
         const char* out = "y")
      : Layout(
            load_descriptor(name),
            name == "beyond_mimic" ? std::vector<Port>{{in, input}, {"time_step", 1}} : std::vector<Port>{{in, input}},
            {{out, output}}, options) {}
  Layout(Descriptor of, const std::vector<Port>& inputs, const std::vector<Port>& outputs,
         const ControllerOptions& options = {})
      : descriptor(std::move(of)), robot(body(descriptor.robot)) {
    controller = make_descriptor_controller(descriptor, robot, std::make_unique<FakeNetwork>(inputs, outputs, memory),
                                            "fake", options);
    state = robot->standing_state();
    state.X_WB.R = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitX());
    state.v_WB = {0.3, -0.2, 0.1};
    state.w_WB_B = {0.11, 0.22, 0.33};
    for (int j = 0; j < robot->dof(); ++j) {
      state.q[j] = 0.01 * (j + 1);
      state.v[j] = 1.0 + 0.1 * j;
    }
    reference = {robot->standing_state().X_WB, Eigen::VectorXd::Zero(robot->dof())};
    for (int j = 0; j < robot->dof(); ++j) reference.q[j] = 2.0 + 0.01 * j;
    reference.X_WB.R =
        Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX());
    controller->reset(state);
    for (size_t a = 0; a < memory.answered[0].size(); ++a) memory.answered[0][a] = 0.1F * static_cast<float>(a + 1);
  }
  void act() { controller->act(state, reference, command); }
  // The reference goes on for a tick: 1 cm in x, 2 cm in y of W, turns about its own z axis by 0.01 rad.
  void go_on() {
    reference.X_WB.p += Eigen::Vector3d(0.01, 0.02, 0.0);
    reference.X_WB.R = reference.X_WB.R * Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitZ());
  }
  [[nodiscard]] double shown(int index) const { return memory.shown[0][index]; }
  [[nodiscard]] int joint(const std::string& name) const { return robot->joint_index(name + "_joint"); }
  [[nodiscard]] double neutral(int j) const {
    for (const DescriptorJoint& each : descriptor.joints)
      if (each.name == robot->joints[j].name) return each.neutral;
    return 0.0;
  }
  void expect_vector(int first, const Eigen::Vector3d& v, const char* what) const {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(shown(first + i), v[i], kNear) << what << " " << i;
  }
  // q - default, scaled speeds, previous action: of the first `joints` joints of the robot's order.
  void expect_joints(int positions, int velocities, double scale, int joints) const {
    for (int j = 0; j < joints; ++j) {
      EXPECT_NEAR(shown(positions + j), state.q[j] - neutral(j), kNear) << robot->joints[j].name;
      EXPECT_NEAR(shown(velocities + j), scale * state.v[j], kNear) << robot->joints[j].name;
    }
  }
  void expect_action(int first, int count, double factor) const {
    for (int a = 0; a < count; ++a) EXPECT_NEAR(shown(first + a), factor * 0.1 * (a + 1), kNear) << a;
  }
  [[nodiscard]] Eigen::Vector3d gravity() const { return state.X_WB.R.conjugate() * Eigen::Vector3d(0, 0, -1); }

  Descriptor descriptor;
  std::shared_ptr<const RobotModel> robot;
  test::FakeMemory memory;
  std::unique_ptr<Controller> controller;
  RobotState state;
  Reference reference;
  JointCommand command;
};

// The same told a velocity from outside, standing still at its robot's neutral pose.
struct ToldLayout {
  ToldLayout(const Descriptor& descriptor, std::shared_ptr<const VelocityCommand> told)
      : robot(body(descriptor.robot)), state(robot->standing_state()), reference{state.X_WB, state.q} {
    std::vector<Port> inputs = {{"x", descriptor.input_size(descriptor.observation.inputs[0])}};
    auto network = std::make_unique<FakeNetwork>(inputs, std::vector<Port>{{"y", descriptor.actions()}}, *memory);
    controller = make_descriptor_controller(descriptor, robot, std::move(network), "fake", {}, std::move(told));
    controller->reset(state);
  }
  void act() const {
    JointCommand command;
    controller->act(state, reference, command);
  }

  std::shared_ptr<const RobotModel> robot;
  RobotState state;
  Reference reference;
  std::unique_ptr<FakeMemory> memory = std::make_unique<FakeMemory>();
  std::unique_ptr<Controller> controller;
};

}  // namespace duet::test
