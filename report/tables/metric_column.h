// How a metric is named in tables; the catalogue of metrics is the caller's.
#pragma once

#include <string>

namespace duet {

struct MetricColumn {
  std::string name, title, unit, direction;  // direction: "lower", "higher", ""
};

}  // namespace duet
