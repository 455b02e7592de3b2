// Where on a network a robot or a twin is: a domain of DDS and one named interface, never one that the library chooses.
#pragma once

#include <string>

namespace duet {

struct DdsPlace {
  int domain = -1;
  std::string interface;  // "eth1", "lo"
};

// Domains of twins. 0 is the robot's.
inline constexpr int kFirstTwinDomain = 100, kLastTwinDomain = 199;

// Throws std::invalid_argument for a domain outside 0 to 199, and for an interface that is empty, "auto", or no name of
// one.
void check_place(const DdsPlace& place);
// The same, and that it is a twin's: domain 100 to 199 on "lo".
void check_twin_place(const DdsPlace& place);

}  // namespace duet
