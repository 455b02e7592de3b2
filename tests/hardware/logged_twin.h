// A guarded twin whose every tick is logged, for tests of logs and of what reads them.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "duet/hardware/log/run_log.h"
#include "tests/hardware/guarded_twin.h"

namespace duet::test {

struct LoggedTwin {
  explicit LoggedTwin(const std::string& path, const GuardSetup& setup = twin_guard(), const TwinOptions& options = {})
      : robot(setup, options), log(path, setup) {}

  // `each` is called after every tick.
  void run_for(
      double seconds, const std::function<void()>& each = [] {}) {
    for (double left = seconds; left > 0.5 * GuardedTwin::kDt; left -= GuardedTwin::kDt) {
      robot.tick();
      log.add(robot.guard);
      each();
      if (robot.ticks % 500 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(30));  // the writer's turn
    }
  }
  // Stands, is armed and started, and the dead-man switch is held.
  void arm(const std::function<void()>& each = [] {}) {
    robot.hold_key(RemoteKey::kR1);
    run_for(2.2, each);
    robot.guard.arm();
    run_for(0.01, each);
    robot.hold_key(RemoteKey::kStart);
    run_for(0.1, each);
    robot.drop_key(RemoteKey::kStart);
    run_for(0.9, each);  // its gains rise
    robot.hold_key(RemoteKey::kA);
  }

  GuardedTwin robot;
  RunLog log;
};

}  // namespace duet::test
