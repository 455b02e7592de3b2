// Policies that are not compiled into duet: those of a policy descriptor, by its path.
#pragma once

#include <memory>
#include <string>

#include "duet/core/file.h"
#include "duet/nn/network.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/language.h"
#include "duet/policies/policy.h"

namespace duet {

// `name`: the path of a descriptor. Options of a network: `network`, `engine`, `language`; of a process: `deadline_ms`,
// `hang_ms`, `start_ms`. Both throw InputError for a descriptor that is broken.
PolicyInfo external_info(const std::string& name);
std::vector<PolicyOption> external_options(const PolicyDescriptor& descriptor);
// Throws InputError too for joints that are not the robot's and a network of other inputs or outputs,
// std::invalid_argument for an option's value, MissingError where the network or the program is not there. Each policy
// that it makes has its own network or process.
PolicyMaker external_maker(const std::string& name, std::shared_ptr<const RobotModel> robot,
                           const PolicyOptions& options);
// The descriptor; then of a network it and the language table that is given, of a process the files beside the
// descriptor that its command names, with those of the same ending beside them. Not those of a server.
LoadedFiles external_files(const std::string& name, const PolicyOptions& options);

// A policy made of a policy descriptor and a network: observation -> numbers -> plan.

// `network_path` names the network in messages. `language`: needed where a channel shows it, shared between episodes.
// Throws InputError for joints that are not the robot's and for a network whose inputs and outputs are not the
// descriptor's: file, line, name, expected, found and the channels' places.
std::unique_ptr<Policy> make_onnx_policy(const PolicyDescriptor& descriptor,
                                         const std::shared_ptr<const RobotModel>& robot,
                                         std::unique_ptr<Network> network, const std::string& network_path,
                                         std::shared_ptr<const LanguageEncoder> language);

// Whether a channel of the descriptor shows the prompt.
bool shows_language(const PolicyDescriptor& descriptor);

}  // namespace duet
