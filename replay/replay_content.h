// The content of a replay: episodes of one clip side by side, each a recording with the row that it left; and motions
// that no episode made, people alone among them.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/metrics/contact_limits.h"
#include "duet/robots/robot_model.h"
#include "duet/scoring/scoring.h"

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

// A replay as MCAP for Foxglove, by archives/mcap.h: bodies are told once, and where they are at each frame. Told anew
// at each frame, as one scene, they take some twenty times as much.

// Topics of a scene: "/SCENE/partner" and "/SCENE/partner/where" of the person, and of each track "/SCENE/TRACK/robot"
// (foxglove.SceneUpdate: the links' bodies, once), ".../where" (foxglove.FrameTransforms: the links, named
// "SCENE/TRACK/link"), ".../contacts" (foxglove.SceneUpdate: arrows), ".../state" (duet.ReplayState: time, joints by
// name, force of the partner on the robot [N]). A track whose partner moves otherwise than the first one's has an own
// one, "/SCENE/TRACK/partner", and where people alone are shown, "/SCENE/TRACK/person" is the one in the robot's place.
// JSON, 25 frames a second, in chunks packed by zstd; places to 0.01 mm. Time 0 is where the earliest track of a scene
// begins. Replaces `path`. Throws StorageError.
void write_replay_mcap(const ReplayContent& content, const std::string& path);

}  // namespace duet
