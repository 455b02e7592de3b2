// Messages of planner, perception and operator to the guard over its local socket: fixed sizes, little-endian, a number
// that tells the kind. The guard takes the time of reception, never the sender's. Pure functions; no allocation.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>

#include "duet/hardware/robot_guard.h"

namespace duet {

inline constexpr std::size_t kMostGuardBytes = 1024;
using GuardBuffer = std::array<std::byte, kMostGuardBytes>;

// The datagram's length in `buffer`. A planner's command has kG1Motors targets.
std::size_t encode(const PlannerMessage& message, GuardBuffer& buffer);
std::size_t encode(const PersonMessage& message, GuardBuffer& buffer);
std::size_t encode_stop(GuardBuffer& buffer);

enum class GuardMessageKind { kRefused, kPlanner, kPerson, kStop };

// Sets the one that it is. `planner.command.q` has kG1Motors entries before.
struct GuardMessage {
  PlannerMessage planner;
  PersonMessage person;

  GuardMessage() { planner.command.q.setZero(kG1Motors); }
};
GuardMessageKind decode(std::span<const std::byte> datagram, GuardMessage& message);

}  // namespace duet
