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

// The phase of a clock after standing, by its tick: walking for 3 ticks, standing for 2, walking again.
TEST(GatedClock, RestartsRunsOnOrPausesAsItIsTold) {
  const std::pair<AfterStanding, std::vector<int>> cases[] = {{AfterStanding::kRestarts, {0, 1, 2, -1, -1, 0, 1}},
                                                              {AfterStanding::kRunsOn, {0, 1, 2, -1, -1, 5, 6}},
                                                              {AfterStanding::kPauses, {0, 1, 2, -1, -1, 3, 4}}};
  for (const auto& [after, ticks] : cases)
    for (const bool silent : {false, true}) {
      Channel sine = gait(ChannelKind::kGaitSine, {0.1}, {0.3}), cosine = gait(ChannelKind::kGaitCosine, {0.1}, {0.3});
      for (Channel* channel : {&sine, &cosine}) {
        channel->gait.after_standing = after;
        channel->gait.silent = silent;
      }
      auto told = std::make_shared<VelocityCommand>();
      const test::ToldLayout l(showing({sine, cosine}, StandBounds{.speed = 0.1, .yaw_rate = 0.1}), told);
      for (const int tick : ticks) {
        told->forward = tick < 0 ? 0.0 : 0.5;
        l.act();
        const double angle = tick < 0 ? 0.3 : 0.1 + 2.0 * kPi * 0.02 * tick;
        const double size = tick < 0 && silent ? 0.0 : 1.0;
        EXPECT_NEAR(l.memory->shown[0][0], size * std::sin(angle), kNear) << tick;
        EXPECT_NEAR(l.memory->shown[0][1], size * std::cos(angle), kNear) << tick;
      }
    }
}

// HOMIE's joints and a clock, at another rate.
Descriptor at_rate(double rate_hz) {
  Descriptor descriptor = showing(
      {channel_of(ChannelKind::kTick), gait(ChannelKind::kGaitSine, {0.0}), channel_of(ChannelKind::kPreviousAction)});
  descriptor.rate_hz = rate_hz;
  return descriptor;
}

TEST(Rate, BelowFiftyTheNetworkActsEverySecondTickAndItsTargetsStand) {
  Layout l = layout_of(at_rate(25.0), {{"command", "0,0,0"}});
  EXPECT_EQ(l.controller->acts_per_tick(), 1);
  const int follower = l.robot->joint_index("left_elbow_joint");
  double target = 0.0;
  for (int tick = 0; tick < 8; ++tick) {
    const float asked = 0.1F * static_cast<float>(tick + 1);
    l.memory.answered[0][0] = asked;
    l.reference.q[follower] = tick;
    l.act();
    EXPECT_EQ(l.memory.runs, tick / 2 + 1);
    EXPECT_EQ(l.shown(0), tick / 2) << "ticks are the network's";
    EXPECT_NEAR(l.shown(1), std::sin(2.0 * kPi * 0.04 * (tick / 2)), kNear) << "seconds are the world's";
    EXPECT_NEAR(l.shown(2), tick < 2 ? 0.0 : 0.1 * (tick / 2 * 2 - 1), kNear) << "the action of its tick before";
    if (tick % 2 == 0) target = l.command.q_target[l.joint("left_hip_pitch")];
    EXPECT_EQ(l.command.q_target[l.joint("left_hip_pitch")], target) << tick;
    EXPECT_EQ(l.command.q_target[follower], tick) << "the reference's joints follow at 50 Hz";
  }
}

TEST(Rate, AboveFiftyItActsWithinATick) {
  Layout l = layout_of(at_rate(100.0), {{"command", "0,0,0"}});
  EXPECT_EQ(l.controller->acts_per_tick(), 2);
  for (int call = 0; call < 8; ++call) {
    l.act();
    EXPECT_EQ(l.memory.runs, call + 1);
    EXPECT_EQ(l.shown(0), call);
    EXPECT_NEAR(l.shown(1), std::sin(2.0 * kPi * 0.01 * call), kNear);
  }
}

// The reference moves once a tick, however often the controller acts in it.
TEST(Rate, TheReferencesSpeedIsOfItsTicks) {
  Channel speed = channel_of(ChannelKind::kReferenceJointVelocity);
  speed.joints = {0};
  Descriptor descriptor = showing({speed});
  descriptor.rate_hz = 100.0;
  Layout l = layout_of(descriptor, {{"command", "0,0,0"}});
  const int joint = l.joint("left_hip_pitch");
  for (int call = 0; call < 8; ++call) {
    if (call > 0 && call % 2 == 0) l.reference.q[joint] += 0.01;
    l.act();
    EXPECT_NEAR(l.shown(0), call < 2 ? 0.0 : 0.5, 1e-5) << call;
  }
}

TEST(Rate, AboveFiftyNobodyTellsAVelocityAtEachTick) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [] { test::ToldLayout(at_rate(100.0), std::make_shared<VelocityCommand>()); }));
}

TEST(RollPitchYaw, AreTheTurnsAboutTheAxesOfTheWorld) {
  Channel all = channel_of(ChannelKind::kRollPitchYaw), yaw = all;
  yaw.axes = {2};
  yaw.scale = {-2.0};
  Layout l = layout_of(showing({all, yaw}), {{"command", "0,0,0"}});
  for (const double heading : {0.7, -3.0, 3.1, 3.5}) {
    l.state.X_WB.R = Eigen::AngleAxisd(heading, Eigen::Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitX());
    l.act();
    const double wrapped = std::remainder(heading, 2.0 * kPi);
    l.expect_vector(0, {-0.1, 0.2, wrapped}, "angles");
    EXPECT_NEAR(l.shown(3), -2.0 * wrapped, kNear);
  }
}

TEST(ActionRange, IsEachJointsOwnAndThePreviousActionKnowsIt) {
  Channel raw = channel_of(ChannelKind::kPreviousAction), clipped = raw;
  clipped.clipped = true;
  Descriptor descriptor = showing({raw, clipped});
  descriptor.action_clip = 0.25;
  descriptor.joints[0].clip = {-0.3, 0.05};
  descriptor.joints[3].clip = {0.35, 2.0};
  Layout l = layout_of(descriptor, {{"command", "0,0,0"}});
  l.act();
  l.act();
  const double taken[] = {0.05, 0.2, 0.25, 0.4, 0.25};  // of 0.1, 0.2, ...
  for (int a = 0; a < 5; ++a) {
    EXPECT_NEAR(l.shown(a), 0.1 * (a + 1), kNear) << a;
    EXPECT_NEAR(l.shown(12 + a), taken[a], kNear) << a;
    const int joint = l.robot->joint_index(descriptor.joints[a].name);
    EXPECT_NEAR(l.command.q_target[joint], l.neutral(joint) + 0.25 * taken[a], kNear) << a;
  }
}

TEST(WithinLimits, KeepsTargetsOfActionsInsideTheJointsRange) {
  Descriptor descriptor = showing({channel_of(ChannelKind::kTick)});
  for (const bool within : {false, true}) {
    descriptor.within_limits = within;
    Layout l = layout_of(descriptor, {{"command", "0,0,0"}});
    for (const float size : {50.0F, -50.0F}) {
      std::ranges::fill(l.memory.answered[0], size);
      l.reference.q.setConstant(50.0);
      l.act();
      for (const DescriptorJoint& joint : descriptor.joints) {
        if (!joint.action) continue;
        const int j = l.robot->joint_index(joint.name);
        const double free = joint.neutral + *joint.action * size;
        const double limit = size > 0.0F ? l.robot->joints[j].upper : l.robot->joints[j].lower;
        EXPECT_NEAR(l.command.q_target[j], within ? limit : free, 1e-3) << joint.name;
      }
      EXPECT_EQ(l.command.q_target[l.robot->joint_index("left_elbow_joint")], 50.0) << "the reference's are not its";
    }
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
