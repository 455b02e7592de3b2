// The CPU clock of the calling thread, which times a step.
#pragma once

namespace duet {

double thread_cpu_seconds();  // since the thread began [s]

}  // namespace duet
