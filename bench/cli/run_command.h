// What `duet run` does, for commands that run a suite of their own.
#pragma once

#include <string>
#include <vector>

#include "duet/bench/cli/command.h"
#include "duet/bench/runner.h"

namespace duet::cli {

struct RunArguments {
  std::string suite, output, start, partner, profile, certificate;
  std::vector<std::string> overrides, clips, networks;
  bool dry_run = false, allow_programs = false;
  double min_effect = 5.0;  // [points]
  RunOptions options;
};

// Runs the suite, says what came of it and sets the session's exit code. Throws as run_suite.
void run_suite_command(Session& session, RunArguments arguments);

}  // namespace duet::cli
