#include "duet/hardware/wire/robot_wire.h"

#include <algorithm>
#include <cctype>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::size_t kMostInterface = 15;  // characters, as the kernel has it

bool is_name(const std::string& interface) {
  return !interface.empty() && interface.size() <= kMostInterface &&
         std::ranges::all_of(interface, [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-' || c == '@' || c == ':';
         });
}

}  // namespace

void check_place(const DdsPlace& place) {
  require(place.domain >= 0 && place.domain <= kLastTwinDomain, "domain of DDS: expected 0 to {}, found {}",
          kLastTwinDomain, place.domain);
  require(is_name(place.interface) && place.interface != "auto",
          "network interface: expected the name of one (not 'auto'), found '{}'", excerpt(place.interface));
}

bool is_twin_place(const DdsPlace& place) {
  const bool of_twins = place.domain >= kFirstTwinDomain && place.domain <= kLastTwinDomain;
  return place.interface == "lo" && (of_twins || place.domain == kSimulatorDomain);
}

void check_twin_place(const DdsPlace& place) {
  check_place(place);
  require(is_twin_place(place), "twin: expected a domain from {} to {}, or {}, on 'lo', found {} on '{}'",
          kFirstTwinDomain, kLastTwinDomain, kSimulatorDomain, place.domain, place.interface);
}

}  // namespace duet
