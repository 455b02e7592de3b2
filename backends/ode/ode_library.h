// The data that ODE keeps per process and per thread. Every function of this folder that calls ODE enters it first.
#pragma once

#include <string>

namespace duet {

// Starts ODE on the first call and gives this thread the data that ODE needs in each thread that steps a world; they
// go with the thread. ODE's errors are from then on std::runtime_error "ode: ..." (by default they end the process),
// and nothing is printed. Handlers that the program has set before are kept. Throws std::runtime_error where ODE cannot
// start.
void enter_ode();

std::string ode_version();

}  // namespace duet
