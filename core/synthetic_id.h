// The ids of synthesised clips, by which tables tell their people from recorded ones.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace duet {

// "people-handshake-s42-0007"; `manner`: "synth" or "people".
std::string synthetic_clip_id(std::string_view manner, std::string_view task, std::uint64_t seed, int index);

// Whether an id is one, or begins with one and goes on after a hyphen (a variant, a role, "tracked").
bool is_synthetic_clip(std::string_view id);

}  // namespace duet
