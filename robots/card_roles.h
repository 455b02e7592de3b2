// The roles of a card: read from it, and looked up in the robot that it makes. docs/file-formats.md, "Robot card".
#pragma once

#include <string>

#include "duet/robots/card.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/yaml_section.h"

namespace duet {

// Replaces what the keys of `card`, which stands in `file`, say. Throws InputError as YamlSection does.
void read_roles(const YamlSection& card, const std::string& file, CardRoles& roles);

// Sets roles, fall, stance and root_bounds of a robot that has everything else. A joint that the card locks is left
// out. Throws InputError with file and line: unknown names, legs or arms whose sides do not mirror one another joint by
// joint, a joint that is given two sides, an angle or a range outside the joint's limits.
void bind_roles(const RobotCard& card, RobotModel& robot);

}  // namespace duet
