// Supplement, section D with Algorithm 7: a retargeted data set as a policy is fine-tuned on before it meets the real
// robot. Pure function.
#pragma once

#include "duet/motion/paired_motion.h"
#include "duet/robots/phase_primitives.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The robot's preparation and follow-up become those of sim_to_real (robots/phase_primitives.h); its act, and
// everything that is not the robot's motion (partner, sources, reshaped, loss, phases), stay to the bit. The settings
// `prepared` and `mild_yaw` say so. Throws std::invalid_argument where `motion` is not valid, has another robot's
// joints, no act, or was prepared before.
PairedMotion prepare_for_real(PairedMotion motion, const RobotModel& robot, double mild_yaw = kSimToRealYaw);

}  // namespace duet
