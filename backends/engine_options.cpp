#include "duet/backends/engine_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "duet/core/names.h"
#include "duet/core/number.h"
#include "duet/core/require.h"

namespace duet {
namespace {

const EngineOption& find(std::span<const EngineOption> known, std::string_view name) {
  for (const EngineOption& option : known)
    if (option.name == name) return option;
  throw std::logic_error(fmt::format("no engine option '{}'", name));
}

std::string value_of(const EngineOptions& options, const EngineOption& option) {
  const auto set = options.find(option.name);
  return set == options.end() ? option.value : set->second;
}

void check_value(std::string_view engine, const EngineOption& option, const std::string& text) {
  if (!option.choices.empty()) {
    require(std::find(option.choices.begin(), option.choices.end(), text) != option.choices.end(),
            "{}: {} is '{}', expected one of {}", engine, option.name, text, fmt::join(option.choices, ", "));
    return;
  }
  const double value = parse_number(text).value_or(std::nan(""));
  const bool fits = value >= option.low && value <= option.high && (!option.whole || value == std::floor(value));
  require(fits, "{}: {} is '{}', expected a {}number from {} to {}", engine, option.name, text,
          option.whole ? "whole " : "", option.low, option.high);
}

}  // namespace

EngineOption number_option(std::string name, double value, double low, double high, std::string meaning) {
  return {std::move(name), fmt::format("{}", value), {}, low, high, false, std::move(meaning)};
}

EngineOption integer_option(std::string name, int value, int low, int high, std::string meaning) {
  return {std::move(name),   fmt::format("{}", value), {}, static_cast<double>(low), static_cast<double>(high), true,
          std::move(meaning)};
}

EngineOption choice_option(std::string name, std::vector<std::string> choices, std::string meaning) {
  std::string first = choices.front();
  return {std::move(name), std::move(first), std::move(choices), 0.0, 0.0, false, std::move(meaning)};
}

void check_options(std::string_view engine, const EngineOptions& options, std::span<const EngineOption> known) {
  std::vector<std::string> names;
  for (const EngineOption& option : known) names.push_back(option.name);
  for (const auto& [name, value] : options) {
    const auto option = std::find(names.begin(), names.end(), name);
    require(option != names.end(), unknown_name_message(fmt::format("option of {}", engine), name, names));
    check_value(engine, known[option - names.begin()], value);
  }
}

double option_number(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name) {
  return parse_number(value_of(options, find(known, name))).value_or(std::nan(""));
}

int option_integer(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name) {
  return static_cast<int>(option_number(options, known, name));
}

std::string option_choice(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name) {
  return value_of(options, find(known, name));
}

}  // namespace duet
