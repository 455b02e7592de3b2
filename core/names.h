// Names that people type: the nearest known one, and the sentence that refuses an unknown one. Thread-safe.
#pragma once

#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

// The candidate with the smallest Damerau-Levenshtein distance (ignoring case, and '-' equal to '_'), or "" where none
// is within a third of the name's length (at least 2).
std::string closest_name(std::string_view name, std::span<const std::string> candidates);

// "unknown task 'hugg': did you mean 'hug'? Known: hug, handshake, ..." (the question only where there is a near name).
std::string unknown_name_message(std::string_view kind, std::string_view name, std::span<const std::string> candidates);

// The value of an option that is given by name, `fallback` where it is not.
std::string option_or(const std::map<std::string, std::string>& options, const std::string& name,
                      const std::string& fallback = "");

// Throws std::invalid_argument where one of the options set of `kind` `name` is not `known`: "controller 'pd': expected
// no option, found 'x'", or the sentence above.
void check_options(std::string_view kind, std::string_view name, const std::map<std::string, std::string>& options,
                   std::span<const std::string> known);

}  // namespace duet
