// Options of a command from a table of fields.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "duet/core/field.h"

namespace duet::cli {

// The options --NAME of a table of fields ('_' as '-'; `output` also as -o), which set `owner`: it outlives the
// command. `many`: the field that takes several values, joined by spaces.
void add_field(CLI::App& command, const FieldWords& words, const std::string& values, const std::string& fallback,
               const std::function<std::string(const std::string&)>& set, bool many);
template <typename Owner>
void add_fields(CLI::App& command, const FieldTable<Owner>& table, Owner& owner, const std::string& many = "") {
  for (const Field<Owner>& known : table)
    add_field(
        command, known, known.values, known.text(owner),
        [&known, &owner](const std::string& text) { return set_field(known, owner, text); }, known.name == many);
}

}  // namespace duet::cli
