// The run of `duet run`, for commands that run a suite of their own.
#pragma once

#include <string>

#include "duet/app/cli/arguments.h"
#include "duet/app/command.h"
#include "duet/execution/runner.h"

namespace duet::cli {

struct RunArguments {
  SuiteArguments suite;
  std::string output, certificate;
  bool dry_run = false, tables = false;
  double min_effect = 5.0;  // [points]
  RunOptions options;
};

// Runs the suite, says what came of it and sets the session's exit code. Throws as run_suite.
void run_suite_command(Session& session, RunArguments arguments);

}  // namespace duet::cli
