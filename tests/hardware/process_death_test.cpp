// T6: planner, guard and twin as processes that are killed, stopped and told to end, through the program as a user runs
// it; and the executors of a robot beside stand-ins for its programs. Everything in real time on this machine. Guard
// and twin ask for real-time priority; where the system refuses, or other machines take the processors away, a guard is
// late and stops or never arms, as it has to, and the trial is made again. Where every trial was so, the test is
// skipped.
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <memory>

#include "duet/core/file.h"
#include "duet/hardware/wire/robot_wire.h"
#include "tests/hardware/armed_program.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::OwnProcess;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kTrials = 6;

int death_domain() {
  return kFirstTwinDomain + (static_cast<int>(getpid()) + 25) % (kLastTwinDomain - kFirstTwinDomain + 1);
}
std::string death_port() { return std::to_string(41000 + static_cast<int>(getpid()) % 9000); }
std::string domain_text() { return std::to_string(death_domain()); }

// Twin, guard and whatever else, from nothing to running.
struct ArmedTrial {
  // `says`: of the guard, once its word was typed.
  ArmedTrial(const std::string& more, const std::vector<std::string>& services,
             const std::string& says = "armed (none)") {
    write_file(folder / "twin.yaml",
               "schema: duet.robot/1\nrobot: twin\ntwin: true\ninterface: lo\nallow_motion: true\nperson: false\n"
               "mode_machine: 5\ndomain: " +
                   domain_text() + "\n" + more);
    twin = std::make_unique<OwnProcess>(
        std::vector<std::string>{DUET_TWIN, services.empty() ? "--operated" : "--presses", "--seconds", "60",
                                 "--domain", domain_text(), "--velocity-port", death_port()});
    if (!services.empty()) {
      std::vector<std::string> all = {DUET_SERVICES,     "--seconds",  "60",         "--domain",  domain_text(),
                                      "--velocity-port", death_port(), "--lcm-port", death_port()};
      all.insert(all.end(), services.begin(), services.end());
      service = std::make_unique<OwnProcess>(all);
    }
    guard = std::make_unique<OwnProcess>(
        std::vector<std::string>{DUET_PROGRAM, "hw", "arm", folder / "twin.yaml", "--log", folder / "run.mcap",
                                 "--socket", folder / "guard", "--velocity-port", death_port()},
        true);
    planner = nullptr;
    armed = test::arm_by_its_word(*guard) && guard->says(says, 10.0);
    if (!armed || says != "armed (none)") return;
    plan();
    runs = guard->says("run (none)", 15.0);
  }
  void plan() {
    planner = std::make_unique<OwnProcess>(std::vector<std::string>{DUET_PROGRAM, "hw", "run", "--command", "0.1,0,0",
                                                                    "--seconds", "60", "--socket", folder / "guard"},
                                           true);
    late = !planner->says("asks the guard", 1.0) || late;
  }

  test::ScratchFolder folder;
  std::unique_ptr<OwnProcess> twin, service, guard, planner;
  bool armed = false, runs = false;
  bool late = false;  // a planner took longer to begin than a hold lasts
};

// Whether the guard says that this machine held it, or the twin, up. `but`: the cause that the trial itself brings
// about.
bool held_up(const std::string& said, const std::string& but) {
  constexpr const char* kLate[] = {"loop_late", "state_age", "remote_age", "dead_man", "odometry_age", "executor_age"};
  return std::ranges::any_of(kLate, [&](const std::string& cause) {
    return cause != but && (said.find("(" + cause + ")") != std::string::npos ||
                            said.find("lately missing: " + cause) != std::string::npos);
  });
}

// Until a trial runs and what follows happens. `cause`: that the guard then gives. A trial that the machine did not
// hold up has to succeed.
void try_until(const std::string& cause, const std::function<bool(ArmedTrial&)>& happens, const std::string& more = "",
               const std::vector<std::string>& services = {}) {
  std::string said;
  for (int k = 0; k < kTrials; ++k) {
    ArmedTrial trial(more, services);
    if (trial.runs && happens(trial)) return;
    said = trial.guard->said();
    ASSERT_TRUE(trial.late || held_up(said, trial.runs ? cause : "")) << "the guard said:\n" << said;
  }
  GTEST_SKIP() << "not run: this machine held the guard up in each of " << kTrials << " trials; it said:\n" << said;
}

// Killed and told to end, with another planner each time, stopped and let go on, stopped for good.
TEST(ProcessDeath, APlannerThatDiesHoldsWhichAnotherOneEndsAndOneThatStaysAwayIsHeldFor) {
  try_until("planner_age", [](ArmedTrial& trial) {
    for (const int signal : {SIGKILL, SIGTERM}) {
      trial.planner->send(signal);
      if (!trial.guard->says("hold (planner_age)", 5.0)) return false;
      trial.plan();
      if (!trial.guard->says("run (none)", 2.0)) return false;
    }
    trial.planner->send(SIGSTOP);
    if (!trial.guard->says("hold (planner_age)", 5.0)) return false;
    trial.planner->send(SIGCONT);
    if (!trial.guard->says("run (none)", 2.0)) return false;
    trial.planner->send(SIGSTOP);
    return trial.guard->says("hold (planner_age)", 5.0) && !trial.guard->says("damp", 4.0);
  });
}

TEST(ProcessDeath, AGuardThatIsToldToEndDampsUntilItIsToldTwice) {
  try_until("stop_key", [](ArmedTrial& trial) {
    trial.guard->send(SIGTERM);
    if (!trial.guard->says("damp (stop_key)", 5.0)) return false;
    if (trial.guard->exit_code(7.0) != -1) return false;  // damped for five seconds, and still there
    trial.guard->send(SIGTERM);
    return trial.guard->exit_code(5.0) == 0;
  });
}

// Stopped for a second, it holds at once when it goes on: its clock says how long it was away.
TEST(ProcessDeath, AGuardThatWasStoppedForASecondHolds) {
  try_until("loop_late", [](ArmedTrial& trial) {
    trial.guard->send(SIGSTOP);
    usleep(1000000);
    trial.guard->send(SIGCONT);
    return trial.guard->says("hold (loop_late)", 5.0);
  });
}

// The robot's reaction when commands end is not known; this says only that nothing else of ours commands it.
TEST(ProcessDeath, AGuardThatIsKilledLeavesALogThatCanBeReplayed) {
  try_until("none", [](ArmedTrial& trial) {
    usleep(500000);
    trial.guard->send(SIGKILL);
    trial.guard->exit_code(5.0);
    OwnProcess replay({DUET_PROGRAM, "replay-log", trial.folder / "run.mcap"});
    return replay.exit_code(60.0) == 0;
  });
}

TEST(ProcessDeath, ATwinThatIsKilledOrStoppedDamps) {
  for (const int signal : {SIGKILL, SIGSTOP})
    try_until("state_age", [signal](ArmedTrial& trial) {
      trial.twin->send(signal);
      if (!trial.guard->says("hold (state_age)", 5.0) || !trial.guard->says("damp (state_age)", 5.0)) return false;
      return trial.guard->says("fault (state_age)", 8.0) && trial.guard->exit_code(1.0) == -1;  // and goes on damping
    });
}

// The whole way of the executor: arming, standing up, running, HOMIE killed.
TEST(ProcessDeath, ATwinRunsThroughHomiesProcessesAndHoldsWhenTheyDie) {
  try_until("executor_age",
            [](ArmedTrial& trial) {
              EXPECT_THAT(trial.guard->said(), HasSubstr("nothing here can damp them"));
              trial.service->send(SIGKILL);
              return trial.guard->says("hold (executor_age)", 5.0);
            },
            "executor: homie-lcm\nodometry: twin\nlcm: {interface: lo, port: " + death_port() + "}\n", {"--homie"});
}

TEST(ProcessDeath, ATwinRunsThroughTheMakersServiceAndHoldsWhenItDies) {
  try_until("executor_age",
            [](ArmedTrial& trial) {
              EXPECT_THAT(trial.guard->said(), HasSubstr("this is not HOMIE"));
              trial.service->send(SIGKILL);
              return trial.guard->says("hold (executor_age)", 5.0);
            },
            "executor: sport\nodometry: vendor\n", {"--sport"});
}

// Its machine has not been told to walk: it is never ready, and says why.
TEST(ProcessDeath, AServiceThatDoesNotWalkIsNotArmed) {
  ArmedTrial trial("executor: sport\nodometry: vendor\n", {"--sport", "--fsm", "1"}, "lately missing: executor_age");
  EXPECT_TRUE(trial.armed) << trial.guard->said();
  EXPECT_THAT(trial.guard->said(), Not(HasSubstr("armed (none)")));
}

}  // namespace
}  // namespace duet
