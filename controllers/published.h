// The published controllers that ship as IO descriptors (controllers/descriptors), and where their networks are.
#pragma once

#include <string>
#include <vector>

#include "duet/controllers/controller.h"
#include "duet/controllers/descriptor.h"
#include "duet/controllers/root_conversion.h"
#include "duet/core/loaded_file.h"

namespace duet {

// `name`: of a shipped descriptor, or the path of a descriptor (it ends in ".yaml"). Throws MissingError for a shipped
// one that is not there, InputError for one that is broken.
Descriptor load_descriptor(const std::string& name);

// The file that the option `network` names; else the descriptor's: beside it, in $DUET_MODELS, in $DUET_SHARED/models.
// Throws MissingError naming the places.
std::string find_network(const Descriptor& descriptor, const ControllerOptions& options = {});

std::unique_ptr<Controller> make_published(const std::string& name, std::shared_ptr<const RobotModel> robot,
                                           const ControllerOptions& options);
// The same, told a velocity as make_descriptor_controller has it; `told` is not null.
std::unique_ptr<Controller> make_told(const std::string& name, std::shared_ptr<const RobotModel> robot,
                                      const ControllerOptions& options, std::shared_ptr<const VelocityCommand> told);
// The descriptor, its network, and each file of the network's external data ("network data NAME").
LoadedFiles published_files(const std::string& name, const ControllerOptions& options);

}  // namespace duet
