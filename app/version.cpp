#include "duet/app/version.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "duet/backends/engine_module.h"
#include "duet/core/share.h"

namespace duet {

std::string version_text() {
  std::vector<std::string> parts;
  for (const EngineInfo& engine : engines())
    if (engine.available) parts.push_back(engine.name + (engine.version.empty() ? "" : " " + engine.version));
  return fmt::format("duet {} ({})", duet_version(),
                     parts.empty() ? "no engine" : fmt::format("{}", fmt::join(parts, ", ")));
}

}  // namespace duet
