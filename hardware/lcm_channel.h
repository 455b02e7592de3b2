// A group of UDP multicast as LCM uses it, on one named interface: every message of HOMIE's processes passes here as
// one datagram. A message of LCM in fragments is longer than any of them, and is refused by its reader. Nothing blocks.
// One owner, one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace duet {

struct LcmPlace {
  std::string group = "239.255.76.67";
  int port = 7667;
  std::string interface = "lo";  // by name; HOMIE's own processes take that of the route to the group
  int hops = 0;                  // 0: this machine only
};

class LcmChannel {
 public:
  // Throws std::runtime_error naming the group and the interface where it cannot be joined.
  explicit LcmChannel(const LcmPlace& place);
  ~LcmChannel();
  LcmChannel(const LcmChannel&) = delete;
  LcmChannel& operator=(const LcmChannel&) = delete;

  // False where it was not sent.
  bool send(std::span<const std::byte> datagram);
  // The length of the next datagram, 0 where none waits. `own`: it is ours, which the group gives back.
  std::size_t receive(std::span<std::byte> buffer, bool& own);

 private:
  void join(const LcmPlace& place);
  void connect_to(const LcmPlace& place);

  int sends_ = -1, receives_ = -1;
  std::uint32_t own_address_ = 0;  // network byte order
  std::uint16_t own_port_ = 0;
};

}  // namespace duet
