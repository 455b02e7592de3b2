// The published controllers that ship as IO descriptors (controllers/descriptors), and where their networks are.
#pragma once

#include <functional>
#include <memory>
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

// Descriptor and network, loaded once for many controllers, each told a velocity as make_descriptor_controller has it;
// `told` may be null. The options are those of load_controller (controllers/catalogue/registry.h). Thread-safe.
struct ToldLoader {
  std::function<std::unique_ptr<Controller>(const ControllerOptions& options,
                                            std::shared_ptr<const VelocityCommand> told)>
      make;
  std::vector<std::string> notes;  // sentences: where the network's file and the descriptor disagree
};
// Throws InputError too where the network's file has the joints in another order.
ToldLoader load_told(const std::string& name, std::shared_ptr<const RobotModel> robot,
                     const ControllerOptions& options);
// The descriptor, its network, and each file of the network's external data ("network data NAME").
LoadedFiles published_files(const std::string& name, const ControllerOptions& options);

}  // namespace duet
