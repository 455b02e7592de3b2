// A controller made of an IO descriptor and a network. It is bound to its robot by the names of joints.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "duet/controllers/controller.h"
#include "duet/controllers/descriptor.h"
#include "duet/controllers/root_conversion.h"
#include "duet/nn/network.h"

namespace duet {

// The entry of `duet list controllers` for it, with the options that it takes.
ControllerInfo descriptor_info(const Descriptor& descriptor);

// `network_path` names the network in messages. The options `network` and `engine` are the loader's and not looked at.
// Throws std::invalid_argument for a robot that lacks one of its joints or has one that it does not know, and for an
// option's value that it does not know; InputError for a network whose inputs and outputs are not the descriptor's,
// with the channels' places. `told`, where given, is the velocity at each tick, in the place of the reference's root;
// std::invalid_argument where the descriptor has no `command`.
std::unique_ptr<Controller> make_descriptor_controller(const Descriptor& descriptor,
                                                       std::shared_ptr<const RobotModel> robot,
                                                       std::unique_ptr<Network> network,
                                                       const std::string& network_path,
                                                       const ControllerOptions& options = {},
                                                       std::shared_ptr<const VelocityCommand> told = nullptr);

// The facts that a network's file states of the robot that it was trained with, held against the descriptor that uses
// it: the metadata that IsaacLab (BeyondMimic), mjlab and holosoma write into ONNX files.

// One sentence for each of stiffness, damping, default pose and scale that the two give different numbers, and one for
// joints of other names; none for a file that says nothing. Numbers of a file are rounded to 3 digits by some.
// Throws InputError where both have the same joints in another order: the network would move others than it means to.
std::vector<std::string> compare_with_network(const Descriptor& descriptor,
                                              const std::map<std::string, std::string>& metadata,
                                              const std::string& network_path);

}  // namespace duet
