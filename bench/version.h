// The program's version and what it was built with.
#pragma once

#include <string>

namespace duet {

inline constexpr const char* kVersion = "0.1.0";

// "duet 0.1.0 (mujoco 2.2.2, playback)": one line for --version.
std::string version_text();

}  // namespace duet
