// A balance controller in the manner of virtual model control: it stands on both feet, keeps the centre of mass over
// them and tracks the reference's upper body. It does not step. It takes from the reference: joints that lead to no
// foot follow it; of the root it follows yaw and the place in the ground plane as far as the feet allow, at the
// standing height; the legs' angles follow from the feet and the pelvis and are not tracked. Source of the scheme:
// Pratt et al., "Virtual Model Control", IJRR 20 (2001); here the virtual forces become accelerations of a full inverse
// dynamics, and contact forces that cannot be had change the motion, not the feet.
#pragma once

#include <memory>

#include "duet/controllers/controller.h"

namespace duet {

// Gains of the wanted accelerations [1/s^2 and 1/s], and the weights of missing them.
struct VmcOptions {
  double com_stiffness = 43.0;
  double com_damping = 15.0;
  double height_stiffness = 60.0;
  double height_damping = 15.0;
  double tilt_stiffness = 80.0;
  double tilt_damping = 12.0;
  double com_weight = 1.0;
  double height_weight = 1.0;
  double tilt_weight = 0.1;
  double yaw_weight = 0.1;
  double pressure_gain = 0.7;        // of moving the centre of mass until the centre of pressure is central [1/s]
  double push_gain = 0.3;            // of the estimate of a push per tick, in [0, 1]; 0: pushes are not estimated
  double push_range = 40.0;          // largest push that is compensated [N]
  double leg_stiffness_share = 0.3;  // of the card's gains, around the predicted motion of the legs
  double leg_damping_share = 0.5;
  double friction = 0.5;  // that the planned forces rely on
};

// Throws std::invalid_argument for a robot without soles, with soles at the base itself or without a stance in its
// card.
std::unique_ptr<Controller> make_vmc_controller(std::shared_ptr<const RobotModel> robot);
std::unique_ptr<Controller> make_vmc_controller(std::shared_ptr<const RobotModel> robot, const VmcOptions& options);

}  // namespace duet
