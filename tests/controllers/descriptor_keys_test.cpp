// Effects of a descriptor's keys that no network of the first six needed: a command by its axes, a stance, clocks
// that hold and warp, actions around two poses, states, the gyro's frame. The network is a fake.
#include <cmath>
#include <numbers>

#include "duet/controllers/catalogue/registry.h"
#include "duet/core/file.h"
#include "duet/core/require.h"
#include "duet/robots/kinematics.h"
#include "tests/controllers/layout.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::kNear;
using test::Layout;
using test::thrown_message;

constexpr double kPi = std::numbers::pi;

Channel channel_of(ChannelKind kind) {
  Channel channel;
  channel.kind = kind;
  return channel;
}

// HOMIE's joints, shown these channels alone.
Descriptor showing(const std::vector<Channel>& channels, const std::optional<StandBounds>& stands_below = {}) {
  Descriptor descriptor = load_descriptor("homie");
  descriptor.observation.groups = {{.name = "frame", .line = 1, .channels = channels}};
  descriptor.observation.inputs = {{.name = "", .line = 1, .parts = {{.line = 1, .groups = {0}}}, .state = {}}};
  descriptor.command->stands_below = stands_below;
  return descriptor;
}

Layout layout_of(const Descriptor& descriptor, const ControllerOptions& options) {
  return {descriptor, {{"x", descriptor.input_size(descriptor.observation.inputs[0])}}, {{"y", 12}}, options};
}

TEST(CommandAxes, AreShownInTheirOrder) {
  Channel turn = channel_of(ChannelKind::kCommandVelocity), walk = turn;
  turn.axes = {2};
  walk.axes = {1, 0};
  walk.scale = {2.0, 4.0};
  Layout l = layout_of(showing({turn, walk}), {{"command", "0.5,-0.3,0.8"}});
  l.act();
  EXPECT_NEAR(l.shown(0), 0.8, kNear);
  EXPECT_NEAR(l.shown(1), -0.6, kNear);
  EXPECT_NEAR(l.shown(2), 2.0, kNear);
}

TEST(CommandAxes, TheYawScaleIsOfTheYawRateWhereverItStands) {
  Channel turn = channel_of(ChannelKind::kCommandVelocity), walk = turn;
  turn.axes = {2};
  walk.axes = {0, 1};
  Layout l = layout_of(showing({turn, walk}), {{"command", "0.5,-0.3,0.8"}, {"yaw_scale", "0.25"}});
  l.act();
  EXPECT_NEAR(l.shown(0), 0.2, kNear);
  EXPECT_NEAR(l.shown(1), 0.5, kNear);
  EXPECT_NEAR(l.shown(2), -0.3, kNear);
  const auto has_option = [](const Descriptor& descriptor) {
    const ControllerInfo info = descriptor_info(descriptor);
    return std::ranges::any_of(info.options, [](const auto& option) { return option.name == "yaw_scale"; });
  };
  EXPECT_TRUE(has_option(showing({turn})));
  EXPECT_FALSE(has_option(showing({walk})));
}

TEST(CommandStand, IsWalkAtTheBoundsAndStandBelowBoth) {
  const std::pair<const char*, double> cases[] = {{"0.1,0,0", 1.0},       {"0.099,0,0", 0.0}, {"0.08,0.07,0", 1.0},
                                                  {"0,0,0.2", 1.0},       {"0,0,-0.19", 0.0}, {"0,0,-0.2", 1.0},
                                                  {"0.05,0.05,0.1", 0.0}, {"-0.5,0,0", 1.0},  {"0,0,0", 0.0}};
  for (const auto& [command, walks] : cases) {
    const Descriptor descriptor =
        showing({channel_of(ChannelKind::kCommandStand), channel_of(ChannelKind::kCommandVelocity)},
                StandBounds{.speed = 0.1, .yaw_rate = 0.2});
    Layout l = layout_of(descriptor, {{"command", command}});
    l.act();
    EXPECT_EQ(l.shown(0), walks) << command;
    if (walks == 0.0) {  // told to stand it is shown no velocity
      for (int i = 1; i < 4; ++i) EXPECT_EQ(l.shown(i), 0.0) << command;
    }
  }
}

TEST(CommandStand, WithoutBoundsNoCommandIsOneToStand) {
  Layout l = layout_of(showing({channel_of(ChannelKind::kCommandVelocity), channel_of(ChannelKind::kCommandHeight)}),
                       {{"command", "0.001,0.002,0.003,0.5"}});
  l.act();
  l.expect_vector(0, {0.001, 0.002, 0.003}, "command");
  EXPECT_NEAR(l.shown(3), 0.5, kNear);
}

TEST(CommandStand, KeepsTheCommandedHeight) {
  Layout l = layout_of(showing({channel_of(ChannelKind::kCommandHeight)}, StandBounds{.speed = 0.1, .yaw_rate = 0.2}),
                       {{"command", "0,0,0,0.5"}});
  l.act();
  EXPECT_NEAR(l.shown(0), 0.5, kNear);
}

Channel gait(ChannelKind kind, const std::vector<double>& phases, const std::vector<double>& standing = {}) {
  Channel channel = channel_of(kind);
  channel.gait.frequency_hz = 1.0;
  channel.gait.phases = phases;
  channel.gait.standing = standing;
  return channel;
}

// The reference's root stays or goes on at 0.5 m/s, which the law `direct` follows.
TEST(GatedClock, HoldsWhileToldToStandAndStartsAgainAtItsPhases) {
  const Descriptor descriptor =
      showing({gait(ChannelKind::kGaitSine, {0.0, kPi}, {0.3, 0.4}), gait(ChannelKind::kGaitCosine, {0.0, kPi})},
              StandBounds{.speed = 0.1, .yaw_rate = 10.0});
  Layout l = layout_of(descriptor, {{"conversion", "direct"}});
  l.state = l.robot->standing_state();
  l.reference = {l.state.X_WB, l.robot->neutral};
  double x = 0.0;
  int tick = 0;
  const auto act = [&](bool walks) {
    x += walks ? 0.01 : 0.0;
    l.reference.X_WB.p.x() = l.state.X_WB.p.x() = x;  // where the robot is: only the reference's own speed counts
    l.act();
    EXPECT_NEAR(l.shown(2), std::cos(2.0 * kPi * 0.02 * tick), kNear) << "the other goes on";
    ++tick;
  };
  for (int i = 0; i < 3; ++i) {
    act(false);
    EXPECT_NEAR(l.shown(0), std::sin(0.3), kNear);
    EXPECT_NEAR(l.shown(1), std::sin(0.4), kNear);
  }
  for (int episode = 0; episode < 2; ++episode) {
    for (int i = 0; i < 5; ++i) {
      act(true);
      EXPECT_NEAR(l.shown(0), std::sin(2.0 * kPi * 0.02 * i), kNear) << i;
      EXPECT_NEAR(l.shown(1), std::sin(2.0 * kPi * 0.02 * i + kPi), kNear) << i;
    }
    act(false);
    EXPECT_NEAR(l.shown(0), std::sin(0.3), kNear);
  }
}

TEST(GatedClock, StartsAtItsPhasesWhereItIsToldToWalkAtOnceAndAfterAReset) {
  const Descriptor descriptor =
      showing({gait(ChannelKind::kGaitSine, {0.5}, {0.3})}, StandBounds{.speed = 0.1, .yaw_rate = 0.1});
  Layout l = layout_of(descriptor, {{"command", "0.5,0,0"}});
  for (int episode = 0; episode < 2; ++episode) {
    for (int tick = 0; tick < 4; ++tick) {
      l.act();
      EXPECT_NEAR(l.shown(0), std::sin(0.5 + 2.0 * kPi * 0.02 * tick), kNear) << tick;
    }
    l.controller->reset(l.state);
  }
}

// OpenWBT's: a foot stands for 0.6 of its cycle, which is the first half of the wave.
TEST(WarpedClock, TakesTheStanceForTheFirstHalfOfTheWave) {
  Channel channel = gait(ChannelKind::kGaitSine, {0.0, 0.6 * kPi, 1.2 * kPi, 1.6 * kPi, 4.6 * kPi, -0.4 * kPi});
  channel.gait.stance = 0.6;
  Layout l = layout_of(showing({channel}), {{"command", "0,0,0"}});
  l.act();
  // Phases in parts of a turn: 0, 0.3, 0.6, 0.8, 2.3, -0.2; in parts of the wave: 0, 0.25, 0.5, 0.75, 0.25, 0.75.
  const double expected[] = {0.0, 1.0, 0.0, -1.0, 1.0, -1.0};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(l.shown(i), expected[i], kNear) << i;
  l.act();
  EXPECT_NEAR(l.shown(0), std::sin(2.0 * kPi * 0.5 * 0.02 / 0.6), kNear);
  EXPECT_NEAR(l.shown(3), std::sin(2.0 * kPi * (0.75 + 0.5 * 0.02 / 0.4)), kNear);
}

TEST(WarpedClock, HoldsWarpedPhases) {
  Channel channel = gait(ChannelKind::kGaitSine, {0.0}, {0.6 * kPi});
  channel.gait.stance = 0.6;
  Layout l = layout_of(showing({channel}, StandBounds{.speed = 0.1, .yaw_rate = 0.1}), {{"command", "0,0,0"}});
  l.act();
  EXPECT_NEAR(l.shown(0), 1.0, kNear);
}

TEST(ActionAround, IsEachJointsOwn) {
  Descriptor descriptor = load_descriptor("homie");
  descriptor.joints[3].around_reference = true;
  Layout l(descriptor, {{"x", 456}}, {{"y", 12}}, {{"command", "0,0,0"}});
  l.act();
  EXPECT_NEAR(l.command.q_target[2], 0.25 * 0.3, kNear);
  EXPECT_NEAR(l.command.q_target[3], l.reference.q[3] + 0.25 * 0.4, kNear);
}

Descriptor with_state(const std::string& output) {
  Descriptor descriptor = load_descriptor("rl_gym");
  descriptor.observation.inputs[0].name = "x";
  descriptor.observation.inputs.push_back({.name = "h", .line = 60, .parts = {}, .state = output});
  descriptor.output = "y";
  return descriptor;
}

TEST(StateInput, IsTheOutputOfTheTickBeforeAndZeroAtTheStart) {
  Layout l(with_state("next_h"), {{"x", 47}, {"h", 3}}, {{"y", 12}, {"next_h", 3}});
  for (int episode = 0; episode < 2; ++episode) {
    l.memory.answered[1] = {1.0F, 2.0F, 3.0F};
    l.act();
    EXPECT_EQ(l.memory.shown[1], (std::vector<float>{0.0F, 0.0F, 0.0F}));
    l.memory.answered[1] = {4.0F, 5.0F, 6.0F};
    l.act();
    EXPECT_EQ(l.memory.shown[1], (std::vector<float>{1.0F, 2.0F, 3.0F}));
    l.act();
    EXPECT_EQ(l.memory.shown[1], (std::vector<float>{4.0F, 5.0F, 6.0F}));
    l.controller->reset(l.state);
  }
}

TEST(StateInput, ThatDoesNotFitItsOutputIsRefused) {
  const auto refusal = [](const std::string& output, const std::vector<Port>& inputs,
                          const std::vector<Port>& outputs) {
    return thrown_message<InputError>([&] { Layout(with_state(output), inputs, outputs); });
  };
  EXPECT_SENTENCE(refusal("next", {{"x", 47}, {"h", 3}}, {{"y", 12}, {"next_h", 3}}));
  EXPECT_SENTENCE(refusal("next_h", {{"x", 47}, {"h", 3}}, {{"y", 12}, {"next_h", 4}}));
  EXPECT_SENTENCE(refusal("next_h", {{"x", 47}, {"g", 3}}, {{"y", 12}, {"next_h", 3}}));
}

// The frame's rate by the difference of its poses a moment apart.
TEST(GyroFrame, ShowsTheRateAndTheGravityOfThatFrame) {
  Channel gyro = channel_of(ChannelKind::kBaseAngularVelocity), gravity = channel_of(ChannelKind::kGravity);
  for (const char* name : {"torso_link", "left_ankle_roll_link", "head_link"}) {
    gyro.frame = gravity.frame = name;
    Layout l = layout_of(showing({gyro, gravity}), {{"command", "0,0,0"}});
    l.act();
    constexpr double kMoment = 1e-6;  // [s]
    const int frame = l.robot->frame_index(name);
    Kinematics now(*l.robot), later(*l.robot);
    now.update(l.state.X_WB, l.state.q);
    Pose moved = l.state.X_WB;
    moved.R = moved.R * Eigen::AngleAxisd(l.state.w_WB_B.norm() * kMoment, l.state.w_WB_B.normalized());
    later.update(moved, l.state.q + kMoment * l.state.v);
    const Eigen::Quaterniond R_WF = now.frame_pose(frame).R;
    const Eigen::AngleAxisd turn(R_WF.conjugate() * later.frame_pose(frame).R);
    const Eigen::Vector3d rate = turn.angle() / kMoment * turn.axis();
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(l.shown(i), rate[i], 1e-4) << name << " " << i;
    l.expect_vector(3, R_WF.conjugate() * Eigen::Vector3d(0, 0, -1), name);
  }
}

TEST(GyroFrame, OfTheBaseIsTheBaseToTheBit) {
  Channel gyro = channel_of(ChannelKind::kBaseAngularVelocity), gravity = channel_of(ChannelKind::kGravity);
  Layout plain = layout_of(showing({gyro, gravity}), {{"command", "0,0,0"}});
  gyro.frame = gravity.frame = "pelvis";
  Layout framed = layout_of(showing({gyro, gravity}), {{"command", "0,0,0"}});
  plain.act();
  framed.act();
  EXPECT_EQ(framed.memory.shown[0], plain.memory.shown[0]);
}

// The card says where the gyro sits, unless the channel does.
TEST(GyroFrame, IsTheCardsWhereTheChannelNamesNone) {
  Channel gyro = channel_of(ChannelKind::kBaseAngularVelocity), gravity = channel_of(ChannelKind::kGravity);
  const auto shown = [&](const std::string& of_card, const std::string& of_channel) {
    gyro.frame = gravity.frame = of_channel;
    const Descriptor descriptor = showing({gyro, gravity});
    const Layout of_base = layout_of(descriptor, {{"command", "0,0,0"}});  // for its state
    auto robot = std::make_shared<RobotModel>(*of_base.robot);
    robot->roles.imu_frame = robot->frame_index(of_card);
    test::FakeMemory memory;
    const auto controller = make_descriptor_controller(
        descriptor, robot,
        std::make_unique<test::FakeNetwork>(std::vector<Port>{{"x", 6}}, std::vector<Port>{{"y", 12}}, memory), "fake",
        {{"command", "0,0,0"}});
    JointCommand command;
    controller->reset(of_base.state);
    controller->act(of_base.state, of_base.reference, command);
    return memory.shown[0];
  };
  EXPECT_EQ(shown("torso_link", ""), shown("pelvis", "torso_link"));
  EXPECT_EQ(shown("torso_link", "pelvis"), shown("pelvis", ""));
  EXPECT_NE(shown("torso_link", ""), shown("pelvis", ""));
}

TEST(GyroFrame, ThatTheRobotLacksIsRefused) {
  Channel gyro = channel_of(ChannelKind::kBaseAngularVelocity);
  gyro.frame = "torso_lnk";
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { layout_of(showing({gyro}), {}); }));
}

TEST(CardByPath, IsTheBodyOfItsController) {
  const test::ScratchFolder folder;
  std::filesystem::create_directories(folder / "cards");
  for (const char* file : {"g1.yaml", "g1.urdf"})
    std::filesystem::copy(std::string(DUET_SOURCE_DIR "/robots/g1/") + file, (folder / "cards/") + file);
  std::string text = read_file(load_descriptor("beyond_mimic").file);
  text.replace(text.find("robot: g1"), 9, "robot: cards/g1.yaml");
  write_file(folder / "mine.yaml", text);
  const ControllerInfo info = controller_info(folder / "mine.yaml");
  EXPECT_EQ(info.robot, folder / "cards/g1.yaml");
  EXPECT_EQ(load_shared_robot(card_path(info.robot))->dof(), 29);
}

}  // namespace
}  // namespace duet
