// A motion without physics: a robot that is frame by frame where the motion has it.
#pragma once

#include <memory>
#include <optional>

#include "duet/core/recording.h"
#include "duet/core/robot_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// A motion as it is, frame for frame, beside a partner (as many frames, or nobody). Throws std::invalid_argument for
// fewer than 2 frames and for a partner of another number of frames.
Recording play_back(const RobotMotion& motion, const PointTracks& partner, std::optional<Task> task,
                    const Phases& phases, const std::shared_ptr<const RobotModel>& robot);

}  // namespace duet
