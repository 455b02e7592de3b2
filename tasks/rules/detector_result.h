// A detector's verdict on a motion, and the numbers that it asks for by name.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/episode_facts.h"

namespace duet {

struct DetectorFigure {
  std::string_view name;  // in DetectorResult::values
  std::string_view unit;
  std::string_view meaning;
};

using Thresholds = std::map<std::string, double>;  // "contact", "min_frames", ...

struct DetectorResult : DetectorFacts {
  std::vector<bool> frames;  // evidence mask, T entries
};

}  // namespace duet
