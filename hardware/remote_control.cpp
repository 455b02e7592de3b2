#include "duet/hardware/remote_control.h"

#include <algorithm>
#include <cstring>

namespace duet {
namespace {

// Places in the 40 bytes; the first two are a head that is never 0.
constexpr int kKeysAt = 2, kLxAt = 4, kRxAt = 8, kRyAt = 12, kLyAt = 20;
constexpr std::uint8_t kHeadBytes[2] = {0x55, 0x51};

template <typename T>
T value_at(std::span<const std::uint8_t, kRemoteBytes> bytes, int at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

template <typename T>
void put_at(std::span<std::uint8_t, kRemoteBytes> bytes, int at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

}  // namespace

bool RemoteControl::asks_to_stop() const {
  return holds(RemoteKey::kSelect) || (holds(RemoteKey::kL2) && holds(RemoteKey::kB));
}

RemoteControl read_remote(std::span<const std::uint8_t, kRemoteBytes> bytes) {
  return {.keys = value_at<std::uint16_t>(bytes, kKeysAt),
          .lx = value_at<float>(bytes, kLxAt),
          .ly = value_at<float>(bytes, kLyAt),
          .rx = value_at<float>(bytes, kRxAt),
          .ry = value_at<float>(bytes, kRyAt),
          .heard = std::ranges::any_of(bytes, [](std::uint8_t byte) { return byte != 0; })};
}

void write_remote(const RemoteControl& remote, std::span<std::uint8_t, kRemoteBytes> bytes) {
  std::ranges::fill(bytes, std::uint8_t{0});
  if (!remote.heard) return;
  std::ranges::copy(kHeadBytes, bytes.begin());
  put_at(bytes, kKeysAt, remote.keys);
  put_at(bytes, kLxAt, remote.lx);
  put_at(bytes, kLyAt, remote.ly);
  put_at(bytes, kRxAt, remote.rx);
  put_at(bytes, kRyAt, remote.ry);
}

}  // namespace duet
