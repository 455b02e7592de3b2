// Ctrl-C and SIGTERM as a question that loops ask. A second Ctrl-C ends the program at once.
#pragma once

namespace duet {

enum class Interrupt { kNone, kInterrupted, kTerminated };  // SIGINT (exit code 130), SIGTERM (exit code 75)

// From now on the two signals set the answer of interrupt() instead of ending the program.
void catch_interrupts();
Interrupt interrupt();

}  // namespace duet
