// The states that a run of the G1 went through, for comparison bit by bit.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/backends/small_robots.h"

namespace duet::test {

// A run that falls over: contacts come and go, everything is excited.
struct Trace {
  std::vector<RobotState> states;
  std::vector<size_t> contacts;
  std::vector<Eigen::Vector3d> forces;
};

inline Trace fall(Backend& backend, int begin, int end) {
  const RobotModel& robot = *backend.scene().robot;
  Trace run;
  JointCommand command = robot.default_command(robot.neutral);
  for (int i = begin; i < end; ++i) {
    command.q_target[3] = robot.neutral[3] + 0.3 * std::sin(0.02 * i);
    EXPECT_EQ(backend.step(command), Outcome::kOk);
    run.states.push_back(backend.state());
    run.contacts.push_back(backend.contacts().size());
    for (const Contact& contact : backend.contacts()) run.forces.push_back(contact.f_W);
  }
  return run;
}

inline bool same(const Trace& a, const Trace& b) {
  return a.contacts == b.contacts && a.forces == b.forces &&
         std::ranges::equal(a.states, b.states, [](const RobotState& x, const RobotState& y) { return same(x, y); });
}

}  // namespace duet::test
