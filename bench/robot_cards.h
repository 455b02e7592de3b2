// The robot cards that ship with duet.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "robots/robot_model.h"

namespace duet {

// Paths, the default card first, then by name.
std::vector<std::string> shipped_cards();

// Path of the card of that name. Throws std::invalid_argument for another name, with the nearest.
std::string shipped_card(const std::string& name);

// The shipped robot whose digest it is; null where none has it.
std::shared_ptr<const RobotModel> robot_of_digest(const std::string& digest);

}  // namespace duet
