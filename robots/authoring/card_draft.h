// The scaffold of a robot card, written from a URDF alone: joints, roles by geometry, a standing pose, soles, frames
// and tracks, with a comment that says where each part comes from. What a URDF cannot say is assumed and marked
// kAssumed. `duet robot new`. Thread-safe.
#pragma once

#include <string>
#include <vector>

namespace duet {

struct CardDraft {
  std::string name;                   // of the robot
  std::string text;                   // the card
  std::vector<std::string> proposed;  // sentences on the roles that were found
  std::vector<std::string> missing;   // sentences on what has to be looked up
};

// `urdf_text` was read from `file`. `name`: of the robot, "" for the URDF's; `urdf_in_card`: the path that the card
// gives. Throws InputError as parse_urdf, for a name that is no plain one, and for a description without a hinge.
CardDraft draft_card(const std::string& urdf_text, const std::string& file, std::string name,
                     const std::string& urdf_in_card);

}  // namespace duet
