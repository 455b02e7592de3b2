#include "duet/hardware/executors/executor.h"

#include <gtest/gtest.h>

#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/twin/lock_step.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

ExecutedChannels channels_of(ExecutorKind kind) {
  return executed_channels(kind, *test::g1(), test::arms_of(*test::g1()).joints);
}

TEST(Executor, IsKnownByItsName) {
  for (std::size_t k = 0; k < kExecutorNames.size(); ++k) {
    const auto kind = static_cast<ExecutorKind>(k);
    EXPECT_EQ(executor_kind(std::string(executor_name(kind))), kind);
  }
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)executor_kind("homie"); }));
}

// Expects, of a reference's 36 channels: place and turn as a velocity, height where HOMIE takes it, 14 arm joints.
TEST(Executor, NamesTheChannelsThatItExecutes) {
  for (const ExecutorKind kind :
       {ExecutorKind::kTwin, ExecutorKind::kHomieLcm, ExecutorKind::kSport, ExecutorKind::kLowcmd}) {
    const ExecutedChannels channels = channels_of(kind);
    const bool homie = kind == ExecutorKind::kHomieLcm;
    ASSERT_EQ(channels.executed.size(), 36u);
    EXPECT_EQ(std::ranges::count(channels.executed, true), homie ? 19 : 18);
    EXPECT_EQ(channels.homie, homie);
    EXPECT_EQ(channels.executed[2], homie);
    for (int j = 0; j < 15; ++j) EXPECT_FALSE(channels.executed[7 + static_cast<std::size_t>(j)]) << j;
    for (int j = 15; j < 29; ++j) EXPECT_TRUE(channels.executed[7 + static_cast<std::size_t>(j)]) << j;
  }
}

// The guard and a walking controller in one process: what it walks with is what counts.
TEST(Executor, LowcmdExecutesWhatItsWalkerDoes) {
  const auto channels = [](const std::string& walker) {
    return executed_channels(ExecutorKind::kLowcmd, *test::g1(), test::arms_of(*test::g1()).joints, walker);
  };
  EXPECT_TRUE(channels("homie").homie && channels("homie").executed[2]);
  EXPECT_FALSE(channels("falcon").homie || channels("falcon").executed[2]);
  EXPECT_SENTENCE(executed_channels_text(channels("homie"), *test::g1()));
}

TEST(Executor, EveryMotorNeedsAWalkerAndWhoWalksByItselfHasNone) {
  EXPECT_TRUE(is_told_velocities("homie"));
  EXPECT_FALSE(is_told_velocities("wbc_sim") || is_told_velocities(""));
  EXPECT_EQ(walker_refusal(ExecutorKind::kLowcmd, "homie", true), "");
  EXPECT_EQ(walker_refusal(ExecutorKind::kTwin, "", false), "");
  EXPECT_EQ(walker_refusal(ExecutorKind::kTwin, "wbc_sim", false), "");
  EXPECT_EQ(walker_refusal(ExecutorKind::kSport, "", false), "");
  EXPECT_SENTENCE(walker_refusal(ExecutorKind::kLowcmd, "", false));
  EXPECT_SENTENCE(walker_refusal(ExecutorKind::kLowcmd, "wbc_sim", false));
  EXPECT_SENTENCE(walker_refusal(ExecutorKind::kSport, "homie", true));
  EXPECT_SENTENCE(walker_refusal(ExecutorKind::kHomieLcm, "homie", true));
}

TEST(Executor, SaysWhatItDoesNotExecuteAndWhatDampingDoes) {
  const std::string sport = executed_channels_text(channels_of(ExecutorKind::kSport), *test::g1());
  EXPECT_SENTENCE(sport);
  const std::string homie = executed_channels_text(channels_of(ExecutorKind::kHomieLcm), *test::g1());
  EXPECT_SENTENCE(homie);
  const nlohmann::json json = executed_channels_json(channels_of(ExecutorKind::kSport), *test::g1());
  EXPECT_FALSE(json["homie"]);
  EXPECT_EQ(json["joints"].size(), 14u);
  EXPECT_EQ(json["executed"].size(), 36u);
}

// One link with everything in memory: what the guard reads is the source's odometry, what it writes is the executor's.
class MemoryWire final : public RobotWire {
 public:
  bool take(LowStateFrame& frame) override {
    if (!has_state) return false;
    frame = state;
    has_state = false;
    return true;
  }
  bool take(OdometrySample& sample) override {
    sample.valid = true;
    return true;
  }
  bool take(BatteryReading& reading) override {
    reading.charge = charge;
    return true;
  }
  int foreign_writers() override { return writers; }
  void open_writer() override { open = true; }
  void close_writer() override { open = false; }
  [[nodiscard]] bool has_writer() const override { return open; }
  bool write(const LowCommandFrame&) override { return ++written > 0; }

  LowStateFrame state{};
  bool has_state = false, open = false;
  int writers = 0;
  long written = 0;
  double charge = 50.0;
};

class CountedVelocity final : public VelocitySink {
 public:
  void send(const VelocityCommand&) override { ++sent; }
  long sent = 0;
};

class SeenOdometry final : public OdometryReader {
 public:
  void see(const LowStateFrame&) override { ++seen; }
  bool take(OdometrySample& sample) override {
    sample.X_WB.p.x() = 7.0;
    sample.valid = true;
    return true;
  }
  long seen = 0;
};

TEST(RobotConnection, PassesEachThingToTheOneWhoseItIs) {
  MemoryWire wire;
  CountedVelocity velocity;
  MotorExecutor executor(wire, velocity, 1);
  SeenOdometry odometry;
  RobotConnection link(wire, executor, &odometry);
  LowStateFrame frame;
  EXPECT_FALSE(link.take(frame));
  wire.has_state = true;
  EXPECT_TRUE(link.take(frame));
  EXPECT_EQ(odometry.seen, 1);
  OdometrySample sample;
  EXPECT_TRUE(link.take(sample));
  EXPECT_EQ(sample.X_WB.p.x(), 7.0);
  wire.writers = 2;
  EXPECT_EQ(link.foreign_writers(), 1);  // one was expected
  link.open_writer();
  EXPECT_TRUE(wire.open && link.has_writer());
  EXPECT_TRUE(link.write({}));
  link.close_writer();
  EXPECT_FALSE(wire.open);
  RobotConnection blind(wire, executor, nullptr);
  EXPECT_FALSE(blind.take(sample));
}

// An executor that has always been heard of just now.
class PromptExecutor final : public Executor {
 public:
  void poll(double now) override { heard_ = now; }
  [[nodiscard]] double heard_at() const override { return heard_; }
  [[nodiscard]] bool answers() const override { return true; }
  [[nodiscard]] std::string complaint() const override { return ""; }
  int foreign_writers(int command_writers) override { return command_writers; }
  void open() override {}
  void close() override {}
  [[nodiscard]] bool is_open() const override { return false; }
  bool write(const LowCommandFrame&) override { return true; }
  void send(const VelocityCommand&) override {}

 private:
  double heard_ = kNever;
};

// Three ticks of a loop; what the guard then knows has to be at most a tick old by the clock that it ticks by.
void expect_readings_by_the_guards_clock(bool lock_step) {
  MemoryWire wire;
  PromptExecutor executor;
  SeenOdometry odometry;
  RobotConnection link(wire, executor, &odometry);
  GuardSetup setup = test::twin_guard();
  setup.has_battery = true;
  LockStepWire stepped(link);
  RobotGuard guard(setup, lock_step ? static_cast<RobotWire&>(stepped) : link, executor);
  wire.charge = 12.0;
  int ticks = 0;
  const auto go_on = [&](double) { return ++ticks < 3; };
  if (lock_step)
    run_guard_in_lock_step(guard, stepped, nullptr, setup.limiter.dt, {go_on});
  else
    run_guard(guard, link, nullptr, setup.limiter.dt, go_on);
  const SafetyInput& input = guard.status().input;
  EXPECT_EQ(input.health.charge, 12.0);
  for (const double at : {input.odometry_at, input.executor_at}) {
    EXPECT_LE(at, input.now);
    EXPECT_GT(at, input.now - 1.0);
  }
}

TEST(RobotConnection, IsReadInRealTimeByTheGuardsClock) { expect_readings_by_the_guards_clock(false); }
TEST(RobotConnection, IsReadInLockStepByTheGuardsClock) { expect_readings_by_the_guards_clock(true); }

ArmingFacts everything_there() {
  ArmingFacts facts;
  facts.permission = {.allow_motion = true, .robot = "E21-1", .interface = "eth1", .domain = 0, .mode_machine = 5};
  facts.executor = ExecutorKind::kHomieLcm;
  facts.odometry = OdometrySource::kLegs;
  facts.asked_to_arm = true;
  facts.contact_limits.name = "iso_ts_15066";
  facts.contact_limits.verified_by = "somebody";
  facts.shown_nonce = facts.typed_nonce = "kestrel";
  facts.shown_at = 10.0;
  facts.now = 15.0;
  facts.remote_key_held = true;
  facts.reported_mode_machine = 5;
  facts.free_log_bytes = 2e9;
  facts.log_is_open = true;
  return facts;
}

std::string refusal(const std::function<void(ArmingFacts&)>& spoil) {
  ArmingFacts facts = everything_there();
  spoil(facts);
  return arming_refusal(facts);
}

TEST(Arming, IsAllowedWhereEverythingIsThere) { EXPECT_EQ(arming_refusal(everything_there()), ""); }

TEST(Arming, OfATwinNeedsNoSignatureButItsOwnDomains) {
  ArmingFacts facts = everything_there();
  facts.twin = true;
  facts.executor = ExecutorKind::kTwin;
  facts.odometry = OdometrySource::kTwin;
  facts.permission.domain = 123;
  facts.permission.interface = "lo";
  facts.contact_limits.verified_by = "";
  EXPECT_EQ(arming_refusal(facts), "");
}

TEST(Arming, IsRefusedInADryRun) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.dry_run = true; }));
}

TEST(Arming, IsRefusedUnasked) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.asked_to_arm = false; }));
}

TEST(Arming, NeedsAConfigurationThatAllowsMotionAndNamesEverything) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.allow_motion = false; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.robot = ""; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.domain = -1; }));
  for (const char* interface : {"", "auto"})
    EXPECT_SENTENCE(refusal([=](ArmingFacts& f) { f.permission.interface = interface; }));
}

TEST(Arming, ATwinIsNotARobot) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.twin = true; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.permission.domain = 100; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) {
    f.permission.domain = 1;
    f.permission.interface = "lo";
  }));
}

TEST(Arming, NeedsTheRobotThatIsConfigured) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.reported_mode_machine = 6; }));
}

TEST(Arming, OfARobotNeedsContactLimitsThatSomebodySigned) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.contact_limits.verified_by = ""; }));
}

TEST(Arming, OfARobotNeedsAnExecutorAndOdometryOfARobot) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.executor = ExecutorKind::kTwin; }));
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.executor = ExecutorKind::kLowcmd; }), "") << "a robot's own motors";
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) {
    f.executor = ExecutorKind::kLowcmd;
    f.odometry = OdometrySource::kVendor;
  }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kTwin; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kNone; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.odometry = OdometrySource::kVendor; }));
  EXPECT_EQ(refusal([](ArmingFacts& f) {
              f.executor = ExecutorKind::kSport;
              f.odometry = OdometrySource::kVendor;
            }),
            "");
}

TEST(Arming, NeedsAnExecutorThatIsWell) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.executor_complaint = "it is silent"; }));
}

TEST(Arming, NeedsMotorsThatNoModeOfTheMakersOwns) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.running_mode = "ai"; }));
  EXPECT_EQ(refusal([](ArmingFacts& f) {
              f.running_mode = "ai";
              f.executor = ExecutorKind::kSport;
            }),
            "");
}

TEST(Arming, NeedsALogThatCanBeWritten) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.log_is_open = false; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.free_log_bytes = 0.9e9; }));
}

TEST(Arming, NeedsTheWordOnTheScreenInTime) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.typed_nonce = "heron"; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.typed_nonce = f.shown_nonce = ""; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.now = f.shown_at + 30.0; }));
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.now = f.shown_at - 1.0; }));
  EXPECT_EQ(refusal([](ArmingFacts& f) { f.now = f.shown_at + 29.9; }), "");
}

TEST(Arming, NeedsTheKeyOnTheRemoteControl) {
  EXPECT_SENTENCE(refusal([](ArmingFacts& f) { f.remote_key_held = false; }));
}

}  // namespace
}  // namespace duet
