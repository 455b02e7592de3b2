// A replay as MCAP for Foxglove, by archives/mcap.h: bodies are told once, and where they are at each frame. Told anew
// at each frame, as one scene, they take some twenty times as much.
#pragma once

#include <string>

#include "duet/replay/replay_content.h"

namespace duet {

// Topics of a scene: "/SCENE/partner" and "/SCENE/partner/where" of the person, and of each track "/SCENE/TRACK/robot"
// (foxglove.SceneUpdate: the links' bodies, once), ".../where" (foxglove.FrameTransforms: the links, named
// "SCENE/TRACK/link"), ".../contacts" (foxglove.SceneUpdate: arrows), ".../state" (duet.ReplayState: time, joints by
// name, force of the partner on the robot [N]). A track whose partner moves otherwise than the first one's has an own
// one, "/SCENE/TRACK/partner", and where people alone are shown, "/SCENE/TRACK/person" is the one in the robot's place.
// JSON, 25 frames a second, in chunks packed by zstd; places to 0.01 mm. Time 0 is where the earliest track of a scene
// begins. Replaces `path`. Throws StorageError.
void write_replay_mcap(const ReplayContent& content, const std::string& path);

}  // namespace duet
