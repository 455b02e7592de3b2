// PAIR (supplement A.1): retargets one person of a clip to the robot while keeping the geometry between the two.
#pragma once

#include <Eigen/Core>

#include "duet/core/recording.h"
#include "duet/motion/paired_motion.h"
#include "duet/retarget/kernels/kernels.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/roles.h"

namespace duet {

// The clip is resampled to 50 Hz where it is not. Throws std::invalid_argument: a clip that does not validate, fewer
// than 5 frames, a robot without the 16 pairs; InputError: frames that need more memory than is left (some 24 kB each,
// core/machine.h); MissingError: a kernel that this processor cannot run. Thread-safe; the
// result does not depend on the number of threads nor, bit for bit, on the choice between the AVX2 and AVX-512 kernels.
PairedMotion retarget(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options = {});

// The smoothing at the end of PAIR (supplement A.1.2): Gaussian, kernel 5, sigma 0.75, over time.

// Each row of `x` (joints, T) is filtered along its columns; beyond the ends the first and last columns repeat. The
// weights are positive and sum to one, so that bounds on x hold for the result up to rounding.
Eigen::MatrixXd gaussian_filter(const Eigen::MatrixXd& x);

// Joints within the limits of their speed.

// The mean of the nearest motions above and below `motion` whose joints never move faster than the robot's limits
// (RobotJoint::velocity; one that is 0 is no limit). Frames around which nothing is too fast stay as they are to the
// last bit of a mean, angles stay between those that the joint had, and where angles differ by at most d before, they
// do so after. Throws std::invalid_argument: a motion of another robot.
void keep_joint_speeds(const RobotModel& robot, RobotMotion& motion);

// Supplement, section D with Algorithm 7: a retargeted data set as a policy is fine-tuned on before it meets the real
// robot. Pure function.

// The robot's preparation and follow-up become those of sim_to_real (robots/roles.h); its act, and
// everything that is not the robot's motion (partner, sources, reshaped, loss, phases), stay to the bit. The settings
// `prepared` and `mild_yaw` say so. Throws std::invalid_argument where `motion` is not valid, has another robot's
// joints, no act, or was prepared before.
PairedMotion prepare_for_real(PairedMotion motion, const RobotModel& robot, double mild_yaw = kSimToRealYaw);

}  // namespace duet
