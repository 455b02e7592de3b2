// Every unit that sees DART's headers includes this one.
#pragma once

#include <Eigen/Core>

// libdart is built for 16-byte alignment: a unit with wider vectors would lay out the same Eigen types differently and
// corrupt memory.
static_assert(EIGEN_MAX_ALIGN_BYTES == 16, "DART and AVX do not go together: compile for x86-64-v2 at most");
