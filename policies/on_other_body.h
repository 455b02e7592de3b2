// A policy that was made for one robot, on another whose joints have the same names: HOMIE's G1, whose waist and hands
// are locked. The policy sees joints that the body lacks at neutral and at rest, and what it wants of them is left out.
#pragma once

#include <memory>

#include "duet/policies/policy.h"

namespace duet {

// Throws std::invalid_argument where the two have no joint in common.
std::unique_ptr<Policy> on_other_body(std::unique_ptr<Policy> policy, std::shared_ptr<const RobotModel> made_for,
                                      const RobotModel& body);

}  // namespace duet
