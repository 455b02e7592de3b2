// A dry run beside recorded estimates of one person: a twin in this process, with the guard of a configuration, stands
// there; a policy that is told a task sees the person whom the guard tracks. What it would do is recorded; nothing is
// written to any robot. Deterministic.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/core/task.h"
#include "duet/hardware/guard/person_log.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/policies/policy.h"
#include "duet/rollout/rollout.h"

namespace duet {

// A twin that is asked for this configuration of a robot, or of another twin; what executes and measures is its own.
struct SeenOptions {
  RobotConfig config;  // its camera, limits and whether somebody is near
  std::uint64_t seed = 1;
};

struct SeenTask {
  Task task = Task::kWave;
  bool ran = false;          // the guard tracked somebody and ran
  std::string message = {};  // why it did not, or what ended the run
  Outcome outcome = Outcome::kError;
  int ticks = 0;                           // of 20 ms, of the recording
  std::optional<double> begins_at = {};    // a hand of the robot has left its place beside the pelvis by 0.1 m [s]
  double nearest = 0.0, nearest_at = 0.0;  // of a hand of the robot to one of the person as tracked [m], [s]
  double walked = 0.0;                     // of the root, from where it stood [m]
  int held_ticks = 0, unseen_ticks = 0;    // the guard held; it tracked nobody
  PersonCounts estimates{};                // of the recording
  ClampCounts clamps{};
};

// Plays the estimates from when the robot runs; until then the first usable one comes again and again, as of somebody
// who stands. No act's time is known: no part of the robot may touch while the configuration has somebody near.
SeenTask see_person(const std::vector<RecordedEstimate>& estimates, const SeenOptions& options, Policy& policy,
                    Task task);

}  // namespace duet
