#include "tests/robots/allocations.h"

#include <atomic>
#include <cstddef>

namespace {
std::atomic<long> count{0};
}

#ifdef DUET_SANITIZED
bool duet::test::counts_allocations() { return false; }
#else
// glibc's own allocator under the name that it keeps for programs that replace malloc.
extern "C" void* __libc_malloc(std::size_t size);  // NOLINT(bugprone-reserved-identifier)
extern "C" void* malloc(std::size_t size) {
  count.fetch_add(1, std::memory_order_relaxed);
  return __libc_malloc(size);
}
bool duet::test::counts_allocations() { return true; }
#endif

long duet::test::allocations() { return count.load(); }
