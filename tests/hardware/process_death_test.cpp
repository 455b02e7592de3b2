// T6: planner, guard and twin as processes that are killed, stopped and told to end, through the program as a user runs
// it; and the executors of a robot beside stand-ins for its programs. Everything in real time on this machine. Guard
// and twin ask for real-time priority; where the system refuses, or other machines take the processors away, a guard is
// late and stops or never arms, as it has to, and the trial is made again. Where every trial was so, the test is
// skipped.
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <sstream>

#include "duet/core/file.h"
#include "duet/hardware/wire/robot_wire.h"
#include "tests/hardware/armed_program.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::held_up;
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
    twin = std::make_unique<OwnProcess>(std::vector<std::string>{DUET_TWIN, "--operated", "--seconds", "60", "--domain",
                                                                 domain_text(), "--velocity-port", death_port()});
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

// A comment's line that begins so, without its "#".
std::vector<std::string> printed_lines(const std::string& file, const std::string& program) {
  std::vector<std::string> lines;
  std::istringstream text(read_text(file));
  for (std::string line; std::getline(text, line);)
    if (line.starts_with("#   " + program)) lines.push_back(line.substr(4));
  return lines;
}

// The programs of a printed line, as they are built here, in a domain and at a port that others hardly have.
std::vector<std::string> words_of(const std::string& line, const test::ScratchFolder& folder) {
  const std::map<std::string, std::string> here = {
      {"duet", DUET_PROGRAM}, {"duet-g1-twin", DUET_TWIN}, {"duet-g1-services", DUET_SERVICES},
      {"150", domain_text()}, {"15001", death_port()},     {"run.mcap", folder / "run.mcap"}};
  std::vector<std::string> words;
  std::istringstream text(line);
  for (std::string word; text >> word;) {
    const auto found = here.find(word);
    words.push_back(found != here.end()                     ? found->second
                    : word.starts_with("examples/hardware") ? folder / "example.yaml"
                                                            : word);
  }
  return words;
}

// An example starts as it prints it: its own lines, one after the other, and the word typed. Its file is the one of the
// example but for domain and ports, and the guard's socket is told, as two of these may run on one machine.
void expect_to_start_as_printed(const std::string& example) {
  const std::string file = std::string(DUET_EXAMPLES) + "/" + example;
  std::string said;
  for (int k = 0; k < kTrials; ++k) {
    const test::ScratchFolder folder;
    std::string text = read_text(file);
    text.replace(text.find("domain: 150"), 11, "domain: " + domain_text());
    if (const std::size_t lcm = text.find("lcm: {interface: lo}"); lcm != std::string::npos)
      text.replace(lcm, 20, "lcm: {interface: lo, port: " + death_port() + "}");
    write_file(folder / "example.yaml", text);
    std::vector<std::unique_ptr<OwnProcess>> beside;
    for (const std::string& line : printed_lines(file, "duet-g1-")) {
      std::vector<std::string> words = words_of(line, folder);
      words.insert(words.end(), {"--seconds", "60"});
      if (line.starts_with("duet-g1-services")) words.insert(words.end(), {"--lcm-port", death_port()});
      beside.push_back(std::make_unique<OwnProcess>(words));
    }
    ASSERT_EQ(beside.size(), 2u) << file;
    const std::vector<std::string> armed = printed_lines(file, "duet hw arm");
    const std::vector<std::string> run = printed_lines(file, "duet hw run");
    ASSERT_EQ(armed.size() + run.size(), 2u) << file;
    std::vector<std::string> words = words_of(armed[0], folder), plan = words_of(run[0], folder);
    for (std::vector<std::string>* all : {&words, &plan}) all->insert(all->end(), {"--socket", folder / "guard"});
    OwnProcess guard(words, true);
    if (!test::arm_by_its_word(guard) || !guard.says("armed (none)", 10.0)) {
      said = guard.said();
      continue;
    }
    OwnProcess planner(plan, true);
    if (guard.says("run (none)", 15.0)) return;
    said = guard.said();
    ASSERT_TRUE(held_up(said, "")) << "the guard said:\n" << said;
  }
  GTEST_SKIP() << "not run: this machine held the guard up in each of " << kTrials << " trials; it said:\n" << said;
}

TEST(ProcessDeath, TheExampleOfHomieStartsAsPrinted) { expect_to_start_as_printed("homie.yaml"); }
TEST(ProcessDeath, TheExampleOfTheMakersServiceStartsAsPrinted) { expect_to_start_as_printed("sport.yaml"); }
TEST(ProcessDeath, TheExampleOfTheMakersArmActionStartsAsPrinted) { expect_to_start_as_printed("vendor_arm.yaml"); }

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
