// The record of every run, be it played back, simulated or on the robot: metrics and detectors see only this.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/contact.h"
#include "duet/core/outcome.h"
#include "duet/core/point_tracks.h"
#include "duet/core/robot_state.h"
#include "duet/core/task.h"

namespace duet {

struct RecordedContact {
  int frame = 0;
  Contact contact;
};

// Frame t is the state at time t / rate_hz; its reference and q_target are those that led *to* the next frame; its
// contacts are those of the last physics step before it. All vectors have T entries.
struct Recording {
  std::optional<Task> task;  // none: nobody said what it is
  Phases phases;             // of these frames
  double rate_hz = 50.0;
  std::vector<RobotState> robot;
  std::vector<Reference> reference;
  std::vector<Eigen::VectorXd> q_target;  // the joint command's targets [rad]
  PointTracks partner;                    // (T, 24, 3), SMPL-24 joints of the human partner; empty: none
  std::vector<RecordedContact> contacts;  // in order of frame
  Outcome outcome = Outcome::kOk;
  std::string message;  // why, where outcome is not kOk

  [[nodiscard]] int frames() const { return static_cast<int>(robot.size()); }
};

}  // namespace duet
