// How soon the scheduler lets this process run when its time has come.
#pragma once

namespace duet {

// Timers of this thread, and of those that it makes from now on, wake up on time, as far as the scheduler lets them;
// nothing where the kernel refuses.
void ask_for_sharp_timers();

// The same, and they go before everything that has no such priority (SCHED_FIFO): the guard's tick, and the threads of
// DDS, where they are made afterwards. False where the system refuses; it takes CAP_SYS_NICE or a limit `rtprio`. Then
// a machine with other work to do is late, and the robot is held.
bool ask_for_real_time();

}  // namespace duet
