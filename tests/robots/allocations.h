// Counts calls of malloc (and so of operator new and of Eigen's allocator) in this test program.
#pragma once

namespace duet::test {

// False where a sanitizer replaces malloc: nothing is counted then.
bool counts_allocations();
long allocations();

}  // namespace duet::test
