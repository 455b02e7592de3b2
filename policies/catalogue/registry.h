// Every policy by name: those that ship with duet, and those that a program adds. Thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "duet/core/file.h"
#include "duet/core/task.h"
#include "duet/policies/policy.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Policies that ship with duet: "replay" (the retargeted motion with hindsight, as anchors), "replay_dense" (the same
// at 50 Hz past the anchors: the upper bound of controller and engine), "null" (holds the neutral pose where it
// stands), "dstar", "dp", ... A name that ends in ".yaml" is a policy descriptor's path and as good as one of them.
std::vector<PolicyInfo> policies();
std::vector<std::string> policy_names();
// Options that shipped policies, scripted ones too, and descriptors take beside their own: average and hand_servo.
std::vector<PolicyOption> common_policy_options();
PolicyInfo policy_info(const std::string& name);  // with the common options that it takes
// The role of a policy in tables, whatever a suite calls it; a descriptor, and what a program adds, competes.
PolicyRole policy_role(const std::string& name);
// Every file that such a policy loads, in a fixed order. Throws as policy_maker for a name that is unknown and a
// descriptor that is broken, MissingError for a file that is not on this machine; the files are not read.
LoadedFiles policy_files(const std::string& name, const PolicyOptions& options = {});

// Throws std::invalid_argument for an unknown name or option (with the nearest and all known) and a robot that does not
// fit; MissingError where a file is not on this machine; InputError for one that is broken or of another kind.
PolicyMaker policy_maker(const std::string& name, std::shared_ptr<const RobotModel> robot,
                         const PolicyOptions& options = {});
std::unique_ptr<Policy> make_policy(const std::string& name, std::shared_ptr<const RobotModel> robot,
                                    const PolicyOptions& options = {});

// From now on `info.name` is a policy like those that ship. `load` gets a robot that is not null and options that are
// known to be those of `info`, loads what the policy needs once, and returns what makes one policy per episode. Throws
// std::invalid_argument for a name that is taken, empty or ends in ".yaml", and where `load` is empty.
using PolicyLoader = std::function<PolicyMaker(std::shared_ptr<const RobotModel> robot, const PolicyOptions&)>;
void register_policy(const PolicyInfo& info, PolicyLoader load);

}  // namespace duet
