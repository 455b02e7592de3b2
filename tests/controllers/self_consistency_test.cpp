// A controller asked about itself, without physics, over networks whose answers are known; and readings of descriptors.
#include "duet/controllers/audit/self_consistency.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

#include "duet/archives/npy/npz.h"
#include "duet/controllers/audit/readings.h"
#include "duet/controllers/audit/trace.h"
#include "tests/controllers/audit_defects.h"
#include "tests/controllers/layout.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

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

// Traces of controllers' own programs: read, held against a descriptor, refused where they say too little.

// A network that answers with numbers of its input, so that what it is shown matters.
class MixingNetwork final : public Network {
 public:
  MixingNetwork(int in, int out) : inputs_{{"x", in}}, outputs_{{"y", out}} {}
  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }
  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    for (std::size_t a = 0; a < outputs[0].size(); ++a)
      outputs[0][a] = 0.3F * inputs[0][9 + a] - 0.1F * inputs[0][a % 9] + 0.02F * inputs[0][21 + a];
  }

 private:
  std::vector<Port> inputs_, outputs_;
};

// Six acts as the program of rl_gym's makers would have written them down.
struct RecordedTrace {
  RecordedTrace() : descriptor(load_descriptor("rl_gym")), robot(test::body(descriptor.robot)) {
    const int in = descriptor.input_size(descriptor.observation.inputs[0]);
    network = [in, out = descriptor.actions()] { return std::make_unique<MixingNetwork>(in, out); };
    const auto told =
        std::make_shared<VelocityCommand>(VelocityCommand{.forward = 0.5, .lateral = 0.1, .yaw_rate = -0.2});
    test::FakeMemory memory;
    const auto controller = make_descriptor_controller(descriptor, robot, network(), "fake", {}, told);
    header();
    for (int row = 0; row < 6; ++row) {
      RobotState state = robot->standing_state();
      state.X_WB.R = Eigen::AngleAxisd(0.05 * row, Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(0.02 * row * row, Eigen::Vector3d::UnitX());
      state.w_WB_B = {0.1 * row, -0.2, 0.3 * row * row};
      for (int j = 0; j < robot->dof(); ++j) {
        state.q[j] += 0.01 * (j + 1) * row;
        state.v[j] = 0.1 * (j + 1) - 0.03 * row * row;
      }
      if (row == 0) controller->reset(state);
      JointCommand command = robot->default_command(robot->neutral);
      controller->act(state, {state.X_WB, robot->neutral}, command);
      add_row(state, command);
    }
  }

  void header() {
    csv = "quat_w,quat_x,quat_y,quat_z,gyro_x,gyro_y,gyro_z,command_forward,command_lateral,command_yaw_rate";
    for (const char* stem : {"q", "v", "target"})
      for (const DescriptorJoint& joint : descriptor.joints) csv += fmt::format(",{}.{}", stem, joint.name);
    csv += "\n";
  }
  void add_row(const RobotState& state, const JointCommand& command) {
    const Eigen::Quaterniond& R = state.X_WB.R;
    csv += fmt::format("{},{},{},{},{},{},{},0.5,0.1,-0.2", R.w(), R.x(), R.y(), R.z(), state.w_WB_B.x(),
                       state.w_WB_B.y(), state.w_WB_B.z());
    for (const Eigen::VectorXd* values : {&state.q, &state.v, &command.q_target})
      for (const DescriptorJoint& joint : descriptor.joints)
        csv += fmt::format(",{}", (*values)[robot->joint_index(joint.name)]);
    csv += "\n";
  }
  [[nodiscard]] TraceAgreement compare(const Descriptor& other) const {
    return compare_with_trace(other, robot, network, "fake", parse_controller_trace(csv, "trace.csv", other, *robot));
  }
  [[nodiscard]] std::string refusal(const std::string& bytes) const {
    return test::thrown_message<InputError>([&] { parse_controller_trace(bytes, "trace.csv", descriptor, *robot); });
  }

  Descriptor descriptor;
  std::shared_ptr<const RobotModel> robot;
  NetworkMaker network;
  std::string csv;
};

TEST(ControllerTrace, EqualsTheDescriptorThatItWasRecordedWith) {
  const RecordedTrace recorded;
  const TraceAgreement found = recorded.compare(recorded.descriptor);
  EXPECT_TRUE(found.equal) << found.first;
  EXPECT_LE(found.target, 1e-9);
}

TEST(ControllerTrace, DiffersFromEachOtherScale) {
  const RecordedTrace recorded;
  for (const ChannelKind kind :
       {ChannelKind::kBaseAngularVelocity, ChannelKind::kJointVelocity, ChannelKind::kCommandVelocity}) {
    Descriptor other = recorded.descriptor;
    for (Channel& channel : other.observation.groups[0].channels)
      if (channel.kind == kind)
        for (double& scale : channel.scale) scale *= 2.0;
    const TraceAgreement found = recorded.compare(other);
    EXPECT_FALSE(found.equal);
    EXPECT_THAT(found.first, HasSubstr("in the trace"));
  }
}

TEST(ControllerTrace, SaysWhichNumbersOfTheObservationAreOther) {
  const RecordedTrace recorded;
  const ControllerTrace trace = parse_controller_trace(recorded.csv, "trace.csv", recorded.descriptor, *recorded.robot);
  ControllerTrace seen = trace;
  seen.observations = observations_of_trace(recorded.descriptor, recorded.robot, recorded.network, "fake", trace);
  Descriptor other = recorded.descriptor;
  std::vector<Channel>& channels = other.observation.groups[0].channels;
  for (Channel& channel : channels)
    if (channel.kind == ChannelKind::kJointVelocity) channel.scale = {1.0};
  std::swap(channels[0], channels[1]);  // gyro and gravity
  const TraceAgreement found = compare_with_trace(other, recorded.robot, recorded.network, "fake", seen);
  EXPECT_THAT(found.patterns, testing::Contains(HasSubstr("stands at place 3 of the trace")));
  EXPECT_THAT(
      found.patterns,
      testing::Contains(HasSubstr("(joint_velocity of 'left_knee_joint') is 0.05 times as large in the trace")));
}

TEST(ControllerTrace, IsReadFromAnArchiveToo) {
  const RecordedTrace recorded;
  const ControllerTrace csv = parse_controller_trace(recorded.csv, "trace.csv", recorded.descriptor, *recorded.robot);
  const std::size_t rows = csv.states.size(), joints = recorded.descriptor.joints.size();
  std::vector<double> quat, gyro, q, v, command, target;
  std::vector<std::string> names;
  for (const DescriptorJoint& joint : recorded.descriptor.joints) names.push_back(joint.name);
  for (std::size_t row = 0; row < rows; ++row) {
    const RobotState& state = csv.states[row];
    quat.insert(quat.end(), {state.X_WB.R.w(), state.X_WB.R.x(), state.X_WB.R.y(), state.X_WB.R.z()});
    for (int i = 0; i < 3; ++i) gyro.push_back(state.w_WB_B[i]);
    command.insert(command.end(), {0.5, 0.1, -0.2});
    for (std::size_t j = 0; j < joints; ++j) {
      const int r = recorded.robot->joint_index(names[j]);
      q.push_back(state.q[r]);
      v.push_back(state.v[r]);
      target.push_back(csv.targets(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(j)));
    }
  }
  Npz archive;
  archive.set("quat_wxyz", quat, {rows, 4});
  archive.set("gyro", gyro, {rows, 3});
  archive.set("command", command, {rows, 3});
  archive.set("joint_names", names);
  archive.set("q", q, {rows, joints});
  archive.set("v", v, {rows, joints});
  archive.set("target", target, {rows, joints});
  const ControllerTrace npz =
      parse_controller_trace(archive.bytes(), "trace.npz", recorded.descriptor, *recorded.robot);
  const TraceAgreement found = compare_with_trace(recorded.descriptor, recorded.robot, recorded.network, "fake", npz);
  EXPECT_TRUE(found.equal) << found.first;
}

TEST(ControllerTrace, IsRefusedWhereItSaysTooLittle) {
  const RecordedTrace recorded;
  const auto without = [&](const std::string& from, const std::string& to) {
    std::string other = recorded.csv;
    other.replace(other.find(from), from.size(), to);
    return recorded.refusal(other);
  };
  EXPECT_SENTENCE(recorded.refusal(""));
  EXPECT_SENTENCE(recorded.refusal(recorded.csv.substr(0, recorded.csv.find('\n') + 1)));
  EXPECT_SENTENCE(without("gyro_y", "gyro_w"));
  EXPECT_SENTENCE(without("gyro_y", "gyro_x"));
  EXPECT_SENTENCE(without("v.left_knee_joint", "v.left_knee"));
  EXPECT_SENTENCE(without("target.left_hip_pitch_joint", "wanted.left_hip_pitch_joint"));
  EXPECT_SENTENCE(without("\n1,", "\n2,"));
  EXPECT_SENTENCE(without("\n1,", "\nnan,"));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] {
    const Descriptor tracker = load_descriptor("twist2");
    parse_controller_trace(recorded.csv, "trace.csv", tracker, *test::body(tracker.robot));
  }));
}

}  // namespace
}  // namespace duet
