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

// run_suite into `arguments.output`, ended at once where it is stopped and does not listen. Throws as run_suite; a full
// disk is said with what goes on where it stopped.
RunSummary run_watched(Suite suite, const RunArguments& arguments, Progress& progress);
// 75 or 130 of a run that was stopped, 3 of one with episodes without a result.
int exit_code(const RunSummary& summary);
// The option --time-limit.
void add_time_limit(CLI::App& command, RunOptions& options);

// Runs the suite, says what came of it and sets the session's exit code. Throws as run_suite.
void run_suite_command(Session& session, RunArguments arguments);

}  // namespace duet::cli
