// Counts the calls of malloc in this thread (operator new, Eigen and MuJoCo all end there), to assert that a loop makes
// none.
#pragma once

namespace duet::test {

// False under the address sanitizer, which has a malloc of its own.
bool allocations_are_counted();
// Calls of malloc, calloc and realloc by this thread so far.
long allocation_count();

}  // namespace duet::test
