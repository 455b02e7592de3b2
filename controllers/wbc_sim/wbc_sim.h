// WBC-Sim (supplement A.3.2, A.4.1): a learnt whole-body controller that stands, steps and tracks the 36-D reference.
// The student (1090-D observation with ten frames of history, no base velocity) is the controller; the oracle (163-D,
// with the base velocity that only a simulation has) is there to be compared with.
#pragma once

#include <memory>

#include "duet/controllers/controller.h"
#include "duet/controllers/wbc_sim/network.h"

namespace duet {

// Throws std::invalid_argument for a robot that is not the network's (by joint name) or has not two legs of six joints.
std::unique_ptr<Controller> make_wbc_sim_controller(std::shared_ptr<const RobotModel> robot,
                                                    std::shared_ptr<const WbcNetwork> network);

// Options: network: student | braced | oracle | braced_oracle | a path.
ControllerInfo wbc_sim_info();
std::string wbc_sim_network_path(const ControllerOptions& options);  // MissingError where the shipped one is not there

}  // namespace duet
