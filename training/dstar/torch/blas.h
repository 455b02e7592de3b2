// The BLAS that libtorch has got.
#pragma once

namespace duet {

// Threads are the trainer's: libtorch, and a BLAS with threads of its own, work on one each.
void one_thread_each();

}  // namespace duet
