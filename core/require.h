// The one check for misuse. Files, engines and devices throw std::runtime_error instead; what an experiment may measure
// is a value (core/outcome.h). Thread-safe.
#pragma once

#include <fmt/core.h>

#include <stdexcept>
#include <string>

namespace duet {

// Throws std::invalid_argument(message) unless `condition` holds. The message names the object, what was expected and
// what was found.
inline void require(bool condition, const std::string& message) {
  if (!condition) throw std::invalid_argument(message);
}
inline void require(bool condition, const char* message) {
  if (!condition) throw std::invalid_argument(message);
}

[[noreturn]] void throw_invalid(fmt::string_view format, fmt::format_args arguments);

// The same with fmt's placeholders: the message is made, out of line, only where the condition does not hold.
template <typename First, typename... Rest>
void require(bool condition, fmt::format_string<First, Rest...> format, First&& first, Rest&&... rest) {
  if (!condition) throw_invalid(format, fmt::make_format_args(first, rest...));
}

// A file, an engine or a device that cannot do what was asked of it. The command line answers with exit code 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Something this build or this machine lacks (an engine, an asset, a device). The command line answers with exit
// code 4.
class MissingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace duet
