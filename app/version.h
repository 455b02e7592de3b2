// The program's version and what it was built with.
#pragma once

#include <string>

namespace duet {

// "duet 0.1.0 (mujoco 2.2.2, bullet 3.24)": one line for --version.
std::string version_text();

}  // namespace duet
