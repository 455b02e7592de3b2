// What a step costs: the CPU clock of the calling thread.
#pragma once

namespace duet {

double thread_cpu_seconds();  // since the thread began [s]

}  // namespace duet
