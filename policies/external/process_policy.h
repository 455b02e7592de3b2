// A policy in a process of its own, started here or already running: observation -> message -> plan. A process that is
// late, answers nonsense or dies costs a plan and is counted (Policy::faults); it never stops duet.
#pragma once

#include <memory>

#include "duet/policies/external/descriptor.h"
#include "duet/policies/policy.h"

namespace duet {

// Starts or connects; hello is said at the first reset, and where its answer fails the policy is dead, with the reason.
// Throws InputError for joints that are not the robot's, MissingError where the program is not there.
std::unique_ptr<Policy> make_process_policy(const PolicyDescriptor& descriptor,
                                            const std::shared_ptr<const RobotModel>& robot);

}  // namespace duet
