// A policy made of a policy descriptor and a network: observation -> numbers -> plan.
#pragma once

#include <memory>

#include "duet/nn/network.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/language.h"
#include "duet/policies/policy.h"

namespace duet {

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
