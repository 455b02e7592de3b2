// Numbers of a YAML mapping inside their range.
#pragma once

#include "duet/robots/yaml_section.h"

namespace duet {

struct Range {
  double low, high;
  bool with_low;  // whether `low` itself is allowed
};

// The number under `key`, or `fallback`. Throws InputError (file, line, key, expected, found) outside the range.
double in_range(const YamlSection& section, const char* key, double fallback, const Range& range);

}  // namespace duet
