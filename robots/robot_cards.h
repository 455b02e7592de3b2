// The robot cards of this machine: every *.yaml in a folder of its own below robots/ (robots/g1/g1_27dof.yaml), in
// $DUET_SHARE, beside the program (../share/duet) and in the source tree. A file that stands in several of the three
// counts once, in that order; a card's name is its file's without the ending.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

struct RobotCardFile {
  std::string name;    // "g1_27dof"
  std::string folder;  // "robots/g1"
  std::string path;
};

// The name of the robot that stands in where none is named.
std::string default_robot();

// The card that stands in first, then by name. Throws InputError where two files have one name.
std::vector<RobotCardFile> robot_cards();

// Path of the card of that name. Throws std::invalid_argument for another name, with the nearest and all known.
std::string shipped_card(const std::string& name);

// The robot of one of robot_cards() whose digest it is; null where none has it.
std::shared_ptr<const RobotModel> robot_of_digest(const std::string& digest);

}  // namespace duet
