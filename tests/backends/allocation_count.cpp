#include "tests/backends/allocation_count.h"

#include <cstddef>

namespace {

thread_local long calls = 0;

}  // namespace

#if !defined(DUET_SANITIZED)
// The C library's own functions under the names that it keeps for programs that replace them.
extern "C" {
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* old, size_t size);

void* malloc(size_t size) {
  ++calls;
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  ++calls;
  return __libc_calloc(count, size);
}
void* realloc(void* old, size_t size) {
  ++calls;
  return __libc_realloc(old, size);
}
}
#endif

namespace duet::test {

bool allocations_are_counted() {
#if defined(DUET_SANITIZED)
  return false;
#else
  return true;
#endif
}

long allocation_count() { return calls; }

}  // namespace duet::test
