// Facts that a user may state of a recording of two people where the file does not, or states wrongly. Empty = what the
// layout is known to have, else what is found from the data; the evidence says which.
#pragma once

#include <optional>
#include <string>

#include "duet/core/task.h"
#include "duet/motion/person.h"

namespace duet {

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
  std::string object = {};               // the user's file of a carried object's shape (motion/people/object_shape.h)
  Alignment align = Alignment::kNone;
  std::optional<Task> task = {};       // empty: from the file's or folder's label, else refused
  std::optional<Person> reactor = {};  // empty: from the data set's annotation, else B
  bool as_is = false;                  // take people who cannot be (size, upright, floor, sides), and say so
  double output_rate_hz = 50.0;
};

}  // namespace duet
