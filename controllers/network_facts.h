// The facts that a network's file states of the robot that it was trained with, held against the descriptor that uses
// it: the metadata that IsaacLab (BeyondMimic), mjlab and holosoma write into ONNX files.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/controllers/descriptor.h"

namespace duet {

// One sentence for each of stiffness, damping, default pose and scale that the two give different numbers, and one for
// joints of other names; none for a file that says nothing. Numbers of a file are rounded to 3 digits by some.
// Throws InputError where both have the same joints in another order: the network would move others than it means to.
std::vector<std::string> compare_with_network(const Descriptor& descriptor,
                                              const std::map<std::string, std::string>& metadata,
                                              const std::string& network_path);

}  // namespace duet
