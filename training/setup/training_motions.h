// Motions for a controller to learn on: synthesised clips of the six tasks through PAIR, with the approach of A.4.4.
// No suite that ships draws its clips from this seed (a test of ShippedSuites).
#pragma once

#include <vector>

#include "duet/core/robot_motion.h"
#include "duet/experiment/work/progress.h"
#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr std::uint64_t kTrainingSeed = 770001;

std::vector<RobotMotion> training_motions(const RobotModel& robot, int per_task, int threads, Progress& progress);

}  // namespace duet
