// HOMIE's processes as the executor: a stand-in for them on the loopback interface's multicast, as LCM has it.
#include "duet/hardware/executors/homie_executor.h"

#include <unistd.h>

#include <functional>
#include <thread>

#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/twin/fakes.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;

constexpr double kGuardDt = 0.002;

// A port that tests which run at the same time hardly share.
LcmPlace own_group() {
  LcmPlace place;
  place.port = 20000 + static_cast<int>(getpid()) % 20000;
  return place;
}

// Whatever waits in the group, to the stand-in; how many datagrams.
long hear(LcmChannel& channel, FakeHomie& homie, double now) {
  LcmBuffer buffer;
  bool own = false;
  long heard = 0;
  while (const std::size_t size = channel.receive(buffer, own)) {
    homie.receive(std::span<const std::byte>(buffer).first(size), now);
    ++heard;
  }
  return heard;
}

LowCommandFrame frame_with_arms(float first) {
  LowCommandFrame frame{};
  for (int j = 0; j < kG1Motors; ++j) {
    frame.motor[j].q = j < 15 ? 9.0f : first + 0.01f * static_cast<float>(j - 15);
    frame.motor[j].kp = 60.0f;
  }
  return frame;
}

TEST(HomieExecutor, SaysNothingBeforeItIsOpened) {
  LcmChannel listener(own_group());
  HomieExecutor executor(own_group(), 0.74, kGuardDt);
  FakeHomie homie;
  executor.write(frame_with_arms(0.1f));
  executor.send({0.2, 0.0, 0.0, 0.74});
  EXPECT_EQ(hear(listener, homie, 0.0), 0);
}

TEST(HomieExecutor, TellsVelocityAndFourteenArmJointsInTheirOrder) {
  LcmChannel listener(own_group());
  HomieExecutor executor(own_group(), 0.74, kGuardDt);
  FakeHomie homie;
  executor.open();
  executor.write(frame_with_arms(0.1f));
  executor.send({0.2, -0.1, 0.3, 0.7});
  EXPECT_EQ(hear(listener, homie, 0.0), 2);
  EXPECT_EQ(homie.velocity(), (std::array<double, 4>{0.2, -0.1, 0.3, 0.7}));
  LowCommandFrame sent;
  homie.write_command(5, sent);
  for (int j = 0; j < 14; ++j) EXPECT_FLOAT_EQ(sent.motor[15 + j].q, 0.1f + 0.01f * static_cast<float>(j)) << j;
  for (int j = 12; j < 15; ++j) EXPECT_EQ(sent.motor[j].q, 0.0f);  // the waist is HOMIE's, at 0
  EXPECT_NE(sent.motor[3].q, 9.0f);                                // and so are the legs
  EXPECT_EQ(homie.traffic().refused, 0);
}

// Its deployment makes half of a rate of turn.
TEST(HomieExecutor, AsksForTwiceTheRateOfTurn) {
  LcmChannel listener(own_group());
  HomieExecutor executor(own_group(), 0.74, kGuardDt);
  executor.open();
  executor.send({0.2, -0.1, 0.3, 0.7});
  LcmBuffer buffer;
  bool own = false;
  const std::size_t size = listener.receive(buffer, own);
  PedalCommand pedal;
  ASSERT_TRUE(decode(std::span<const std::byte>(buffer).first(size), pedal).refusal.empty());
  EXPECT_EQ(pedal.command, (std::array<double, 4>{0.2, -0.1, 0.6, 0.7}));
}

TEST(HomieExecutor, SpeaksFiftyTimesASecondAndDampingKeepsTheArms) {
  LcmChannel listener(own_group());
  HomieExecutor executor(own_group(), 0.74, kGuardDt);
  FakeHomie homie;
  executor.open();
  LowCommandFrame damping{};
  long heard = 0;
  for (int tick = 0; tick < 500; ++tick) {  // one second: first damped, then with arms, then damped
    executor.write(tick >= 100 && tick < 200 ? frame_with_arms(0.3f) : damping);
    executor.send({0.1, 0.0, 0.0, 0.74});
    heard += hear(listener, homie, kGuardDt * tick);
  }
  EXPECT_EQ(homie.traffic().pedals, 50);
  EXPECT_EQ(homie.traffic().arms, 40);  // none before there was one
  EXPECT_EQ(heard, 90);
  EXPECT_NEAR(homie.traffic().longest_gap, 0.02, 1e-9);
  LowCommandFrame sent;
  homie.write_command(5, sent);
  EXPECT_FLOAT_EQ(sent.motor[15].q, 0.3f);
}

TEST(HomieExecutor, SaysGoodbyeWithAVelocityOfNought) {
  LcmChannel listener(own_group());
  FakeHomie homie;
  {
    HomieExecutor executor(own_group(), 0.74, kGuardDt);
    executor.open();
    executor.send({0.25, 0.0, 0.5, 0.74});
    hear(listener, homie, 0.0);
    EXPECT_EQ(homie.velocity()[0], 0.25);
  }
  EXPECT_EQ(hear(listener, homie, 0.1), 5);
  EXPECT_EQ(homie.velocity(), (std::array<double, 4>{0.0, 0.0, 0.0, 0.74}));
}

void send_echo(LcmChannel& robot) {
  LcmBuffer buffer;
  robot.send(std::span<const std::byte>(buffer).first(FakeHomie::write_echo(RobotReading(), 1, buffer)));
}

void send_targets(LcmChannel& robot, double stamp) {
  LcmBuffer buffer;
  robot.send(std::span<const std::byte>(buffer).first(FakeHomie::write_targets(stamp, 1, buffer)));
}

TEST(HomieExecutor, HearsOfHomieByItsEchoAndByWhatItsPolicySends) {
  LcmChannel robot(own_group());
  HomieExecutor executor(own_group(), 0.74, kGuardDt);
  executor.poll(1.0);
  EXPECT_EQ(executor.heard_at(), kNever);
  EXPECT_SENTENCE(executor.complaint());
  send_echo(robot);
  executor.poll(1.9);
  EXPECT_EQ(executor.heard_at(), kNever) << "its policy has not been heard";
  executor.foreign_writers(1);
  EXPECT_SENTENCE(executor.complaint());
  send_targets(robot, 5.0);
  send_echo(robot);
  executor.poll(2.0);
  EXPECT_EQ(executor.heard_at(), 2.0);
  send_targets(robot, 5.0);
  send_echo(robot);
  executor.poll(2.1);
  EXPECT_EQ(executor.heard_at(), 2.0) << "the same message again is no sign of life";
  EXPECT_EQ(executor.complaint(), "");
  executor.poll(2.13);
  EXPECT_NE(executor.complaint(), "");
  send_targets(robot, 5.02);
  executor.poll(2.2);
  EXPECT_EQ(executor.heard_at(), 2.1) << "its controller";
  EXPECT_EQ(executor.foreign_writers(1), 0);
  EXPECT_EQ(executor.complaint(), "");
}

TEST(HomieExecutor, OneWriterIsHomiesAndMoreAreForeign) {
  HomieExecutor executor(own_group(), 0.74, kGuardDt);
  EXPECT_EQ(executor.foreign_writers(1), 0);
  EXPECT_EQ(executor.foreign_writers(2), 1);
  EXPECT_EQ(executor.foreign_writers(0), 0);
  LcmChannel robot(own_group());
  send_echo(robot);
  send_targets(robot, 1.0);
  executor.poll(1.0);
  EXPECT_SENTENCE(executor.complaint());
}

// T8: HOMIE cannot tell two senders apart; this side can.
TEST(HomieExecutor, AnotherWhoSteersHomieIsForeign) {
  HomieExecutor executor(own_group(), 0.74, kGuardDt);
  LcmChannel other(own_group());
  executor.open();
  executor.send({0.1, 0.0, 0.0, 0.74});
  executor.poll(1.0);
  EXPECT_EQ(executor.foreign_writers(1), 0);  // its own message came back
  LcmBuffer buffer;
  other.send(std::span<const std::byte>(buffer).first(encode(PedalCommand{}, 1, buffer)));
  executor.poll(1.25);
  EXPECT_EQ(executor.foreign_writers(1), 1);
  executor.poll(1.7421875);
  EXPECT_EQ(executor.foreign_writers(1), 1);
  executor.poll(1.75);  // half a second is over
  EXPECT_EQ(executor.foreign_writers(1), 0);
}

// The stand-in sees what HOMIE's processes would take without a word.
TEST(FakeHomie, NoticesAWrongFingerprintAndASwappedChannel) {
  FakeHomie homie;
  LcmBuffer buffer;
  const std::size_t size = encode(ArmAction{{{0.5}}}, 1, buffer);
  std::vector<std::byte> swapped(buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(size));
  const std::string_view hand = "hand_action";
  swapped.insert(swapped.begin() + 8, std::byte{'h'});
  std::memcpy(swapped.data() + 8, hand.data(), hand.size());
  homie.receive(swapped, 0.0);
  EXPECT_EQ(homie.traffic().hands, 1);
  EXPECT_FALSE(homie.has_arms());
  buffer[19] ^= std::byte{1};  // of the fingerprint
  homie.receive(std::span<const std::byte>(buffer).first(size), 0.0);
  EXPECT_EQ(homie.traffic().refused, 1);
  EXPECT_FALSE(homie.has_arms());
  homie.receive(std::span<const std::byte>(buffer).first(10), 0.0);
  homie.receive({}, 0.0);
  EXPECT_EQ(homie.traffic().refused, 1);  // without a channel: nobody's
}

TEST(LcmChannel, RefusesAnInterfaceAndAGroupThatAreNone) {
  LcmPlace place;
  place.interface = "nosuch0";
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { LcmChannel channel(place); }));
  place = {};
  place.group = "10.0.0.1";
  EXPECT_SENTENCE(test::thrown_message<std::runtime_error>([&] { LcmChannel channel(place); }));
}

// The whole way in one process: guard, HOMIE's stand-in on the multicast, twin.
class ThroughHomie final : public FrameTransport {
 public:
  explicit ThroughHomie(TwinModel& twin) : twin_(twin), robot_(own_group()), executor_(own_group(), 0.74, kGuardDt) {}
  // The robot's half of a tick.
  void step(double now) {
    LcmBuffer buffer;
    if (alive) {
      hear(robot_, homie, now);
      LowCommandFrame frame;
      homie.write_command(5, frame);
      twin_.obey(frame);
      const auto& v = homie.velocity();
      twin_.obey(VelocityCommand{v[0], v[1], v[2], v[3]});
      robot_.send(std::span<const std::byte>(buffer).first(FakeHomie::write_echo(RobotReading(), 1, buffer)));
      if (policy_alive && steps_++ % 10 == 0)
        robot_.send(std::span<const std::byte>(buffer).first(FakeHomie::write_targets(now, 1, buffer)));
    }
    twin_.step(kGuardDt);
    twin_.write_state(state_);
    if (spoil) spoil(state_);
    waits_ = true;
    executor_.poll(now);
  }
  bool take(LowStateFrame& frame) override {
    if (!waits_) return false;
    frame = state_;
    waits_ = false;
    return true;
  }
  int foreign_writers() override { return executor_.foreign_writers(1); }
  void open_writer() override { executor_.open(); }
  void close_writer() override { executor_.close(); }
  [[nodiscard]] bool has_writer() const override { return executor_.is_open(); }
  bool write(const LowCommandFrame& frame) override { return executor_.write(frame); }
  HomieExecutor& executor() { return executor_; }

  bool alive = true, policy_alive = true;
  FakeHomie homie;
  std::function<void(LowStateFrame&)> spoil;  // seals it

 private:
  long steps_ = 0;
  TwinModel& twin_;
  LcmChannel robot_;
  HomieExecutor executor_;
  LowStateFrame state_{};
  bool waits_ = false;
};

struct HomieRun {
  HomieRun() : twin(test::g1(), {}), wire(twin), guard(setup(), wire, wire.executor()) {
    message.command.q = test::g1()->neutral;
    message.command.root = {0.0, 0.0, 0.0, 0.74};
  }
  static GuardSetup setup() {
    RobotConfig config;
    config.twin = true;
    config.person = false;
    config.executor = ExecutorKind::kHomieLcm;
    const GuardSetup configured = guard_setup(config, false);
    GuardSetup setup = test::twin_guard();
    setup.executor = config.executor;
    setup.rules = configured.rules;
    setup.limiter.executed = configured.limiter.executed;
    return setup;
  }
  void tick() {
    now += kGuardDt;
    wire.step(now);
    guard.executor_heard(wire.executor().heard_at());
    ++message.sequence;
    message.command.stamp = now;
    guard.receive(message, now);
    guard.receive(twin.odometry(now));
    guard.tick(now);
  }
  void run_for(double seconds) {
    for (double left = seconds; left > 0.5 * kGuardDt; left -= kGuardDt) tick();
  }
  void hold(RemoteKey key) { twin.remote.keys |= static_cast<std::uint16_t>(1u << static_cast<int>(key)); }
  void start() {
    hold(RemoteKey::kR1);
    run_for(2.2);
    guard.arm();
    hold(RemoteKey::kStart);
    run_for(2.5);
    hold(RemoteKey::kA);
    run_for(0.1);
  }
  [[nodiscard]] SafetyState state() const { return guard.status().safety.state; }

  TwinModel twin;
  ThroughHomie wire;
  RobotGuard guard;
  PlannerMessage message;
  double now = 1000.0;
};

TEST(HomieExecutor, ATwinIsArmedStoodUpAndWalksThroughHomie) {
  HomieRun run;
  run.start();
  ASSERT_EQ(run.state(), SafetyState::kRun) << stop_cause_name(run.guard.status().safety.cause);
  run.message.command.root.forward = 0.2;
  const int elbow = test::g1()->roles.arms[0][3];
  run.message.command.q[elbow] += 0.4;
  run.run_for(4.0);
  EXPECT_NEAR(run.twin.root_speed(), 0.2, 1e-3);
  EXPECT_NEAR(run.twin.q()[elbow], test::g1()->neutral[elbow] + 0.4, 0.05);
  EXPECT_EQ(run.twin.refused_frames(), 0);
}

TEST(HomieExecutor, IsNotReadyWithoutHomieAndHoldsWhenItDies) {
  HomieRun silent;
  silent.wire.alive = false;
  silent.hold(RemoteKey::kR1);
  silent.run_for(3.0);
  EXPECT_EQ(silent.state(), SafetyState::kListen);
  HomieRun run;
  run.start();
  run.message.command.root.forward = 0.2;
  run.run_for(1.0);
  run.wire.alive = false;
  run.run_for(0.7);
  EXPECT_EQ(run.state(), SafetyState::kHold);
  EXPECT_EQ(run.guard.status().safety.cause, StopCause::kExecutorAge);
}

// Its controller lives on, echoes, and keeps the legs where the policy left them.
TEST(HomieExecutor, ADeadPolicyHoldsWithinTwelveHundredthsOfASecond) {
  HomieRun run;
  run.start();
  run.message.command.root.forward = 0.2;
  run.run_for(1.0);
  ASSERT_EQ(run.state(), SafetyState::kRun) << stop_cause_name(run.guard.status().safety.cause);
  run.wire.policy_alive = false;
  const double killed_at = run.now;
  while (run.state() == SafetyState::kRun && run.now - killed_at < 1.0) run.tick();
  EXPECT_EQ(run.state(), SafetyState::kHold);
  EXPECT_EQ(run.guard.status().safety.cause, StopCause::kExecutorAge);
  EXPECT_LE(run.now - killed_at, 0.12 + 1.5 * kGuardDt);
}

// The torque that HOMIE's own gains ask of the left shoulder's first joint, whatever frame the guard wrote [N m].
double asked_of_shoulder(HomieRun& run) {
  LowCommandFrame sent;
  run.wire.homie.write_command(5, sent);
  const MotorCommandFrame& motor = sent.motor[15];
  const RobotState& measured = run.guard.measured();
  return std::abs(motor.kp * (motor.q - measured.q[15]) - motor.kd * measured.v[15]);
}

TEST(HomieExecutor, ABlockedOrPushedArmGetsNoMoreThanTheEnvelopesTorque) {
  HomieRun run;
  run.start();
  const RobotJoint& shoulder = test::g1()->joints[15];
  const double most = HardwareLimits{}.torque_share * shoulder.effort;
  const auto at = static_cast<float>(run.guard.measured().q[15]);
  float pushed = 0.0f, speed = 0.0f;
  run.wire.spoil = [&](LowStateFrame& frame) {
    frame.motor[15].q = at + pushed;
    frame.motor[15].dq = speed;
    frame.motor[15].tau_est = 0.0f;
    seal(frame);
  };
  run.message.command.q[15] = shoulder.lower + 0.1;
  double largest = 0.0;
  for (int k = 0; k < 2000; ++k) {
    run.tick();
    largest = std::max(largest, asked_of_shoulder(run));
  }
  EXPECT_GT(largest, 0.9 * most) << "it presses";
  EXPECT_LE(largest, most + 1e-3);
  speed = 0.8f;                                        // somebody pushes it away, faster than a target may move
  constexpr double kBetweenTargets = 0.02 + kGuardDt;  // HOMIE hears of a target 50 times a second
  constexpr int kFirst = 20;                           // ticks in which the push begins
  const double late = kHomieArmStiffness[0] * speed * kBetweenTargets, begins = kHomieArmDamping[0] * speed;
  for (int k = 0; k < 250; ++k) {
    pushed += speed * static_cast<float>(kGuardDt);
    run.tick();
    EXPECT_LE(asked_of_shoulder(run), most + late + (k < kFirst ? begins : 0.0) + 1e-3) << k;
  }
  EXPECT_GT(counted(run.guard.status().clamps, ClampReason::kJointTorque), 0);
}

TEST(HomieExecutor, ADampedGuardLeavesHomieStandingStill) {
  HomieRun run;
  run.start();
  run.message.command.root.forward = 0.2;
  run.run_for(1.0);
  run.hold(RemoteKey::kSelect);
  run.run_for(0.1);
  EXPECT_EQ(run.state(), SafetyState::kDamp);
  EXPECT_EQ(run.wire.homie.velocity()[0], 0.0);
  const long before = run.wire.homie.traffic().arms;
  run.run_for(1.0);
  EXPECT_EQ(run.wire.homie.traffic().arms - before, 50);  // and it goes on being told so
}

}  // namespace
}  // namespace duet
