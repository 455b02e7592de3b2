// Options that several commands share: those of a table of fields, and those of a suite to run.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "duet/core/field.h"
#include "duet/experiment/suite/suite.h"
#include "duet/rows/folder/run_info.h"

namespace duet::cli {

// Options of a command from a table of fields.

// The options --NAME of a table of fields ('_' as '-'; `output` also as -o), which set `owner`: it outlives the
// command. `many`: the field that takes several values, joined by spaces.
void add_field(CLI::App& command, const FieldDoc& words, const std::string& values, const std::string& fallback,
               const std::function<std::string(const std::string&)>& set, bool many);
template <typename Owner>
void add_fields(CLI::App& command, const FieldTable<Owner>& table, Owner& owner, const std::string& many = "") {
  for (const Field<Owner>& known : table)
    add_field(
        command, known, known.values, known.text(owner),
        [&known, &owner](const std::string& text) { return set_field(known, owner, text); }, known.name == many);
}

// The options of every command that takes a suite to run: which, what is set in it, whose clips and networks.

struct SuiteArguments {
  std::string suite, start, partner, profile;
  std::vector<std::string> overrides, clips, networks;
  bool allow_programs = false;
};

// SUITE, --clips, --set, --network, --start, --partner, --profile, --allow-programs.
void add_suite_options(CLI::App& command, SuiteArguments& arguments);

// --engines, --controllers, --policies, --tasks, --perturbations.
void add_filters(CLI::App& command, EpisodeFilter& part);

// Throws InputError (the suite, its clips, its limits) and std::invalid_argument (an option).
Suite suite_of(const SuiteArguments& arguments);

}  // namespace duet::cli
