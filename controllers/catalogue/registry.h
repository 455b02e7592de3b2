// Every controller by name: those that ship with duet, and those that a program adds. Thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "duet/controllers/controller.h"
#include "duet/controllers/descriptor.h"
#include "duet/controllers/root_conversion.h"
#include "duet/core/file.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/robots/explicit_step.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Controllers that ship with duet: "pd", "vmc", "wbc_sim", "homie", "twist2", "playground", "rl_gym", ... A name that
// ends in ".yaml" is the path of an IO descriptor (controllers/descriptor.h) and as good as one of them.
std::vector<ControllerInfo> controllers();
std::vector<std::string> controller_names();
ControllerInfo controller_info(const std::string& name);
// Every file that such a controller loads, its card aside, in a fixed order. Throws as make_controller for a name that
// is unknown, a descriptor that is broken and a network that is not on this machine; the files are not read.
LoadedFiles controller_files(const std::string& name, const ControllerOptions& options = {});
// Options that every controller has beside its own.
std::vector<ControllerOption> common_controller_options();
// Throws std::invalid_argument for an option that it does not have, with the nearest and all known.
void check_controller_options(const ControllerInfo& info, const ControllerOptions& options);

// Throws std::invalid_argument for an unknown name or option (with the nearest and all known) and a robot whose joints
// are not those it was made for (by name); MissingError where its network is not on this machine (naming the places
// looked at and the option that sets it); InputError for a network that is broken or of another kind.
std::unique_ptr<Controller> make_controller(const std::string& name, const std::shared_ptr<const RobotModel>& robot,
                                            const ControllerOptions& options = {});

// The files of a controller, loaded once for many episodes: all controllers that it makes have the files as they were.
// An episode may have another `command` than the options that it was loaded with, and nothing else. Thread-safe.
struct LoadedController {
  std::function<std::unique_ptr<Controller>(const ControllerOptions& options)> make;
  std::vector<std::string> notes{};  // sentences: what a user should know of its files
};
// Throws as make_controller.
LoadedController load_controller(const std::string& name, const std::shared_ptr<const RobotModel>& robot,
                                 const ControllerOptions& options = {});

// The gains by which a controller holds the robot in its standing pose, where it is asked for a command.
JointGains standing_gains(Controller& controller, const RobotModel& robot);
// The same by name; a published one's are its descriptor's and need no network. Throws as make_controller.
JointGains standing_gains(const std::string& name, const std::shared_ptr<const RobotModel>& robot,
                          const ControllerOptions& options = {});

// Makes one controller per episode. The robot is never null; options are known to be those of the ControllerInfo.
using ControllerMaker =
    std::function<std::unique_ptr<Controller>(std::shared_ptr<const RobotModel> robot, const ControllerOptions&)>;
// From now on `info.name` is a controller like those that ship, guarded against numbers that are not finite. Throws
// std::invalid_argument for a name that is taken, empty or ends in ".yaml", and where `make` is empty.
void register_controller(const ControllerInfo& info, ControllerMaker make);

// The published controllers that ship as IO descriptors (controllers/descriptors), and where their networks are.

// `name`: of a shipped descriptor, or the path of a descriptor (it ends in ".yaml"). Throws MissingError for a shipped
// one that is not there, InputError for one that is broken.
Descriptor load_descriptor(const std::string& name);

// The file that the option `network` names; else the descriptor's, from its folder (published_places of core/share.h).
// Throws MissingError naming the places and, where it is known, the network's digest (controllers/networks.sha256).
std::string find_network(const Descriptor& descriptor, const ControllerOptions& options = {});

// The networks of a descriptor, each read once, as one (controllers/composed_network.h); the metadata are those of its
// policy's. `path` of the policy's is find_network's. Throws as find_network, load_network_file and compose_networks.
NetworkFile load_networks(const Descriptor& descriptor, const ControllerOptions& options = {});

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
// The descriptor, its network, and each file of the network's external data ("network data NAME"); the same of its
// other networks ("encoder network").
LoadedFiles published_files(const std::string& name, const ControllerOptions& options);

}  // namespace duet
