// Two people as a file of others holds them, before duet's axes, units and joints: what every reader of motion/people/
// gives. source_clip.h makes a clip of it.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/point_tracks.h"
#include "duet/core/pose.h"
#include "duet/core/task.h"
#include "duet/motion/layouts/joint_layout.h"
#include "duet/motion/people/people_options.h"
#include "duet/motion/person.h"

namespace duet {

struct RawPeople {
  std::string id;                       // of the clip: file name, or the data set's own
  std::string name;                     // the file, for messages
  const JointLayout* layout = nullptr;  // which joint each column is
  std::array<PointTracks, 2> joints;    // (T, layout->names.size(), 3) in the file's axes and unit
  // R_FJ, T * 24 in SMPL order: global, the identity in SMPL's rest pose (x to the left, y up, z forward); empty where
  // unknown.
  std::array<std::vector<Eigen::Quaterniond>, 2> rotations = {};
  double rate_hz = 0.0;         // 0: the file does not say
  std::optional<Axis> up = {};  // what the format is known to have; its world is level then
  std::optional<double> metres_per_unit = {};
  std::optional<Task> task = {};  // from the file's or folder's label
  std::optional<Person> reactor = {};
  std::optional<Phases> phases = {};               // frames of the file; empty: proposed
  std::vector<std::string> evidence = {};          // what the reader found, one sentence each
  std::map<std::string, std::string> source = {};  // provenance: format, files, licence, ...
  std::vector<Pose> object = {};                   // X_FO of an object that they handle, one a frame; empty: none
  std::shared_ptr<const JointLayout> made = {};    // where `layout` is of no table: keeps it
};

}  // namespace duet
