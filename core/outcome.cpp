#include "duet/core/outcome.h"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

// In the order of Outcome.
constexpr std::array<std::string_view, 6> kOutcomeNames = {"ok", "fell", "diverged", "timeout", "unsupported", "error"};

}  // namespace

std::string_view to_string(Outcome outcome) { return kOutcomeNames.at(static_cast<std::size_t>(outcome)); }

Outcome parse_outcome(std::string_view name) {
  const auto* const found = std::find(kOutcomeNames.begin(), kOutcomeNames.end(), name);
  if (found == kOutcomeNames.end()) {
    const std::vector<std::string> known(kOutcomeNames.begin(), kOutcomeNames.end());
    throw std::invalid_argument(unknown_name_message("outcome", name, known));
  }
  return static_cast<Outcome>(found - kOutcomeNames.begin());
}

}  // namespace duet
