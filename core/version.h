// The version of duet: that of the CMake project, and written nowhere else.
#pragma once

namespace duet {

const char* duet_version();  // "0.1.0"

}  // namespace duet
