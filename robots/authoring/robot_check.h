// The needs of a run from a robot card, looked at before the first episode: what the card and its URDF say of one
// another, and what the robot that they make tells of itself. `duet robot check`. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "duet/robots/authoring/robot_findings.h"

namespace duet {

// Marks a value in a card that nobody has measured yet; check_robot counts the lines that hold it.
inline constexpr const char* kAssumed = "# assumed";

struct RobotCheck {
  std::string name, card, urdf;  // of the card; paths
  std::vector<RobotFinding> findings;

  [[nodiscard]] bool can_run() const;
};

// Checks the card at a path or of a name. Throws MissingError for an unknown name and InputError for a card or a
// description that is none (not YAML, an unknown key, xacro, a mesh); what the two say of one another is a finding.
RobotCheck check_robot(const std::string& card);

}  // namespace duet
