// The settings that an engine's module offers, declared once: what `duet list`, profiles and error messages say.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/backends/scene.h"

namespace duet {

struct EngineOption {
  std::string name;
  std::string value;                 // the default, as text
  std::vector<std::string> choices;  // where not empty, one of these; else a number in [low, high]
  double low = 0.0, high = 0.0;
  bool whole = false;   // whole numbers only
  std::string meaning;  // with its unit
};

EngineOption number_option(std::string name, double value, double low, double high, std::string meaning);
EngineOption integer_option(std::string name, int value, int low, int high, std::string meaning);
EngineOption choice_option(std::string name, std::vector<std::string> choices, std::string meaning);  // first: default

// Throws std::invalid_argument: an unknown name (with the nearest), a value out of range or not a choice; `engine` is
// named.
void check_options(std::string_view engine, const EngineOptions& options, std::span<const EngineOption> known);

// The value that holds, set or default. std::logic_error for a name that is not in `known`.
double option_number(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name);
int option_integer(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name);
std::string option_choice(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name);

}  // namespace duet
