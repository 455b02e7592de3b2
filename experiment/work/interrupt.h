// Ctrl-C, SIGTERM and SIGHUP (a connection that is lost) as a question that loops ask. A second Ctrl-C ends the program
// at once.
#pragma once

namespace duet {

enum class Interrupt { kNone, kInterrupted, kTerminated };  // SIGINT (exit code 130), SIGTERM or SIGHUP (75)

// From now on the signals set the answer of interrupt() instead of ending the program. SIGHUP stays
// ignored where it was (nohup).
void catch_interrupts();
Interrupt interrupt();

}  // namespace duet
