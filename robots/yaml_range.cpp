#include "duet/robots/yaml_range.h"

#include <fmt/format.h>

namespace duet {

double in_range(const YamlSection& section, const char* key, double fallback, const Range& range) {
  const double value = section.optional_number(key).value_or(fallback);
  if (value > range.high || value < range.low || (value == range.low && !range.with_low))
    section.fail(section.has(key) ? section.line(key) : section.line(),
                 fmt::format("{}: expected a number {} {:g}, at most {:g}, found {:g}", key,
                             range.with_low ? "from" : "above", range.low, range.high, value));
  return value;
}

}  // namespace duet
