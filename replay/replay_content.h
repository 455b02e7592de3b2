// The content of a replay: episodes of one clip side by side, each a recording with the row that it left; and motions
// that no episode made, people alone among them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/metrics/contact_limits.h"
#include "duet/robots/robot_model.h"
#include "duet/scoring/episode_recording.h"

namespace duet {

struct ReplayTrack {
  Recording recording;                      // without frames of a robot where people alone are shown
  std::optional<KeptEpisode> kept;          // empty: a recording of anybody
  std::shared_ptr<const RobotModel> robot;  // null: people alone
  PointTracks other_person;                 // (T, 24, 3) beside recording.partner, in the robot's place; empty: none
  std::string name;                         // "mujoco · vmc · dstar", or the file's
  std::string repeat;                       // the command that makes it again; empty where none does
  std::string origin;  // "kept by the run", "run again, bit for bit", "run again, NOT as it was", "read from a file"

  [[nodiscard]] int frames() const { return robot ? recording.frames() : recording.partner.frames(); }
};

// Tracks of one task, clip, episode and perturbation: on one clock, which is 0 where the act begins.
struct ReplayScene {
  std::string id;    // "hug/hug_000/0/clean"; in links
  std::string name;  // "hug_000"
  std::string task, perturbation;
  std::vector<ReplayTrack> tracks;  // the main arm first
  int successes = 0, judged = 0;    // of the main arm

  // How far the main arm's tracks are from agreeing: the part of the rarer verdict, 0 to 0.5.
  [[nodiscard]] double disagreement() const;
};

struct ReplayContent {
  std::string title;               // "demo 2.2.0"
  std::vector<std::string> notes;  // sentences
  ContactLimits limits;
  std::vector<ReplayScene> scenes;
  long episodes_of_run = 0;  // 0: not of a run
};

}  // namespace duet
