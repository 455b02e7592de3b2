// The ids of clips: of those that are synthesised, and what is added to an id for another view or role of its clip.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace duet {

// "people-handshake-s42-0007"; `manner`: "synth" or "people".
std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index);

// The id of the clip as a depth camera sees it.
std::string tracked_clip_id(const std::string& id);

// The id of the clip in which the robot replaces the other person than before, who was 'A' or 'B': with "-A" or "-B" at
// its end, and back the first one.
std::string id_in_other_role(const std::string& id, char before);

}  // namespace duet
