// The ids of synthesised clips.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace duet {

// "people-handshake-s42-0007"; `manner`: "synth" or "people".
std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index);

}  // namespace duet
