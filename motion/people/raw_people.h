// Two people as a file of others holds them, before duet's axes, units and joints: what every reader of motion/people/
// gives. source_clip.h makes a clip of it.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/robot_state.h"
#include "duet/core/task.h"
#include "duet/motion/human_motion.h"
#include "duet/motion/layouts/joint_layout.h"

namespace duet {

// Facts that a user may state of a recording of two people where the file does not, or states wrongly. Empty = what the
// layout is known to have, else what is found from the data; the evidence says which.

enum class Axis { kPlusX, kMinusX, kPlusY, kMinusY, kPlusZ, kMinusZ };  // of the file, that points up

// How two people who were recorded apart come into one world: not at all (refused), on one floor at the distance that
// the files give, or so that the hands that meet do meet. The clip's source then says "estimated shared frame".
enum class Alignment { kNone, kFloor, kContact };

struct PeopleOptions {
  std::optional<double> metres_per_unit = {};
  std::optional<Axis> up = {};
  std::optional<double> rate_hz = {};
  std::optional<bool> mirrored = {};     // left and right are exchanged in the file
  std::optional<bool> level = {};        // turn the world so that its floor is level (a camera that looked down)
  std::optional<double> floor = {};      // height of the floor along the up axis, in metres after the unit
  std::optional<bool> drop_t_pose = {};  // an added T pose in frame 0
  std::string skeleton = {};             // name of a joint layout (motion/layouts/joint_layout.h) or of a file of names
  std::string body_model = {};           // the user's SMPL, SMPL-H or SMPL-X file
  std::string object = {};               // the user's file of a carried object's shape (motion/carried_object.h)
  Alignment align = Alignment::kNone;
  std::optional<Task> task = {};         // empty: from the file's or folder's label, else refused
  std::optional<Person> reactor = {};    // empty: from the data set's annotation, else B
  std::optional<double> fill_gaps = {};  // of a joint that is not seen, at most; also at either end [s]
  bool still_partner = false;            // somebody who stands still faces one who is alone in a file
  bool as_is = false;                    // take people who cannot be (size, upright, floor, sides), and say so
  double output_rate_hz = 50.0;
};

struct RawPeople {
  std::string id;                       // of the clip: file name, or the data set's own
  std::string name;                     // the file, for messages
  const JointLayout* layout = nullptr;  // which joint each column is
  // (T, layout->names.size() - layout->made_up, 3) in the file's axes and unit; person B's is empty of one alone.
  std::array<PointTracks, 2> joints;
  // R_FJ, T * 24 in SMPL order: global, the identity in SMPL's rest pose (x to the left, y up, z forward); empty where
  // unknown.
  std::array<std::vector<Eigen::Quaterniond>, 2> rotations = {};
  double rate_hz = 0.0;         // 0: the file does not say
  bool uneven = false;          // the file's times are not: its frames were put at even ones along lines
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
