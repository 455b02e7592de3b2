// A replay as MCAP for Foxglove: each track's bodies and contacts as `foxglove.SceneUpdate`, its joints as
// `foxglove.JointStates`-like JSON. Written by hardware/mcap.h.
#pragma once

#include <string>

#include "duet/bench/replay/replay_content.h"

namespace duet {

// Topics "/SCENE/TRACK/scene" (foxglove.SceneUpdate, JSON) and "/SCENE/TRACK/state" (duet.ReplayState: time, joints by
// name, force of the partner on the robot [N]), time 0 where the earliest track of a scene begins. Replaces `path`.
// Throws StorageError.
void write_replay_mcap(const ReplayContent& content, const std::string& path);

}  // namespace duet
