// The remote control as the robot passes it on: 40 bytes in each low-level state. Pure functions; thread-safe.
#pragma once

#include <cstdint>
#include <span>

namespace duet {

inline constexpr int kRemoteBytes = 40;

// Bits of RemoteControl::keys.
enum class RemoteKey : int { kR1, kL1, kStart, kSelect, kR2, kL2, kF1, kF2, kA, kB, kX, kY, kUp, kRight, kDown, kLeft };

struct RemoteControl {
  std::uint16_t keys = 0;
  float lx = 0.0f, ly = 0.0f, rx = 0.0f, ry = 0.0f;  // sticks, -1 to 1
  bool heard = false;  // not all bytes are 0, which is how the robot shows that the remote control is lost

  [[nodiscard]] bool holds(RemoteKey key) const { return ((keys >> static_cast<int>(key)) & 1) != 0; }
  // Select alone, or L2 with B: the maker's keys for damping.
  [[nodiscard]] bool asks_to_stop() const;
};

RemoteControl read_remote(std::span<const std::uint8_t, kRemoteBytes> bytes);
void write_remote(const RemoteControl& remote, std::span<std::uint8_t, kRemoteBytes> bytes);

}  // namespace duet
