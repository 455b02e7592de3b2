// The guard as a user starts it, before a robot's end that has nothing of this tree (lab_robot.cpp): two processes and
// a planner that asks for more than is allowed, in real time, over the loopback interface. Where this machine holds the
// guard up the trial is made again.
#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "duet/core/file.h"
#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/log/log_reader.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/robot_wire.h"
#include "tests/app/program.h"
#include "tests/hardware/armed_program.h"

namespace duet {
namespace {

using test::OwnProcess;
using ::testing::HasSubstr;

constexpr int kElbow = 18;  // the left one

std::string lab_domain() {
  constexpr int kOwn = 75;  // other tests' processes have other numbers
  return std::to_string(kFirstTwinDomain +
                        (static_cast<int>(getpid()) + kOwn) % (kLastTwinDomain - kFirstTwinDomain + 1));
}
std::string lab_port() { return std::to_string(51000 + static_cast<int>(getpid()) % 9000); }

// Asks 50 times a second for 0.15 m/s ahead and for an elbow 50 rad up, until it goes out of scope.
class GreedyPlanner {
 public:
  explicit GreedyPlanner(const std::string& socket) : guard_(DatagramSocket::to_path(socket)) {
    thread_ = std::thread([this] {
      PlannerMessage message;
      message.command.q = load_shared_robot()->neutral;
      message.command.q[kElbow] = 50.0;
      message.command.root = {0.15, 0.0, 0.0, 0.74};
      GuardBuffer buffer;
      for (; !ends_; std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
        ++message.sequence;
        message.command.stamp = 0.02 * static_cast<double>(message.sequence);
        (void)guard_.send(std::span<const std::byte>(buffer).first(encode(message, buffer)));
      }
    });
  }
  ~GreedyPlanner() {
    ends_ = true;
    thread_.join();
  }

 private:
  DatagramSocket guard_;
  std::atomic<bool> ends_ = false;
  std::thread thread_;
};

struct LabTrial {
  LabTrial() {
    write_file(folder / "lab.yaml",
               "schema: duet.robot/1\nrobot: lab\ntwin: true\ninterface: lo\nallow_motion: true\nperson: false\n"
               "mode_machine: 5\ndomain: " +
                   lab_domain() + "\n");
    robot =
        std::make_unique<OwnProcess>(std::vector<std::string>{DUET_LAB_ROBOT, lab_domain(), lab_port(), "60"}, true);
    guard = std::make_unique<OwnProcess>(
        std::vector<std::string>{DUET_PROGRAM, "hw", "arm", folder / "lab.yaml", "--log", folder / "run.mcap",
                                 "--socket", folder / "guard", "--velocity-port", lab_port()},
        true);
  }
  // Armed, stood up, run, stopped: as the robot's keys ask.
  bool goes_through() {
    if (!test::arm_by_its_word(*guard) || !guard->says("stand (none)", 20.0)) return false;
    status = test::duet_program("hw status --json --socket " + (folder / "guard")).out;
    const GreedyPlanner planner(folder / "guard");
    return guard->says("run (none)", 15.0) && guard->says("damp (stop_key)", 10.0) && robot->says("violations", 10.0);
  }
  void end() {
    for (int twice = 0; twice < 2; ++twice) {
      guard->send(SIGTERM);
      usleep(200000);
    }
    EXPECT_NE(guard->exit_code(10.0), -1);
  }

  test::ScratchFolder folder;
  std::unique_ptr<OwnProcess> robot, guard;
  std::string status;
};

// The states of the log are those that the robot's end sent, before the guard moved it and after.
void expect_its_states(const std::string& log) {
  std::vector<LowStateFrame> ends;
  read_run_log(log, {.state = [&](const LowStateFrame& frame) {
                 if (ends.size() == 2) ends.pop_back();
                 ends.push_back(frame);
               }});
  ASSERT_EQ(ends.size(), 2u);
  EXPECT_NEAR(ends[0].motor[kElbow].q, 0.45, 0.001);
  EXPECT_GT(ends[1].motor[kElbow].q, 1.3);
  EXPECT_EQ(ends[0].motor[kElbow].temperature[1], 61);
  EXPECT_EQ(ends[0].motor[kElbow - 1].temperature[1], 42);
}

TEST(LabRobot, ARobotsEndThatHasNothingOfThisTreeIsArmedMovedAndStopped) {
  constexpr int kTrials = 6;
  std::string said;
  for (int k = 0; k < kTrials; ++k) {
    LabTrial trial;
    const bool through = trial.goes_through();
    const int code = trial.robot->exit_code(through ? 5.0 : 0.1);
    said = "the guard said:\n" + trial.guard->said() + "\nthe robot said:\n" + trial.robot->said();
    ASSERT_NE(code, 1) << said;
    if (code == 0) {
      // Its arms weigh nothing: the weight that the guard feeds forward moves them by a hundredth.
      EXPECT_THAT(trial.robot->said(), HasSubstr("elbow from 0.4")) << said;
      EXPECT_THAT(trial.robot->said(), HasSubstr("stopped, in time\nviolations 0\n")) << said;
      EXPECT_THAT(trial.status, HasSubstr("\"winding\": 61.0"));
      EXPECT_THAT(trial.status, HasSubstr("\"charge\": 73.0"));
      trial.end();
      return expect_its_states(trial.folder / "run.mcap");
    }
    ASSERT_TRUE(test::held_up(trial.guard->said(), "")) << said;
  }
  GTEST_SKIP() << "not run: this machine held the guard up in each of " << kTrials << " trials; " << said;
}

}  // namespace
}  // namespace duet
