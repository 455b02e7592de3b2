// T6: planner, guard and twin as processes that are killed, stopped and told to end, through the program as a user runs
// it; and the executors of a robot beside stand-ins for its programs. Everything in real time on this machine: a guard
// that the machine held up stops as it has to, and the trial is made again.
#include <gmock/gmock.h>

#include <functional>
#include <memory>

#include "duet/core/file.h"
#include "duet/hardware/dds_place.h"
#include "tests/hardware/armed_program.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::OwnProcess;
using ::testing::HasSubstr;

constexpr int kTrials = 4;

int death_domain() {
  return kFirstTwinDomain + (static_cast<int>(getpid()) + 25) % (kLastTwinDomain - kFirstTwinDomain + 1);
}
std::string death_port() { return std::to_string(41000 + static_cast<int>(getpid()) % 9000); }
std::string domain_text() { return std::to_string(death_domain()); }

// Twin, guard and whatever else, from nothing to running.
struct ArmedTrial {
  ArmedTrial(const std::string& more, const std::vector<std::string>& services) {
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
    armed = test::arm_by_its_word(*guard) && guard->says("armed (none)", 10.0);
    if (armed) plan();
    runs = armed && guard->says("run (none)", 15.0);
  }
  void plan() {
    planner = std::make_unique<OwnProcess>(std::vector<std::string>{DUET_PROGRAM, "hw", "run", "--command", "0.1,0,0",
                                                                    "--seconds", "60", "--socket", folder / "guard"});
  }

  test::ScratchFolder folder;
  std::unique_ptr<OwnProcess> twin, service, guard, planner;
  bool armed = false, runs = false;
};

// Until a trial runs and what follows happens; what the last guard said otherwise.
void try_until(const std::function<bool(ArmedTrial&)>& happens, const std::string& more = "",
               const std::vector<std::string>& services = {}) {
  std::string said;
  for (int k = 0; k < kTrials; ++k) {
    ArmedTrial trial(more, services);
    if (trial.runs && happens(trial)) return;
    said = trial.guard->said();
  }
  FAIL() << "in none of " << kTrials << " trials; the last guard said:\n" << said;
}

TEST(ProcessDeath, APlannerThatIsKilledStoppedOrEndedHoldsAndThenDamps) {
  for (const int signal : {SIGKILL, SIGSTOP, SIGTERM})
    try_until([signal](ArmedTrial& trial) {
      trial.planner->send(signal);
      return trial.guard->says("hold (planner_age)", 5.0) && trial.guard->says("damp (held_too_long)", 5.0);
    });
}

TEST(ProcessDeath, APlannerThatComesBackInTimeRunsOn) {
  try_until([](ArmedTrial& trial) {
    trial.planner->send(SIGSTOP);
    if (!trial.guard->says("hold (planner_age)", 5.0)) return false;
    trial.planner->send(SIGCONT);
    return trial.guard->says("run (none)", 2.0);
  });
}

TEST(ProcessDeath, AGuardThatIsToldToEndDampsFirst) {
  try_until([](ArmedTrial& trial) {
    trial.guard->send(SIGTERM);
    return trial.guard->says("damp (stop_key)", 5.0) && trial.guard->exit_code(15.0) == 0;
  });
}

// Stopped for a second, it damps at once when it goes on: its clock says how long it was away.
TEST(ProcessDeath, AGuardThatWasStoppedForASecondDamps) {
  try_until([](ArmedTrial& trial) {
    trial.guard->send(SIGSTOP);
    usleep(1000000);
    trial.guard->send(SIGCONT);
    return trial.guard->says("damp (loop_late)", 5.0);
  });
}

// What a robot does when commands end is not known; this says only that nothing else of ours commands it.
TEST(ProcessDeath, AGuardThatIsKilledLeavesALogThatCanBeReplayed) {
  try_until([](ArmedTrial& trial) {
    usleep(500000);
    trial.guard->send(SIGKILL);
    trial.guard->exit_code(5.0);
    OwnProcess replay({DUET_PROGRAM, "replay-log", trial.folder / "run.mcap"});
    return replay.exit_code(60.0) == 0;
  });
}

TEST(ProcessDeath, ATwinThatIsKilledOrStoppedDamps) {
  for (const int signal : {SIGKILL, SIGSTOP})
    try_until([signal](ArmedTrial& trial) {
      trial.twin->send(signal);
      return trial.guard->says("hold (state_age)", 5.0) && trial.guard->says("damp (state_age)", 5.0);
    });
}

// The whole way of the executor: arming, standing up, running, HOMIE killed.
TEST(ProcessDeath, ATwinRunsThroughHomiesProcessesAndHoldsWhenTheyDie) {
  try_until(
      [](ArmedTrial& trial) {
        EXPECT_THAT(trial.guard->said(), HasSubstr("nothing here can damp them"));
        trial.service->send(SIGKILL);
        return trial.guard->says("hold (executor_age)", 5.0) && trial.guard->says("damp (executor_age)", 5.0);
      },
      "executor: homie-lcm\nodometry: twin\nlcm: {interface: lo, port: " + death_port() + "}\n", {"--homie"});
}

TEST(ProcessDeath, ATwinRunsThroughTheMakersServiceAndHoldsWhenItDies) {
  try_until(
      [](ArmedTrial& trial) {
        EXPECT_THAT(trial.guard->said(), HasSubstr("this is not HOMIE"));
        trial.service->send(SIGKILL);
        return trial.guard->says("hold (executor_age)", 5.0);
      },
      "executor: sport\nodometry: vendor\n", {"--sport"});
}

// Its machine has not been told to walk: it is never ready.
TEST(ProcessDeath, AServiceThatDoesNotWalkIsNotArmed) {
  const ArmedTrial trial("executor: sport\nodometry: vendor\n", {"--sport", "--fsm", "1"});
  EXPECT_FALSE(trial.armed);
  EXPECT_THAT(trial.guard->said(), HasSubstr("listen"));
}

}  // namespace
}  // namespace duet
