// The guard and the twin over DDS, as two processes. Nothing here asserts how long a tick or a message takes.
#include "duet/hardware/dds/dds_wire.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <thread>

#include "duet/core/require.h"
#include "duet/hardware/guard/guard_loop.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

extern char** environ;

namespace duet {
namespace {

using ::testing::HasSubstr;

// A domain that tests which run at the same time hardly share.
int some_domain() { return kFirstTwinDomain + static_cast<int>(getpid()) % (kLastTwinDomain - kFirstTwinDomain + 1); }

// duet-g1-twin as a process of its own.
class TwinProcess {
 public:
  explicit TwinProcess(const std::vector<std::string>& arguments) {
    std::vector<std::string> all = {DUET_TWIN, "--domain", std::to_string(some_domain()), "--seconds", "60"};
    all.insert(all.end(), arguments.begin(), arguments.end());
    std::vector<char*> raw;
    for (std::string& argument : all) raw.push_back(argument.data());
    raw.push_back(nullptr);
    posix_spawn_file_actions_t quiet;
    posix_spawn_file_actions_init(&quiet);
    posix_spawn_file_actions_addopen(&quiet, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&quiet, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    EXPECT_EQ(posix_spawn(&pid_, DUET_TWIN, &quiet, nullptr, raw.data(), environ), 0);
    posix_spawn_file_actions_destroy(&quiet);
  }
  ~TwinProcess() {
    send(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  void send(int signal) const { kill(pid_, signal); }

 private:
  pid_t pid_ = -1;
};

GuardSetup guard_of_a_twin(bool dry_run) {
  GuardSetup setup;
  setup.limiter = test::nobody_near();
  setup.limiter.dt = 0.002;
  setup.stance = test::g1()->default_command(test::g1()->neutral);
  setup.dry_run = dry_run;
  // The timeouts themselves are tested on a simulated clock; a machine with other work to do is late here.
  setup.rules.loop = {1.0, 5.0, 10.0};
  setup.rules.state = {0.1, 0.5, 1.0};
  setup.rules.remote = {0.1, 0.5, 3.0};
  setup.rules.odometry = {0.1, 0.5};
  return setup;
}

// A guard over DDS that plans to stand where it is.
struct WiredGuard {
  explicit WiredGuard(bool dry_run)
      : wire(open_robot_wire({some_domain(), "lo"})), guard(guard_of_a_twin(dry_run), *wire, nobody) {
    message.command.q = test::g1()->neutral;
    message.command.root.height = 0.74;
  }
  // Until `until` is true; false where that did not happen in 20 s.
  bool run(const std::function<bool()>& until) {
    const double begin = monotonic_seconds();
    bool done = false;
    run_guard(guard, *wire, nullptr, 0.002, [&](double now) {
      ++message.sequence;
      message.command.stamp = now;
      guard.receive(message, now);
      done = until();
      return !done && now - begin < 20.0;
    });
    return done;
  }
  [[nodiscard]] SafetyState state() const { return guard.status().safety.state; }
  bool reach(SafetyState wanted) {
    return run([&] {
      if (state() == SafetyState::kReady) guard.arm();
      return state() == wanted;
    });
  }
  bool run_for(double seconds) {
    const double end = monotonic_seconds() + seconds;
    return run([&] { return monotonic_seconds() >= end; });
  }

  std::unique_ptr<RobotWire> wire;
  NoVelocity nobody;
  RobotGuard guard;
  PlannerMessage message;
};

// The names and digests of our types that DDS tells others. Those of the maker's headers gave the same digests.
TEST(DdsWire, TypesAreTheMakers) {
  struct Type {
    const char* name;
    const char* digest;
  };
  for (const Type& type :
       {Type{"unitree_hg::msg::dds_::MotorCmd_", "146ec2d301e8f8b3eba9e19c09e6e4afe6ba01418794d976354ee39946aa6288"},
        Type{"unitree_hg::msg::dds_::LowCmd_", "b9c36d43ed6e8c4e1f73be9b0a831b99025cf6665147a0074e75a75f747780f8"},
        Type{"unitree_hg::msg::dds_::IMUState_", "d7e5dd9f243459ca24a3c2db4296ad96d48ae4a3e4633542bd230677dcddb509"},
        Type{"unitree_hg::msg::dds_::MotorState_", "9a1ab2b392794060dfc7c8cd68dd426ffd3f5b79799ff39ce8126c8ab81f012a"},
        Type{"unitree_hg::msg::dds_::LowState_", "645dccd69df93c4679d28ca37961e75e6f1964954df8cdd27c114257b0a6056a"},
        Type{"unitree_go::msg::dds_::IMUState_", "ab066ab5903c180aa8cff25ce2c59327c1f859720384117f90277f7b69e8b589"},
        Type{"unitree_go::msg::dds_::SportModeState_",
             "6370bda6df276a069f3e87fa523d449811d163115e77d0974871baea03ab3f2c"}})
    EXPECT_EQ(dds_type_digest(type.name), type.digest) << type.name;
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([] { (void)dds_type_digest("LowCmd"); }),
              HasSubstr("expected a type of the G1, found 'LowCmd'"));
}

TEST(DdsWire, StatesArriveWholeAtFiveHundredHertz) {
  const TwinProcess twin({});
  WiredGuard guard(true);
  ASSERT_TRUE(guard.run([&] { return guard.guard.status().states > 0; }));
  ASSERT_TRUE(guard.run_for(2.0));
  const GuardStatus& status = guard.guard.status();
  EXPECT_GT(status.states, 500);
  EXPECT_EQ(status.checksum_faults, 0);
  EXPECT_EQ(status.number_faults, 0);
  EXPECT_GT(status.input.odometry_at, 0.0);
}

TEST(DdsWire, ADryRunHasNoWriterForOthersToSee) {
  const TwinProcess twin({"--operated"});
  WiredGuard dry(true);
  ASSERT_TRUE(dry.reach(SafetyState::kReady));
  const std::unique_ptr<RobotWire> observer = open_robot_wire({some_domain(), "lo"});
  ASSERT_TRUE(dry.run_for(1.0));
  EXPECT_FALSE(dry.wire->has_writer());
  EXPECT_EQ(observer->foreign_writers(), 0);
}

TEST(DdsWire, AnOperatorStandsTheTwinUpAndRunsIt) {
  const TwinProcess twin({"--operated"});
  WiredGuard guard(false);
  EXPECT_TRUE(guard.reach(SafetyState::kRun))
      << safety_state_name(guard.state()) << " " << stop_cause_name(guard.guard.status().safety.cause);
}

TEST(DdsWire, AForeignWriterRefusesArming) {
  const TwinProcess twin({"--operated"});
  const std::unique_ptr<RobotWire> other = open_robot_wire({some_domain(), "lo"});
  other->open_writer();
  WiredGuard guard(false);
  ASSERT_TRUE(guard.run([&] { return guard.guard.status().input.foreign_writer; }));
  ASSERT_TRUE(guard.run_for(3.0));
  EXPECT_EQ(guard.state(), SafetyState::kListen);
  other->close_writer();
  EXPECT_TRUE(guard.reach(SafetyState::kReady));
}

void expect_stop_after(int signal) {
  const TwinProcess twin({"--operated"});
  WiredGuard guard(false);
  ASSERT_TRUE(guard.reach(SafetyState::kRun)) << safety_state_name(guard.state());
  twin.send(signal);
  ASSERT_TRUE(guard.run([&] { return guard.state() >= SafetyState::kHold; })) << signal;
  EXPECT_EQ(guard.guard.status().safety.cause, StopCause::kStateAge) << signal;
  ASSERT_TRUE(guard.run([&] { return guard.state() >= SafetyState::kDamp; })) << signal;
}

TEST(DdsWire, ATwinThatIsKilledIsNoticedByTheAgeOfItsStates) { expect_stop_after(SIGKILL); }
TEST(DdsWire, ATwinThatIsStoppedIsNoticedByTheAgeOfItsStates) { expect_stop_after(SIGSTOP); }

TEST(DdsWire, RefusesAnInterfaceThatIsNotThere) {
  EXPECT_THAT(test::thrown_message<std::runtime_error>([] {
                (void)open_robot_wire({some_domain(), "nosuch0"});
              }),
              HasSubstr("DDS: cannot"));
}

TEST(DdsWire, TheEnvironmentDoesNotSayWhere) {
  setenv("CYCLONEDDS_URI", "<CycloneDDS><broken", 1);
  EXPECT_NO_THROW((void)open_robot_wire({some_domain(), "lo"}));
  unsetenv("CYCLONEDDS_URI");
}

}  // namespace
}  // namespace duet
