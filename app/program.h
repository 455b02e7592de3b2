// The program `duet`: parses the command line, runs one command, turns exceptions into one sentence and an exit code.
#pragma once

#include <vector>

#include "duet/app/part.h"

namespace duet::cli {

// All of main(): the commands of the core and of the parts. Returns the exit code.
int run_program(int argc, char** argv, std::vector<Part> with);

}  // namespace duet::cli
