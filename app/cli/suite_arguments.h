// The options of every command that takes a suite to run: which, what is set in it, whose clips and networks.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "duet/experiment/suite/suite.h"
#include "duet/rows/folder/run_info.h"

namespace duet::cli {

struct SuiteArguments {
  std::string suite, start, partner, profile;
  std::vector<std::string> overrides, clips, networks;
  bool allow_programs = false;
};

// SUITE, --clips, --set, --network, --start, --partner, --profile, --allow-programs.
void add_suite_options(CLI::App& command, SuiteArguments& arguments);

// --engines, --controllers, --policies, --tasks, --perturbations.
void add_filters(CLI::App& command, RunPart& part);

// Throws InputError (the suite, its clips, its limits) and std::invalid_argument (an option).
Suite suite_of(const SuiteArguments& arguments);

}  // namespace duet::cli
