// A detector's verdict on a motion, and the numbers that it asks for by name.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

struct DetectorFigure {
  std::string_view name;  // in DetectorResult::values
  std::string_view unit;
  std::string_view meaning;
};

using Thresholds = std::map<std::string, double>;  // "contact", "min_frames", ...

struct DetectorResult {
  bool success = false;
  std::vector<bool> frames;              // evidence mask, T entries
  std::map<std::string, bool> parts;     // the printed sub-conditions by name
  std::map<std::string, double> values;  // what was measured: each of the detector's figures that the readings have
  // Per threshold, signed: by how much it could be tightened (positive) or must be loosened (negative) with the others
  // as they are; at exactly 0 the printed comparison decides. -infinity with fewer frames than are asked for. The
  // smallest has the sign of the verdict, for a hug "overall" (the best of its three modes) has.
  std::map<std::string, double> margins;
};

}  // namespace duet
