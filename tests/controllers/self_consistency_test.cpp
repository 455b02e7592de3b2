// A controller asked about itself, without physics, over networks whose answers are known; and readings of descriptors.
#include "duet/controllers/audit/self_consistency.h"

#include <gmock/gmock.h>

#include "duet/controllers/audit/readings.h"
#include "tests/controllers/audit_defects.h"
#include "tests/controllers/layout.h"
#include "tests/support.h"

namespace duet {
namespace {

// Answers joint a with `share` of its angle, as rl_gym's descriptor shows it.
class FollowingNetwork final : public Network {
 public:
  FollowingNetwork(int in, int out, float share) : inputs_{{"x", in}}, outputs_{{"y", out}}, share_(share) {}
  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }
  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    for (std::size_t a = 0; a < outputs[0].size(); ++a) outputs[0][a] = share_ * inputs[0][9 + a];
  }

 private:
  std::vector<Port> inputs_, outputs_;
  float share_;
};

struct Follower {
  explicit Follower(float share) : descriptor(load_descriptor("rl_gym")), robot(test::body(descriptor.robot)) {
    make = [robot = robot, share](const Descriptor& d, const ControllerOptions& options) {
      auto network = std::make_unique<FollowingNetwork>(d.input_size(d.observation.inputs[0]), d.actions(), share);
      return make_descriptor_controller(d, robot, std::move(network), "fake", options);
    };
  }
  Descriptor descriptor;
  std::shared_ptr<const RobotModel> robot;
  ControllerOfReading make;
};

TEST(SelfConsistency, MirroringTwiceIsTheSame) {
  const Follower follower(1.0F);
  RobotState state = follower.robot->standing_state();
  state.X_WB.R = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized());
  state.v_WB = {1, 2, 3};
  state.w_WB_B = {4, 5, 6};
  for (int j = 0; j < follower.robot->dof(); ++j) state.q[j] = 0.1 * j;
  state.v = 2.0 * state.q;
  const RobotState twice = mirrored(*follower.robot, mirrored(*follower.robot, state));
  EXPECT_TRUE(twice.X_WB.R.isApprox(state.X_WB.R, 1e-15));
  EXPECT_EQ(twice.v_WB, state.v_WB);
  EXPECT_EQ(twice.w_WB_B, state.w_WB_B);
  EXPECT_EQ(twice.q, state.q);
  EXPECT_EQ(twice.v, state.v);
}

TEST(SelfConsistency, AsymmetryIsZeroOfASymmetricNetworkAndLargeOfOneWithAJointTheOtherWay) {
  const Follower follower(1.0F);
  EXPECT_NEAR(asymmetry(follower.descriptor, *follower.robot, follower.make), 0.0, 1e-6);
  Descriptor flipped = follower.descriptor;
  flipped.joints[1].action = -*flipped.joints[1].action;
  EXPECT_GT(asymmetry(flipped, *follower.robot, follower.make), 0.3);
}

TEST(SelfConsistency, AJointThatFollowsItsOwnStepIsFound) {
  const Follower follower(6.0F);
  const JointFigure most = strongest_following(follower.descriptor, *follower.robot, follower.make);
  EXPECT_NEAR(most.value, 6.0 * *follower.descriptor.joints[0].action, 1e-4);
  Descriptor one = follower.descriptor;
  for (DescriptorJoint& joint : one.joints)
    if (joint.name != "left_knee_joint") joint.action = -*joint.action;
  EXPECT_EQ(strongest_following(one, *follower.robot, follower.make).joint, "left_knee_joint");
}

TEST(SelfConsistency, TheFirstTargetIsMeasuredFromTheDefaultPose) {
  const Follower follower(1.0F);
  Descriptor far = follower.descriptor;
  const int knee = follower.robot->joint_index("left_knee_joint");
  for (DescriptorJoint& joint : far.joints)
    if (joint.name == "left_knee_joint") joint.neutral = follower.robot->neutral[knee] - 2.0;
  const JointFigure most = farthest_first_target(far, *follower.robot, follower.make);
  EXPECT_EQ(most.joint, "left_knee_joint");
  EXPECT_NEAR(most.value, 0.25 * 2.0, 1e-4);
}

// A descriptor's contract in words that two descriptors can be compared by.
std::string words_of(const Descriptor& descriptor) {
  std::string words = fmt::format("{} {} {}", descriptor.rate_hz, descriptor.action_clip, descriptor.within_limits);
  for (const DescriptorJoint& joint : descriptor.joints)
    words += fmt::format(" {} {:.9g} {:.9g} {:.9g} {:.9g}", joint.name, joint.neutral + 0.0, joint.kp, joint.kd,
                         joint.action.value_or(0.0));
  for (const ObservationInput& input : descriptor.observation.inputs)
    for (const InputPart& part : input.parts) {
      words += fmt::format(" part {} {} {}", part.history.frames, part.history.current, part.history.starts_full);
      for (const int g : part.groups)
        for (const Channel& channel : descriptor.observation.groups[g].channels) {
          words += fmt::format(" {} {} {}", static_cast<int>(channel.kind), channel.clipped, channel.gait.frequency_hz);
          for (int i = 0; i < channel_size(channel, descriptor.widths()); ++i)
            words += fmt::format(" {:.6g}", channel.scale[channel.scale.size() == 1 ? 0 : i]);
          if (takes_key(channel.kind, "axes"))
            for (const int axis : channel.axes.empty() ? std::vector<int>{0, 1, 2} : channel.axes)
              words += fmt::format(" {}", axis);
          for (const double phase : channel.gait.phases)
            words += fmt::format(" {:.6g}", std::remainder(phase, 2.0 * std::numbers::pi));
        }
    }
  return words;
}

TEST(Readings, UndoEachSlip) {
  int undone = 0, all = 0;
  for (const test::InjectedDefect& defect : test::injected_defects()) {
    Descriptor descriptor = load_descriptor(defect.controller);
    const std::string right = words_of(descriptor);
    const auto robot = test::body(descriptor.robot);
    ASSERT_TRUE(defect.inject(descriptor, *robot)) << defect.name;
    EXPECT_NE(words_of(descriptor), right) << defect.name;
    const std::vector<Reading> readings = other_readings(descriptor, *robot);
    const bool found = std::ranges::any_of(readings, [&](const Reading& reading) {
      return reading.part == defect.part && words_of(reading.descriptor) == right;
    });
    undone += found ? 1 : 0;
    ++all;
    std::printf("%s: %s\n", defect.name, found ? "undone" : "not undone");
  }
  EXPECT_EQ(all, 29);
  EXPECT_GE(undone, 26);
}

TEST(Readings, KeepTheSizesOfTheNetwork) {
  for (const char* name :
       {"holosoma", "homie", "unitree_rl_lab", "playground_t1", "humanoid_gym", "twist2", "falcon"}) {
    const Descriptor descriptor = load_descriptor(name);
    const auto robot = test::body(descriptor.robot);
    const int size = descriptor.input_size(descriptor.observation.inputs[0]);
    for (const Reading& reading : other_readings(descriptor, *robot)) {
      EXPECT_EQ(reading.descriptor.input_size(reading.descriptor.observation.inputs[0]), size)
          << name << ": " << reading.said;
      EXPECT_EQ(reading.descriptor.actions(), descriptor.actions()) << name << ": " << reading.said;
    }
  }
}

}  // namespace
}  // namespace duet
